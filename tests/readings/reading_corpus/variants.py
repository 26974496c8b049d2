"""Headers and times as benches write them, made after the readers were mended and apart from them.

What is here was no pattern for a mend: names, units and orders that the other files do not hold.
"""

from collections.abc import Iterator
from datetime import datetime

from .case import Case, Truth
from .clocks import SUBJECT, clocked, moment, strftime
from .headers import comma_quoted
from .statements import WORDS
from .table import THESIS, Layout, sheet

CAUSE = "variants"
READ, ASK, CONFLICT = Truth.READ, Truth.ASK, Truth.CONFLICT

# Header, channel, unit of the numbers, truth.
HEADERS: tuple[tuple[str, str, str, Truth], ...] = (
    ("Pv,ges kW (W)", "losses_W", "kW", CONFLICT),
    ("P_Verlust_mW [W]", "losses_W", "mW", CONFLICT),
    ("loss.MW.avg (kW)", "losses_W", "MW", CONFLICT),
    ("kW_losses [W]", "losses_W", "kW", CONFLICT),
    ("LossPower/kW [W]", "losses_W", "kW", CONFLICT),
    ("Iph-mA (A)", "phase_current_A", "mA", CONFLICT),
    ("I1 RMS kA [A]", "phase_current_A", "kA", CONFLICT),
    ("I_U Apk [A_rms]", "phase_current_A", "A_peak", CONFLICT),
    ("Tcu_degF [°C]", "winding_degC", "degF", CONFLICT),
    ("T coil Kelvin (°C)", "winding_degC", "K", CONFLICT),
    ("Wicklung °F (°C)", "winding_degC", "degF", CONFLICT),
    ("I_ph_A (A, rms)", "phase_current_A", "A", READ),
    ("I_phase, mA [mA rms]", "phase_current_A", "mA", READ),
    ("Strangstrom [A eff]", "phase_current_A", "A", READ),
    ("P_loss kW [kilowatt]", "losses_W", "kW", READ),
    ("P_loss_W (Watt)", "losses_W", "W", READ),
    ("Tw degC (Celsius)", "winding_degC", "degC", READ),
    ("Verluste @ 10 kW [W]", "losses_W", "W", READ),
    ("Loss bei 400 V [kW]", "losses_W", "kW", READ),
    ("T_min [°C]", "winding_degC", "degC", READ),
    ("T_us_1 [K]", "winding_degC", "K", READ),
    ("I_V1 = A", "phase_current_A", "A", READ),
    ("TC7 = K", "winding_degC", "K", READ),
    ("Verlustleistung [kWatts]", "losses_W", "kW", READ),
    ("Strom L1 [uA rms]", "phase_current_A", "uA", READ),
    ("I L2 (µA)", "phase_current_A", "uA", READ),
    ("Iu Scheitelwert [A]", "phase_current_A", "A_peak", ASK),
    ("I_dach [A]", "phase_current_A", "A_peak", ASK),
    ("Î1 [A]", "phase_current_A", "A_peak", ASK),
    ("I_crest (A)", "phase_current_A", "A_peak", ASK),
    ("I1_0p [A]", "phase_current_A", "A_peak", ASK),
    ("I_vrh [A]", "phase_current_A", "A_peak", Truth.OPEN),
)
TIMES: tuple[tuple[str, str, Truth], ...] = (
    ("t_ms (s)", "ms", CONFLICT), ("Zeit.min [s]", "min", CONFLICT), ("t/us [ms]", "us", CONFLICT),
    ("Laufzeit [d]", "d", READ), ("Zeit_d", "d", ASK), ("Zeit (d)", "d", ASK),
)  # fmt: skip
DATES: tuple[tuple[str, str, Truth], ...] = (
    ("%d %b %Y %H:%M:%S", "Zeitstempel", READ), ("%d-%B-%Y %H:%M:%S", "timestamp", READ),
    ("%B %d, %Y %I:%M:%S %p", "timestamp", READ), ("%Y%m%dT%H%M%S.000Z", "timestamp", READ),
    ("%Y%m%d_%H%M%S", "time", READ), ("%Y%m%d%H%M%S", "time", ASK),
    ("%d-%b-%y %H:%M:%S", "time", ASK), ("%a %b %d %H:%M:%S %Y", "time", ASK),
    ("%Y-%b-%d %H:%M:%S", "time", ASK), ("%y%m%d %H%M%S", "time", ASK),
)  # fmt: skip
CLOCKS: tuple[tuple[str, str, float, Truth], ...] = (
    ("{d} days {h:02}:{m:02}:{s:02}.{f:03}000", "timedelta", 86000, READ),
    ("{d} day, {h}:{m:02}:{s:02}", "time", 86300, READ),
    ("{d}d {h:02}:{m:02}:{s:02}", "time", 86000, ASK),
    ("P{d}DT{h}H{m}M{s}S", "time", 86000, ASK),
)
LINES: tuple[tuple[str, str, str, Truth], ...] = (
    ("# Ströme als Scheitelwerte", "phase_current_A", "A_peak", ASK),
    ("# Is is given as amplitude", "phase_current_A", "A_peak", ASK),
    ("# Is = peak", "phase_current_A", "A_peak", ASK),
    ("# currents: 0-p", "phase_current_A", "A_peak", ASK),
)
MIDDLE = ("# Pd now in kW", "# ab hier Pd in kW", "# Pd: kW", "# range changed, Pd [kW]",
          "# unit of Pd is kW", "; Pd in kW")  # fmt: skip


def variants() -> Iterator[Case]:
    """All of them, each through `[columns]` where the name is none that heatrun knows."""
    for number, (header, channel, unit, truth) in enumerate(HEADERS):
        made = sheet(number, rows=200, units={channel: unit},
                     headers={channel: comma_quoted(header)})  # fmt: skip
        # The bare name as a user would copy it, without what stands in brackets.
        bare = header.split(" [")[0].split(" (")[0]
        spec = header if truth is not CONFLICT else bare
        yield made.case(
            CAUSE, f"{header}, in {unit}", truth, columns={channel: spec},
            subject=WORDS + "|amplitude|rms|peak",
        )  # fmt: skip
    for number, (header, unit, truth) in enumerate(TIMES):
        made = sheet(8 * number, rows=200, step_s=2, units={"time_s": unit},
                     headers={"time_s": header})  # fmt: skip
        columns = {} if truth is CONFLICT else {"time_s": header}
        yield made.case(CAUSE, header, truth, columns=columns, subject=WORDS + "|time|days")
    for number, (form, header, truth) in enumerate(DATES):
        start = datetime(2024, 5, 17, 23, 55, 10)
        made = moment(number, header, strftime(form), start=start, step_s=2.0)
        layout = Layout(delimiter=";")
        yield made.case(CAUSE, f"date {form}", truth, layout, columns={"time_s": header},
                        subject=SUBJECT)  # fmt: skip
    for number, (form, header, start, truth) in enumerate(CLOCKS):
        made = clocked(number, header, form, start_s=start, step_s=2)
        yield made.case(CAUSE, f"clock {form}", truth, Layout(delimiter=";"),
                        columns={"time_s": header}, subject=SUBJECT)  # fmt: skip
    for number, (line, channel, unit, truth) in enumerate(LINES):
        made = sheet(number, rows=200, units={channel: unit}, headers=THESIS)
        yield made.case(CAUSE, line, truth, Layout(before=(line,)), subject="amplitude|peak|rms")
    for number, line in enumerate(MIDDLE):
        one = sheet(number, rows=200, headers=THESIS)
        two = sheet(number, rows=200, headers=THESIS, units={"losses_W": "kW"})
        first, rest = one.text().decode().splitlines(), two.text().decode().splitlines()
        text = "\n".join([*first[:101], line, *rest[101:]]) + "\n"
        yield one.case(CAUSE, f"in the middle: {line}", ASK, text.encode(), subject="unit|comment")
    row, devices = ("s", "A", "kW", "°C", "K"), ("cDAQ", "LMG", "LMG", "Pt100", "J-type")
    for number, (name, layout, truth) in enumerate((
        ("units, devices", Layout(below=(row, devices)), READ),
        ("devices, units", Layout(below=(devices, row)), READ),
        ("units above, devices below", Layout(above=(row,), below=(devices,)), READ),
        ("units, devices, numbers of them",
         Layout(below=(row, devices, ("", "A17", "A17", "", "B2"))), READ),
        ("devices alone", Layout(below=(devices,)), ASK),
        ("devices with ranges", Layout(below=(("cDAQ", "500 mA", "3 kW", "Pt100", "J"),)), ASK),
        ("descriptions with units", Layout(below=(("since start in s", "rms in A", "sum in kW",
                                                   "air in °C", "slot in K"),)), ASK),
    )):  # fmt: skip
        made = sheet(number, rows=200, units={"losses_W": "kW", "winding_degC": "K"},
                     headers=THESIS)  # fmt: skip
        yield made.case(CAUSE, f"rows below the names: {name}", truth, layout, subject=WORDS)
