"""Where a header may state the unit, and how a unit may be written."""

from collections.abc import Iterator

from .case import Case, Truth
from .table import sheet
from .units import FIVE, SEVEN

PLACE, TEXT, TIME = "place of the unit", "spelling of the unit", "time in plain numbers"

FORMS: tuple[tuple[str, str], ...] = (
    ("square brackets", "{n} [{u}]"), ("round brackets", "{n} ({u})"),
    ("square, no space", "{n}[{u}]"), ("round, no space", "{n}({u})"),
    ("square, padded", "{n} [ {u} ]"), ("curly", "{n} {{{u}}}"), ("angle", "{n} <{u}>"),
    ("behind a space", "{n} {u}"), ("in front, square", "[{u}] {n}"),
    ("in front, round", "({u}) {n}"), ("in the middle", "{n} [{u}] avg"),
    ("in the middle, round", "{n} ({u}) mean"), ("in brackets with in", "{n} (in {u})"),
    ("square with in", "{n} [in {u}]"), ("in", "{n} in {u}"), ("hyphen", "{n}-{u}"),
    ("hyphen with spaces", "{n} - {u}"), ("colon", "{n}:{u}"), ("colon with spaces", "{n} : {u}"),
    ("bar", "{n}|{u}"), ("bar with spaces", "{n} | {u}"), ("underscore", "{n}_{u}"),
    ("underscore, then mean", "{n}_{u}_mean"), ("underscore, then avg", "{n}_{u}_avg"),
    ("slash", "{n}/{u}"), ("slash with spaces", "{n} / {u}"), ("comma, quoted", "{n}, {u}"),
    ("dot", "{n}.{u}"), ("equals", "{n} = {u}"), ("unit word", "{n} unit {u}"),
    ("no-break space", "{n}\N{NO-BREAK SPACE}[{u}]"),
    ("no-break space inside", "{n} [\N{NO-BREAK SPACE}{u}\N{NO-BREAK SPACE}]"),
    ("no-break space alone", "{n}\N{NO-BREAK SPACE}{u}"),
    ("narrow no-break space", "{n}\N{NARROW NO-BREAK SPACE}{u}"),
    ("full-width brackets", "{n}\N{FULLWIDTH LEFT PARENTHESIS}{u}\N{FULLWIDTH RIGHT PARENTHESIS}"),
    ("bracket and number", "CH01 {n} [{u}]"),
)  # fmt: skip
"""Grammar of headers: name and form."""

# Channel, foreign name, unit of the numbers, how the unit is written.
QUANTITIES: tuple[tuple[str, str, str, str], ...] = (
    ("losses_W", "P_loss", "kW", "kW"),
    ("torque_Nm", "M_shaft", "Ncm", "Ncm"),
    ("winding_degC", "T_wdg", "K", "K"),
    ("phase_current_A", "I_ph", "mA", "mA"),
    ("speed_rpm", "n_mot", "krpm", "krpm"),
    ("losses_W", "Pv", "mW", "mW"),
    ("torque_Nm", "torque1", "kNm", "kNm"),
    ("winding_degC", "TC3", "degF", "degF"),
    ("speed_rpm", "n", "rps", "rps"),
    ("torque_Nm", "M", "mNm", "mNm"),
    ("phase_current_A", "Iu", "kA", "kA"),
    ("speed_rpm", "omega", "rad/s", "rad/s"),
    ("winding_degC", "T_w", "degF", "°F"),
)


def subject(*words: str) -> str:
    """Return the expression that a question about these columns or units matches."""
    return "|".join(("unit", *words))


def comma_quoted(header: str) -> str:
    """Return a header as a cell of a file with commas."""
    return f'"{header}"' if "," in header else header


def places() -> Iterator[Case]:
    """Every form for two quantities, found by `[columns]`, and for the losses by their name."""
    number = 0
    for index, (name, form) in enumerate(FORMS):
        for turn in range(2):
            channel, label, unit, written = QUANTITIES[(index + 5 * turn) % len(QUANTITIES)]
            header = form.format(n=label, u=written)
            made = sheet(
                number, channels=SEVEN, units={channel: unit},
                headers={channel: comma_quoted(header)},
            )  # fmt: skip
            yield made.case(
                PLACE, f"{name}: {header}", Truth.READ, columns={channel: header},
                subject=subject(channel),
            )  # fmt: skip
            number += 1
        # Found by its own name, as the user never wrote [columns].
        header = form.format(n="losses", u="kW")
        made = sheet(number, units={"losses_W": "kW"}, headers={"losses_W": comma_quoted(header)})
        # An odd header may need [columns] to be found; what it may not do is to mislead.
        truth = Truth.READ if index < 4 or "{n}_{u}" in form else Truth.ASK
        yield made.case(PLACE, f"{name}, found by name", truth, subject=subject("losses"))
        number += 1
    # The user names the column without its unit.
    for index, form in enumerate(("{n} [{u}]", "{n} ({u})", "{n} {u}", "{n}, {u}", "{n}/{u}")):
        channel, label, unit, written = QUANTITIES[index]
        header = form.format(n=label, u=written)
        made = sheet(
            index, channels=SEVEN, units={channel: unit}, headers={channel: comma_quoted(header)}
        )
        yield made.case(
            PLACE, f"bare name in [columns]: {header}", Truth.READ, columns={channel: label},
            subject=subject(channel),
        )  # fmt: skip
    for index, (channel, label, unit, written) in enumerate(QUANTITIES):
        made = sheet(index, channels=SEVEN, units={channel: unit}, headers={channel: label})
        yield made.case(
            PLACE, f"unit in [columns] alone: {label} [{written}]", Truth.READ,
            columns={channel: f"{label} [{written}]"}, subject=subject(channel),
        )  # fmt: skip


READ, ASK = Truth.READ, Truth.ASK
SPELLINGS: tuple[tuple[str, str, str, Truth], ...] = (
    *(("losses_W", "kW", text, READ) for text in (
        "kW", "KW", "kw", "kilowatts", "kilowatt", "Kilowatt", "kWatt", "k W")),
    *(("losses_W", "W", text, READ) for text in ("W", "Watt", "watts", "WATT", "w")),
    *(("losses_W", "mW", text, READ) for text in ("mW", "milliwatts")),
    *(("losses_W", "MW", text, READ) for text in ("MW", "megawatt")),
    *(("losses_W", "kW", text, ASK) for text in (
        "x1000 W", "10^3 W", "1e3 W", "1000 W", "kVA", "W x 1000", "kJ/s")),
    *(("losses_W", "hp", text, ASK) for text in ("hp", "HP")),
    ("losses_W", "PS", "PS", ASK),
    ("losses_W", "kcal/h", "kcal/h", ASK),
    ("losses_W", "daW", "daW", ASK),
    ("losses_W", "daW", "%", ASK),
    ("losses_W", "kW", "kWh", ASK),
    *(("winding_degC", "degC", text, READ) for text in (
        "°C", "degC", "C", "deg C", "DegC", "Celsius", "° C", "ºC", "℃", "deg. C", "oC", "Grad C")),
    *(("winding_degC", "K", text, READ) for text in ("K", "Kelvin", "kelvin", "°K", "degK")),
    *(("winding_degC", "degF", text, READ) for text in (
        "°F", "degF", "F", "deg F", "Fahrenheit", "℉", "° F")),
    ("winding_degC", "degC", "Â°C", ASK),
    ("winding_degC", "degC", "?C", ASK),
    ("winding_degC", "degR", "°R", ASK),
    ("winding_degC", "0.1 degC", "0.1 °C", ASK),
    ("winding_degC", "0.1 degC", "d°C", ASK),
    ("winding_degC", "0.1 degC", "°C x 10", ASK),
    ("winding_degC", "mdegC", "m°C", ASK),
    ("winding_degC", "mdegC", "mV", ASK),
    ("winding_degC", "0.1 degC", "ohm", ASK),
    *(("speed_rpm", "rpm", text, READ) for text in (
        "rpm", "RPM", "1/min", "min-1", "min^-1", "U/min", "r/min", "rev/min", "min⁻¹", "Rpm")),
    *(("speed_rpm", "krpm", text, READ) for text in ("krpm", "kRPM")),
    *(("speed_rpm", "rps", text, READ) for text in ("rps", "rev/s", "r/s")),
    # Revolutions or radians: no unit of a speed by itself.
    *(("speed_rpm", "rps", text, ASK) for text in ("1/s", "s^-1")),
    *(("speed_rpm", "rad/s", text, READ) for text in ("rad/s", "rad s^-1", "rad·s⁻¹")),
    ("speed_rpm", "rps", "Hz", ASK),
    ("speed_rpm", "deg/s", "deg/s", ASK),
    ("speed_rpm", "deg/s", "°/s", ASK),
    ("speed_rpm", "krpm", "x1000 rpm", ASK),
    ("speed_rpm", "krpm", "1/min x 1000", ASK),
    *(("torque_Nm", "Nm", text, READ) for text in (
        "Nm", "N m", "N·m", "N*m", "N.m", "N-m", "newton metre", "N⋅m")),
    *(("torque_Nm", "mNm", text, READ) for text in ("mNm", "mN·m", "mN m")),
    *(("torque_Nm", "kNm", text, READ) for text in ("kNm", "kN·m", "kN m")),
    *(("torque_Nm", "Ncm", text, READ) for text in ("Ncm", "N cm", "N·cm")),
    *(("torque_Nm", "lbf ft", text, READ) for text in ("lbf·ft", "lbf ft", "ft-lbf")),
    *(("torque_Nm", "lbf ft", text, ASK) for text in ("lb-ft", "ft-lb", "ft lbs", "lb.ft")),
    *(("torque_Nm", "lbf in", text, ASK) for text in ("lbf·in", "in-lb")),
    *(("torque_Nm", "kgf m", text, ASK) for text in ("kgf·m", "kgm")),
    ("torque_Nm", "daNm", "daNm", ASK),
    *(("phase_current_A", "A", text, READ) for text in (
        "A", "Arms", "A rms", "A_rms", "A RMS", "A eff", "Aeff", "Ampere", "amps", "A, rms")),
    *(("phase_current_A", "mA", text, READ) for text in ("mA", "mA rms", "milliamps")),
    *(("phase_current_A", "kA", text, READ) for text in ("kA", "kA rms")),
    *(("phase_current_A", "uA", text, READ) for text in ("uA", "µA", "μA")),
    *(("phase_current_A", "A_peak", text, READ) for text in (
        "A_peak", "A peak", "Apk", "A pk", "A (peak)", "A, peak", "Apeak")),
    ("phase_current_A", "A_peak", "A amplitude", ASK),
    ("phase_current_A", "A_peak", "Â", ASK),
    *(("dc_voltage_V", unit, unit, READ) for unit in ("mV", "kV", "V")),
    ("dc_voltage_V", "V", "Volt", READ),
    ("dc_voltage_V", "V", "VDC", ASK),
    ("dc_current_A", "A", "ADC", ASK),
    *(("coolant_flow_L_per_min", "L/min", text, READ) for text in (
        "L/min", "l/min", "L min^-1", "litres/min")),
    ("coolant_flow_L_per_min", "L/h", "L/h", READ),
    ("coolant_flow_L_per_min", "L/s", "L/s", READ),
    ("coolant_flow_L_per_min", "m3/h", "m3/h", READ),
    ("coolant_flow_L_per_min", "m3/h", "m³/h", READ),
    ("coolant_flow_L_per_min", "gpm", "gpm", ASK),
    ("coolant_flow_L_per_min", "mL/min", "mL/min", ASK),
    ("coolant_flow_L_per_min", "L/min", "kg/min", ASK),
)  # fmt: skip

LABELS = {
    "losses_W": "Verlust", "winding_degC": "Fuehler 3", "speed_rpm": "Drehzahl",
    "torque_Nm": "Moment", "phase_current_A": "Strom U", "dc_voltage_V": "U_zk",
    "dc_current_A": "I_zk", "coolant_flow_L_per_min": "Durchfluss",
}  # fmt: skip


def spellings() -> Iterator[Case]:
    """Units in brackets, spelled as benches spell them, and texts that only look like units."""
    for number, (channel, unit, text, truth) in enumerate(SPELLINGS):
        header = f"{LABELS[channel]} [{text}]"
        channels = FIVE if channel in FIVE else (*FIVE, channel)
        made = sheet(
            number, rows=200, channels=channels, units={channel: unit},
            headers={channel: comma_quoted(header)},
        )  # fmt: skip
        yield made.case(
            TEXT, f"{channel} in {text}", truth, columns={channel: header},
            subject=subject(channel, header.split(" [")[0]),
        )  # fmt: skip
    # The word for an amplitude stands in the name, the unit says nothing of it.
    for number, label in enumerate((
        "I_peak [A]", "I_phase_pk [A]", "I amplitude [A]", "I_hat [A]", "I_max [A]",
        "Peak current [A]",
    )):  # fmt: skip
        made = sheet(
            number, units={"phase_current_A": "A_peak"}, headers={"phase_current_A": label}
        )
        yield made.case(
            TEXT, f"amplitude in the name: {label}", ASK, columns={"phase_current_A": label},
            subject=r"peak|amplitude|rms|√2|1\.41|current",
        )  # fmt: skip


# Header, unit of its numbers, decimals, step [s], truth.
TIMES: tuple[tuple[str, str, int, float, Truth], ...] = (
    ("time [min]", "min", 4, 6, READ), ("Time (min)", "min", 4, 6, READ),
    ("t_min", "min", 5, 2, READ), ("time_min", "min", 3, 6, READ),
    ("Zeit [h]", "h", 6, 2, READ), ("time_h", "h", 5, 18, READ), ("Time [ms]", "ms", 0, 2, READ),
    ("time_ms", "ms", 0, 1, READ), ("Time/ms", "ms", 0, 2, READ), ("t / s", "s", 1, 0.5, READ),
    ("t [us]", "us", 0, 0.5, READ), ("time [µs]", "us", 0, 0.5, READ),
    ("time [ns]", "ns", 0, 0.5, READ), ("Time [hours]", "h", 6, 9, READ),
    ("Time [hrs]", "h", 6, 9, READ), ("Time [minutes]", "min", 4, 3, READ),
    ("Time (mins)", "min", 4, 3, READ), ("time in minutes", "min", 4, 3, READ),
    ("Elapsed time (min)", "min", 4, 3, READ), ("Elapsed Time [Sec]", "s", 1, 1, READ),
    ("time (sec)", "s", 1, 1, READ), ("Time [seconds]", "s", 0, 2, READ),
    ("Time [msec]", "ms", 0, 1, READ), ("Time [millisec]", "ms", 0, 1, ASK),
    ("Time [d]", "d", 8, 2, READ), ("Time [days]", "d", 8, 2, READ),
    ("time min", "min", 3, 6, READ),
    ("[min] time", "min", 3, 6, READ), ("time|min", "min", 3, 6, READ),
    ("time: min", "min", 3, 6, READ), ("time-min", "min", 3, 6, READ), ("Time, h", "h", 6, 9, READ),
    ("Zeit in Stunden", "h", 6, 9, READ), ("Zeit [Std]", "h", 6, 9, ASK),
    ("Zeit [Min.]", "min", 3, 6, READ), ("Time [1/100 s]", "ms", 0, 2, ASK),
    ("t", "min", 4, 2, ASK), ("time", "min", 4, 2, ASK), ("Time", "h", 6, 2, ASK),
    ("t", "ms", 0, 2, ASK), ("Time", "ms", 0, 1, ASK), ("Zeit", "min", 3, 6, ASK),
    ("time", "min", 0, 60, ASK), ("t", "h", 4, 18, ASK), ("time", "us", 0, 1, ASK),
    ("time", "d", 8, 2, ASK), ("elapsed time", "min", 4, 1, ASK),
    ("t", "s", 0, 1, Truth.PLAIN), ("time", "s", 1, 0.5, Truth.PLAIN),
    ("Time", "s", 3, 0.1, Truth.PLAIN), ("Zeit", "s", 0, 10, Truth.PLAIN),
    ("Elapsed Time", "s", 2, 1, Truth.PLAIN), ("timestamp", "s", 0, 5, Truth.PLAIN),
)  # fmt: skip


def times() -> Iterator[Case]:
    """Times as plain numbers, and sample numbers."""
    words = r"unit|minutes|hours|millisec|microsec|factor|days|\[(ms|min|h|d|us)\]"
    for number, (header, unit, decimals, step, truth) in enumerate(TIMES):
        place = number % 4 + 8 * (number // 4)
        made = sheet(
            place, rows=200 if step >= 1 else 600, step_s=step, units={"time_s": unit},
            decimals={"time_s": decimals},
            headers={"time_s": comma_quoted(header)},
        )  # fmt: skip
        name = f"{header}, numbers in {unit}, every {step:g} s"
        yield made.case(TIME, name, truth, subject=words)
    for number, (header, rate_Hz, columns, at, truth) in enumerate((
        ("Sample", 10, {}, "", ASK),
        ("Scan", 1, {}, "", ASK),
        ("No.", 2, {}, "", ASK),
        ("Index", 0.2, {}, "", ASK),
        ("Record #", 10, {}, "", ASK),
        ("Sample", 10, {"time_s": "rate 10 Hz"}, "", READ),
        ("No.", 2, {"time_s": "rate 2 Hz"}, "", READ),
        ("Scan", 0.5, {}, "@0.5Hz", READ),
        ("Index", 10, {}, "@10Hz", READ),
        ("time", 10, {}, "", Truth.OPEN),
        ("t", 0.02, {}, "", Truth.OPEN),
        ("time [samples]", 10, {}, "", ASK),
        ("sample number", 5, {}, "", ASK),
    )):  # fmt: skip
        made = sheet(
            number % 4, rows=400, step_s=1 / rate_Hz, headers={"time_s": header},
            cells={"time_s": lambda time_s, rate=rate_Hz: f"{time_s * rate:.0f}"}, written_s=1e-6,
        )  # fmt: skip
        yield made.case(
            TIME, f"sample number as {header} at {rate_Hz:g} Hz{at or list(columns.values())}",
            truth, columns=columns, at=at,
            subject=r"sample|rate|unit|factor|time column|minut",
        )  # fmt: skip
