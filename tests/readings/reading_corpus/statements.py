"""Units rows, comment lines and preambles, and statements that contradict each other."""

from collections.abc import Iterator

from .case import Case, Truth
from .table import STEMS, THESIS, Layout, Sheet, sheet
from .units import FIVE, SEVEN

ROW, COMMENT, AGAINST = "units row", "comment or preamble", "statements against each other"
NAMES = {
    "time_s": "Time", "phase_current_A": "I_ph", "losses_W": "P_loss", "ambient_degC": "T_room",
    "winding_degC": "T_wdg", "speed_rpm": "n", "torque_Nm": "M",
}  # fmt: skip
NAMED = {channel: NAMES[channel] for channel in FIVE[1:]}
"""`[columns]` of them."""

WORDS = r"unit|statement|contradict|conflict|disagree|says|factor"

# Unit of time, current, losses, ambient, winding as the row writes them; unit of the numbers.
ROWS: tuple[tuple[tuple[str, ...], dict[str, str]], ...] = (
    (("s", "A", "kW", "°C", "°C"), {"losses_W": "kW"}),
    (("min", "A", "W", "degC", "degC"), {"time_s": "min"}),
    (("s", "mA", "W", "°C", "K"), {"phase_current_A": "mA", "winding_degC": "K"}),
    (("[s]", "[A]", "[kW]", "[°C]", "[°C]"), {"losses_W": "kW"}),
    (("(s)", "(A)", "(W)", "(°F)", "(°F)"), {"ambient_degC": "degF", "winding_degC": "degF"}),
    (("h", "kA", "MW", "K", "K"),
     {"time_s": "h", "phase_current_A": "kA", "losses_W": "MW", "ambient_degC": "K",
      "winding_degC": "K"}),
    (("", "", "kW", "", ""), {"losses_W": "kW"}),
    (("sec", "Arms", "kW", "degC", "degC"), {"losses_W": "kW"}),
    (("ms", "A", "W", "°C", "°C"), {"time_s": "ms"}),
)  # fmt: skip


def named(number: int, units: dict[str, str] | None = None, **more) -> Sheet:
    """Return a heat run under foreign names without units."""
    channels = more.pop("channels", FIVE)
    return sheet(number, rows=200, channels=channels, units=units, headers=NAMES, **more)


def unit_rows() -> Iterator[Case]:
    """A row of units below or above the names."""
    for number, (row, units) in enumerate(ROWS):
        made = named(number, units)
        for place, layout in (
            ("below", Layout(below=(row,))),
            ("above", Layout(above=(row,))),
            ("below, semicolons", Layout(delimiter=";", below=(row,))),
        ):
            if place.endswith("semicolons") and number % 2:
                continue
            yield made.case(
                ROW, f"{place}: {' '.join(row)}", Truth.READ, layout, columns=NAMED, subject=WORDS
            )
    units = {"losses_W": "kW", "winding_degC": "K"}
    row = ("s", "A", "kW", "°C", "K")
    devices, described = ("DAQ", "WT", "WT", "TC1", "TC2"), ("stamp", "rms", "sum", "air", "slot")
    plain = sheet(0, rows=200, units=units, headers=STEMS)
    thesis = sheet(1, rows=200, units=units, headers=THESIS)
    for name, made in (("own names", plain), ("names of the thesis", thesis)):
        for place, layout in (
            ("below", Layout(below=(row,))),
            ("above", Layout(above=(row,))),
            ("below, tabs", Layout(delimiter="\t", below=(row,))),
            ("below, an empty row between", Layout(below=(("",) * 5, row))),
            ("below, then a row of devices", Layout(below=(row, devices))),
            ("below, after a row of descriptions", Layout(below=(described, row))),
            ("above, after a preamble", Layout(before=("Test bench 3", ""), above=(row,))),
            ("below, quoted", Layout(below=(tuple(f'"{text}"' for text in row),))),
        ):
            yield made.case(ROW, f"{name}, {place}", Truth.READ, layout, subject=WORDS)
    made = named(2, {"losses_W": "kW"})
    unknown = ("s", "A", "x1000 W", "°C", "°C")
    yield made.case(ROW, "a unit that nobody knows", Truth.ASK, Layout(below=(unknown,)),
                    columns=NAMED, subject=WORDS)  # fmt: skip
    short = Layout(below=(("s", "A", "kW"),))
    yield made.case(ROW, "shorter than the table", Truth.ASK, short, columns=NAMED, subject=WORDS)


def comments() -> Iterator[Case]:
    """Units in comment lines and preambles; comments that mean something else."""
    for number, lines in enumerate((
        ("# P in kW",),
        ("# P_loss in kW",),
        ("# P_loss: kW",),
        ("# P_loss [kW]",),
        ("# P_loss = losses of the machine, kW",),
        ("# units: s, A, kW, degC, degC",),
        ("# Units: s;A;kW;°C;°C",),
        ("# unit,s,A,kW,°C,°C",),
        ("# [s] [A] [kW] [degC] [degC]",),
        ("% P_loss in kW",),
        ("// all powers in kW",),
        ("# Test 12, bench 3", "# power in kW, temperatures in degC"),
        ("P_loss in kW",),
        ("Units,s,A,kW,degC,degC",),
        ("; losses are in kilowatts",),
    )):  # fmt: skip
        made = named(number % 4, {"losses_W": "kW"})
        layout = Layout(before=lines)
        # Prose may be asked about.
        yield made.case(COMMENT, " ".join(lines), Truth.ASK, layout, columns=NAMED, subject=WORDS)
    for number, (line, channel, unit) in enumerate((
        ("# temperatures in K", "winding_degC", "K"),
        ("# T_wdg in K", "winding_degC", "K"),
        ("# T_wdg in °F", "winding_degC", "degF"),
        ("# time in min", "time_s", "min"),
        ("# Time: minutes", "time_s", "min"),
        ("# I_ph in mA", "phase_current_A", "mA"),
        ("# currents are amplitudes", "phase_current_A", "A_peak"),
        ("# I_ph: peak value", "phase_current_A", "A_peak"),
    )):  # fmt: skip
        made = named(number % 4, {channel: unit})
        yield made.case(
            COMMENT, line, Truth.ASK, Layout(before=(line,)), columns=NAMED,
            subject=WORDS + r"|kelvin|fahrenheit|minut|amplitude|rms|factor",
        )  # fmt: skip
    # What is said about other things changes nothing.
    for number, lines in enumerate((
        ("# Motor: 11 kW, 4 poles",),
        ("# Chiller 10 kW, set point 25 °C",),
        ("# Range 600 V / 20 mA, filter 1 kHz",),
        ("# Pmax = 30 kW", "# sampling: 0.5 Hz"),
        ("Report of 3 min mean values", "Operator: K. Walter"),
        ("# Duration: 10 min",),
        ("Device;WT1800;Serial 91N7;Range 500 mA", ""),
    )):  # fmt: skip
        made = sheet(number, rows=200)
        yield made.case(COMMENT, f"beside the point: {lines[0]}", Truth.PLAIN, Layout(before=lines))
        made = sheet(number, rows=200, units={"losses_W": "kW"})
        yield made.case(
            COMMENT, f"beside the point, header in kW: {lines[0]}", Truth.READ, Layout(before=lines)
        )


def conflicts() -> Iterator[Case]:
    """Two statements that cannot both be true; and two that say the same."""
    number = 0
    # Header, channel, true unit.
    for header, channel, unit in (
        ("losses_W [kW]", "losses_W", "kW"), ("losses_W [kW]", "losses_W", "W"),
        ("losses_W (mW)", "losses_W", "W"), ("winding_degC [K]", "winding_degC", "K"),
        ("winding_degC [°F]", "winding_degC", "degF"), ("time_s [min]", "time_s", "min"),
        ("time_s [ms]", "time_s", "s"), ("phase_current_A [mA]", "phase_current_A", "mA"),
        ("speed_rpm [rad/s]", "speed_rpm", "rad/s"), ("torque_Nm [Ncm]", "torque_Nm", "Ncm"),
        ("losses_kW [W]", "losses_W", "kW"), ("losses_MW_mean [kW]", "losses_W", "MW"),
        ("losses | MW [W]", "losses_W", "MW"), ("time_ms [s]", "time_s", "ms"),
        ("time:ms [h]", "time_s", "ms"), ("phase_current-Arms [mA]", "phase_current_A", "A"),
        ("losses kW [W]", "losses_W", "kW"), ("losses [kW] (W)", "losses_W", "kW"),
        ("[W] losses [kW]", "losses_W", "kW"), ("n_rpm (1000/min)", "speed_rpm", "krpm"),
    ):  # fmt: skip
        made = sheet(number, rows=200, channels=SEVEN, units={channel: unit},
                     headers={channel: header})  # fmt: skip
        columns = {channel: header} if header.startswith("n_rpm") else {}
        yield made.case(AGAINST, f"{header}, truth {unit}", Truth.CONFLICT, columns=columns,
                        subject=WORDS)  # fmt: skip
        number += 1
    # The user decides in [columns]; the last bracket there is the unit.
    for header, channel, unit in (
        ("P_loss_W [kW]", "losses_W", "kW"), ("P_kW [W]", "losses_W", "W"),
        ("P_loss kW [W]", "losses_W", "W"), ("T_degC [K]", "winding_degC", "K"),
        ("losses_W [kW]", "losses_W", "kW"), ("[W] P_loss [kW]", "losses_W", "kW"),
    ):  # fmt: skip
        made = sheet(number, rows=200, units={channel: unit}, headers={channel: header})
        yield made.case(
            AGAINST, f"{header}, decided by the same in [columns]", Truth.ASK,
            columns={channel: header}, subject=WORDS,
        )  # fmt: skip
        number += 1
    row = ("s", "A", "kW", "°C", "°C")
    for unit in ("W", "kW"):
        for name, header in (("losses_W", "losses_W"), ("losses [W]", "losses [W]"),
                             ("losses (mW)", "losses (mW)")):  # fmt: skip
            made = sheet(number, rows=200, units={"losses_W": unit}, headers={"losses_W": header})
            for place, layout in (("below", Layout(below=(row,))), ("above", Layout(above=(row,)))):
                yield made.case(
                    AGAINST, f"{name}, units row {place} says kW, truth {unit}", Truth.CONFLICT,
                    layout, subject=WORDS,
                )  # fmt: skip
            number += 1
    made = sheet(number, rows=200, units={"losses_W": "kW"}, headers={"losses_W": "P_loss [W]"})
    yield made.case(AGAINST, "comment in kW, header in W", Truth.CONFLICT,
                    Layout(before=("# P_loss in kW",)), columns={"losses_W": "P_loss [W]"},
                    subject=WORDS)  # fmt: skip
    # The user's own word for it against the file's; either may be the one that is wrong.
    for unit, spec in (("kW", "P_loss [W]"), ("W", "P_loss [mW]")):
        made = sheet(number, rows=200, units={"losses_W": unit},
                     headers={"losses_W": f"P_loss [{unit}]"})  # fmt: skip
        yield made.case(
            AGAINST, f"[columns] says {spec}, the header [{unit}]", Truth.ASK,
            columns={"losses_W": spec}, subject=WORDS,
        )  # fmt: skip
        made = named(number, {"losses_W": unit})
        yield made.case(
            AGAINST, f"[columns] says {spec}, the units row {unit}", Truth.ASK,
            Layout(below=(("s", "A", unit, "°C", "°C"),)), columns={**NAMED, "losses_W": spec},
            subject=WORDS,
        )  # fmt: skip
        number += 1
    made = sheet(number, rows=200, units={"losses_W": "kW"})
    yield made.case(AGAINST, "header and units row agree", Truth.READ, Layout(below=(row,)))
    made = named(number, {"losses_W": "kW"})
    yield made.case(
        AGAINST, "[columns] and units row agree", Truth.READ, Layout(below=(row,)),
        columns={**NAMED, "losses_W": "P_loss [kW]"},
    )  # fmt: skip
    yield made.case(
        AGAINST, "units row and comment agree", Truth.READ,
        Layout(before=("# P_loss in kW",), below=(row,)), columns=NAMED,
    )  # fmt: skip
