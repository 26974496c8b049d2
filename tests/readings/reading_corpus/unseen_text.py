"""Unseen text files that state what they hold, in the languages and habits of many programs."""

from collections.abc import Iterator
from itertools import count

from .case import Case, Truth
from .table import Layout
from .units import FIVE, SEVEN
from .unseen_file import changed, comma, made, unseen

READ = Truth.READ
HEADERS: tuple[tuple[str, str, str, Layout], ...] = (
    ("German with slashes", "Zeit / min|I_eff / A|P_V / kW|T_U / °C|T_W / °C",
     "min - kW - -", Layout(";")),
    ("German with in", "t in h|I in A|P_V in W|T_U in K|T_W in K", "h - - K K", Layout("\t")),
    ("French in Latin-1",
     "Temps (s)|Courant efficace (A)|Pertes (kW)|T ambiante (°C)|T bobinage (°C)",
     "- - kW - -", Layout(";", "latin-1")),
    ("Italian", "Tempo [min]|Corrente di fase [Arms]|Perdite [kW]|T aria [°C]|T avvolgimento [°C]",
     "min - kW - -", Layout(";")),
    ("Spanish", "Tiempo (ms)|Corriente (A)|Pérdidas (kW)|T ambiente (°C)|T devanado (°C)",
     "ms - kW - -", Layout(",", "cp1252")),
    ("Japanese", "時間[s]|相電流[A]|損失[kW]|周囲温度[℃]|巻線温度[℃]", "- - kW - -",
     Layout(bom=b"\xef\xbb\xbf")),
    ("Chinese brackets", "时间（ms）|电流（A）|损耗（kW）|环境温度（℃）|绕组温度（℃）",
     "ms - kW - -", Layout()),
    ("Polish in cp1250", "Czas [s]|Prąd [A]|Straty [kW]|Otoczenie [°C]|Uzwojenie [°C]",
     "- - kW - -", Layout(";", "cp1250")),
    ("Swedish", "Tid (s)|Fasström (A)|Förluster (kW)|Omgivning (°C)|Lindning (°C)",
     "- - kW - -", Layout("\t", "utf-16-le", bom=b"\xff\xfe")),
    ("Kelvin and mA", "time [s]|I [mA]|P [W]|Ta [K]|Tw [K]", "- mA - K K", Layout()),
    ("Fahrenheit spelled out", "time (s)|I (A)|P (W)|Ta (deg F)|Tw (degrees Fahrenheit)",
     "- - - F F", Layout()),
    ("Fahrenheit in camel case", "timeSec|iPhaseAmps|lossWatts|ambDegF|windingDegF",
     "- - - F F", Layout()),
    ("spelled out with underscores",
     "time_min|current_amps|loss_kilowatts|amb_celsius|winding_celsius",
     "min - kW - -", Layout()),
    ("names made valid by R", "time..min.|I..A.|P_loss..kW.|Ta..K.|Tw..K.",
     "min - kW K K", Layout()),
    ("names made valid by MATLAB", "time_min_|I_A_|P_loss_kW_|Ta_K_|Tw_K_",
     "min - kW K K", Layout()),
    ("LaTeX",
     r"$t$ [min]|$I_\mathrm{eff}$ [A]|$P_\mathrm{V}$ [kW]|$T_a$ [$^\circ$C]|$T_w$ [$^\circ$C]",
     "min - kW - -", Layout(";")),
    ("HTML degree signs", "t [min]|I [A]|P [kW]|Ta [&deg;C]|Tw [&deg;C]", "min - kW - -", Layout()),
    ("degree signs decoded twice", "t [min]|I [A]|P [kW]|Ta [Â°C]|Tw [Â°C]",
     "min - kW - -", Layout()),
    ("signals of CAN messages",
     "Time[ms]|Inv1::PhaseCurrent[A]|Inv1::PowerLoss[kW]|Ambient::T1[degC]|Inv1::TempWinding[degC]",
     "ms - kW - -", Layout(";")),
    ("paths of XCP",
     r"time [s]|Iph\XCP:1 [A]|Ploss\XCP:1 [kW]|Tamb\ETKC:2 [degC]|Twdg\ETKC:2 [degC]",
     "- - kW - -", Layout("\t")),
    ("units and statistics in one bracket",
     "t [s]|I [A, rms]|P [kW, mean]|Ta [°C, mean]|Tw [°C, max]",
     "- - kW - -", Layout(";")),
    ("mean of power in braces", "t {min}|I {A}|P {kW}|Ta {°C}|Tw {°C}", "min - kW - -", Layout()),
    ("unit before a channel number",
     "t [s]|I [A] (ch 1)|P [kW] (ch 4)|Ta [°C] (ch 11)|Tw [°C] (ch 12)",
     "- - kW - -", Layout()),
    ("a channel number before", "0: t [s]|1: I [A]|2: P [kW]|3: Ta [°C]|4: Tw [°C]",
     "- - kW - -", Layout()),
    ("amplitudes", "time [s]|I_phase [A_peak]|P [W]|Ta [°C]|Tw [°C]", "- peak - - -", Layout()),
    ("capital kilowatts", "TIME (SEC)|CURRENT (AMPS)|LOSS (KW)|AMBIENT (DEG C)|WINDING (DEG C)",
     "- - kW - -", Layout()),
    ("units of the C kind", "t_ms|i_mA|p_W|ta_degC|tw_degC", "ms mA - - -", Layout()),
    ("Rankine", "t [s]|I [A]|P [W]|Ta [°R]|Tw [°R]", "- - - R R", Layout()),
    ("microseconds", "t [µs]|I [kA]|P [kW]|Ta [°C]|Tw [°C]", "us kA kW - -", Layout()),
    ("the other micro sign", "t [μs]|I [A]|P [kW]|Ta [°C]|Tw [°C]", "us - kW - -", Layout()),
    ("a ratio of units", "t / (min)|I / (A)|P / (kW)|Ta / (°C)|Tw / (°C)",
     "min - kW - -", Layout(";")),
    ("units after a comma, quoted", '"t, min"|"I, A"|"P, kW"|"Ta, °C"|"Tw, °C"',
     "min - kW - -", Layout()),
)  # fmt: skip


def headers() -> Iterator[Case]:
    """Make headers that hold the unit."""
    for number, (name, heads, units, layout) in enumerate(HEADERS, 830):
        sheet = made(number, heads, units)
        if layout.delimiter == ";":
            sheet = comma(sheet)
        columns = {c.channel: c.header.strip('"') for c in sheet.columns}
        yield unseen(name, READ, sheet, layout, columns=columns)
    n = count(870)
    for name, heads, units in (
        ("speed of a German bench", "n [U/min]|M [Nm]", "- -"),
        ("speed in 1/s", "n [1/s]|M [N·m]", "1/s -"),
        ("speed in min⁻¹", "n [min⁻¹]|M [N⋅m]", "- -"),
        ("speed of a French bench", "Régime [tr/min]|Couple [N.m]", "- -"),
        ("rad/s and lbf ft", "omega (rad/s)|M (lbf·ft)", "rad/s|lbf ft"),
        ("rpm and in-lbs", "n (RPM)|M (in-lbf)", "-|lbf in"),
        ("kilopond metres", "n (r/min)|M (kgf·m)", "- kpm"),
    ):
        keys = "|".join(["-"] * 5 + (units.split("|") if "|" in units else units.split()))
        sheet = made(next(n), "|".join(FIVE) + "|" + heads, keys, channels=SEVEN)
        yield unseen(name, READ, sheet)
    for name, head, unit in (
        ("flow in l/h", "Q [l/h]", "l/h"), ("flow in m³/h", "Q [m³/h]", "m3/h"),
        ("flow in US gallons", "Q (GPM)", "gpm"),
    ):  # fmt: skip
        sheet = made(next(n), "|".join(FIVE) + "|" + head, f"- - - - - {unit}",
                     channels=(*FIVE, "coolant_flow_L_per_min"))  # fmt: skip
        truth = Truth.ASK if unit == "gpm" else READ  # an American gallon or a British one
        yield unseen(name, truth, sheet)


def rows_of_units() -> Iterator[Case]:
    """Make units in rows and lines of their own, as programs export them."""
    n = count(890)
    heads, units = "Time|I_rms|P_loss|T_amb|T_wdg", "min - kW - -"
    bare = ("min", "A", "kW", "°C", "°C")
    for name, layout in (
        ("a units row with brackets", Layout("\t", below=(tuple(f"[{u}]" for u in bare),))),
        ("a units row above", Layout(";", above=(bare,))),
        ("a row of types and a row of units", Layout(below=(("double",) * 5, bare))),
        ("a row of descriptions and a row of units",
         Layout(";", below=(("clock", "phase U", "analyser", "room", "slot 3"), bare))),
        ("a units row and an empty row", Layout(below=(bare, ("",) * 5))),
        ("y labels of LabVIEW", Layout("\t", before=(
            "LabVIEW Measurement", "Separator\tTab", "Decimal_Separator\t.",
            "***End_of_Header***", "Channels\t4",
            "Y_Unit_Label\tAmperes\tkW\tDeg C\tDeg C", "X_Dimension\tTime", "***End_of_Header***",
        ))),
        ("a list of channels above", Layout(";", before=(
            "Channel;Unit;Device", "Time;min;PC", "I_rms;A;WT1806", "P_loss;kW;WT1806",
            "T_amb;°C;GL840", "T_wdg;°C;GL840", "",
        ))),
        ("a comment for each column", Layout(before=(
            "# Time: minutes since start", "# I_rms: phase current, A rms", "# P_loss: losses, kW",
            "# T_amb: room, degC", "# T_wdg: slot sensor, degC",
        ))),
    ):  # fmt: skip
        if name.startswith("y labels"):
            sheet = made(next(n), heads, "- - kW - -")
        else:
            sheet = made(next(n), heads, units)
        yield unseen(name, READ, sheet, layout)
    sheet = made(next(n), "t|I|P|Ta|Tw", units)
    columns = {"time_s": "t [min]", "phase_current_A": "I [A]", "losses_W": "P [kW]",
               "ambient_degC": "Ta [°C]", "winding_degC": "Tw [°C]"}  # fmt: skip
    yield unseen("the motor file states the units", READ, sheet, columns=columns)
    sheet = made(next(n), "Time|I_rms|P_loss [kW]|T_amb|T_wdg", "- - kW - -")
    yield unseen("one header of five with a unit", READ, sheet)


def rules_of_tables() -> Iterator[Case]:
    """Make tables of databases, of Markdown and of statistics programs."""
    n = count(905)
    sheet = made(next(n))
    rule = "+".join(["-" * 9] * 5)
    yield unseen("a table of psql", READ, sheet,
                 Layout(" | ", below=((rule,),),
                        after=("(160 rows)",)), mapped=False)  # fmt: skip
    markdown = Layout(row=lambda row: "| " + " | ".join(row) + " |", below=(("---",) * 5,))
    yield unseen("a table of Markdown", READ, made(next(n)), markdown, mapped=False)
    sheet = made(next(n))
    lines = sheet.text(Layout(" ", row=lambda row: " ".join(row))).decode().splitlines()
    text = "\n".join([" ".join(f'"{name}"' for name in lines[0].split()),
                      *(f'"{i}" {line}' for i, line in enumerate(lines[1:], 1))])  # fmt: skip
    yield unseen("row names of R", READ, sheet, text.encode(), mapped=False)
    for name, after in (
        ("an end mark", ("*** END OF FILE ***",)), ("a checksum", ("# crc32: 9A3F01BC",)),
        ("a note at the end", ("", "Test stopped by operator at 65 degC",)),
    ):  # fmt: skip
        yield unseen(name, READ, made(next(n)), Layout(after=after), mapped=False)
    yield unseen("mixed line ends", READ, made(next(n)), Layout(rows=lambda lines: [
        line + "\r" * (i % 2) for i, line in enumerate(lines)]), mapped=False)  # fmt: skip
    sheet = made(next(n))
    lone = changed(sheet, lambda i, row: [*row[:4], "NaN"] if i in (40, 41) else row)
    sheet.truth["winding_degC"] = sheet.truth["winding_degC"].copy()
    sheet.truth["winding_degC"][40:42] = float("nan")
    yield unseen("two NaN", READ, sheet, lone, mapped=False)


SOURCES = (headers, rows_of_units, rules_of_tables)
