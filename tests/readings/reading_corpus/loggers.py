"""Plain good files as benches and loggers write them: a question about one of them is a fault."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .case import Case, Truth
from .clocks import clock, moment
from .layouts import chosen
from .numbers_text import comma
from .table import STEMS, THESIS, Layout, sheet
from .units import DRIVE, FIVE, SEVEN

PLAIN = "plain files of loggers"
COMMA = {"imc FAMOS", "HBM catman", "HBM catman, time in [columns]", "CANape"}
"""Whose numbers have a decimal comma."""

FOREIGN: tuple[tuple[str, str, dict[str, str], Layout], ...] = (
    ("HIOKI LR8450", "Time[s]|CH1[A]|CH2[W]|CH3[°C]|CH4[°C]", {}, Layout(before=(
        '"HIOKI LR8450"', '"Ver","1.10"', '"Title comment",""',
        '"Trigger time","24-05-17 10:00:00"', ""))),
    ("Yokogawa WT", "Elapsed Time [s]|Irms-1 [A]|Loss [kW]|AUX1 [degC]|AUX2 [degC]",
     {"losses_W": "kW"}, Layout(before=("WT1800E", "Update Rate,2 s", ""))),
    ("Yokogawa, units row", "Time|CH001|CH002|CH003|CH004", {},
     Layout(before=("Model Name,GM10",), below=(("s", "A", "W", "C", "C"),))),
    ("Dewesoft", "Time (s)|I_rms (A)|P_loss (W)|T_amb (°C)|T_wdg (°C)", {}, Layout("\t", before=(
        "File name: Test_0001.dxd", "Sample rate: 0.5", "Store date: 5/17/2024", ""))),
    ("imc FAMOS", "Zeit [s]|I_eff [A]|P_v [W]|T_U [°C]|T_W [°C]", {},
     Layout(";", "cp1252", "\r\n")),
    ("HBM catman", "Zeit [s]|Strom [A]|Verlustleistung [W]|Pt100_1 [°C]|Pt100_2 [°C]", {},
     Layout("\t", "cp1252", before=("HBM_CATMAN_DATAFILE_40", ""))),
    ("HBM catman, time in [columns]",
     "|Strom [A]|Verlustleistung [W]|Pt100_1 [°C]|Pt100_2 [°C]", {}, Layout("\t", "cp1252")),
    ("Fluke Hydra", "Time (s)|||Chan 2 (C)|Chan 1 (C)", {}, Layout()),
    ("PicoLog", '"Time (s)"|||Air Ave. (°C)|Winding Ave. (°C)', {}, Layout()),
    ("Agilent BenchLink", "Time (s)|||102 <Air> (C)|101 <Winding> (C)", {}, Layout(before=(
        "Name:,Config1", "Owner:,lab", "Acquisition Date:,5/17/2024 10:00:00 AM", ""))),
    ("Graphtec", "Time [s]|||CH2 [degC]|CH1 [degC]", {}, Layout(before=(
        "Vendor,GRAPHTEC Corporation", "Model,GL840", "Sampling interval,2s"))),
    ("Keysight DAQ970A", "Time [s]|||T_a [C]|101 (VDC) T_w [C]", {}, Layout()),
    ("MATLAB writetable", "time_s||P_v_kW||T_w_degC", {"losses_W": "kW"}, Layout()),
    ("LabVIEW write to spreadsheet", "Time [s]||||Winding [degC]", {},
     Layout("\t", newline="\r\n")),
    ("INCA", "time [s]||PLoss\\ETKC:1 [W]||TWdg\\ETKC:1 [degC]", {}, Layout(";")),
    ("CANape", "t[s]||Inv.P_Loss[kW]||Inv.T_Wdg[°C]", {"losses_W": "kW"}, Layout(";")),
    ("kelvin and mA", "time [s]|I [mA]|||TW [K]", {"winding_degC": "K", "phase_current_A": "mA"},
     Layout()),
    ("drive in foreign units", "Time [ms]||Loss [mW]|||Omega [rad/s]|Torque [mNm]",
     {"time_s": "ms", "speed_rpm": "rad/s", "torque_Nm": "mNm", "losses_W": "mW"}, Layout()),
    ("names with figures and units of others", "||P_12V_supply [W]||T_20kW_bench [degC]", {},
     Layout()),
    ("names that end in letters of units", "|I_W [A]|loss_A [W]|T_C2 [degC]|temp_K1 [degC]", {},
     Layout()),
    ("phases U V W in the names", "|I_V|P_U||T_W", {}, Layout()),
    ("slot numbers in the names",
     "|I phase mean (3 phases)|P loss total (calc.)||T winding slot 12 (DE)", {}, Layout()),
    ("sensor types in the names", "|||T_a (type K)|T_w (PT100)", {}, Layout()),
)  # fmt: skip
"""Name, heads (those that are left out are canonical), units and layout."""


def loggers() -> Iterator[Case]:
    """Plain good files as loggers write them; none of them deserves a question."""
    number = 0
    for step, rows in ((0.1, 1500), (0.5, 800), (1.0, 900), (2.0, 400), (5.0, 300), (10.0, 250)):
        for name, headers, channels in (
            ("canonical names", {}, FIVE),
            ("canonical names with a drive", {}, DRIVE),
            ("names of the thesis", THESIS, FIVE),
            ("stems", STEMS, FIVE),
        ):
            # A record of less than some minutes says too little of the machine to be judged.
            made = sheet(number, rows=rows, step_s=step, headers=headers, channels=channels)
            yield made.case(PLAIN, f"{name}, every {step:g} s", Truth.PLAIN)
            number += 1
    for decimals in (0, 1, 2):
        for machine in (0, 3):
            made = sheet(
                8 + machine,
                rows=500,
                step_s=2,
                decimals=dict.fromkeys(("ambient_degC", "winding_degC", "losses_W"), decimals),
            )
            yield made.case(PLAIN, f"{decimals} decimals, machine {machine}", Truth.PLAIN)
    made = sheet(3, rows=500, step_s=2, decimals=dict.fromkeys(SEVEN, 0), channels=SEVEN)
    yield made.case(PLAIN, "integers alone", Truth.PLAIN)

    for name, heads, units, layout in FOREIGN:
        number += 1
        channels = SEVEN if heads.count("|") > 4 else FIVE
        headers = {c: head for c, head in zip(channels, heads.split("|"), strict=True) if head}
        made = sheet(number, rows=300, headers=headers, units=units, channels=channels)
        if name in COMMA:
            made = made.with_cells("*", comma)
        yield made.case(PLAIN, name, Truth.READ, layout, columns=chosen(headers))
    for name, header, write in (
        ("clock", "Time", "%H:%M:%S"),
        ("ISO dates", "timestamp", "%Y-%m-%d %H:%M:%S"),
        ("Excel, German", "Zeit", "%d.%m.%Y %H:%M:%S"),
        ("Excel, American", "Date Time", "%m/%d/%Y %H:%M:%S"),
    ):
        number += 1
        made = moment(number, header, lambda when, form=write: when.strftime(form), step_s=2.0)
        yield made.case(PLAIN, name, Truth.READ, Layout(delimiter=";"))
    number += 1
    made = sheet(number, rows=300, step_s=60.0, headers={"time_s": "Time [hh:mm]"},
                 cells={"time_s": clock("{H:02}:{m:02}")}, written_s=1e-4)  # fmt: skip
    yield made.case(PLAIN, "a duty of five hours in minutes", Truth.READ)
    rng = np.random.default_rng(5)
    for machine in range(4):
        number += 1
        made = sheet(machine, rows=600, step_s=1.0, decimals={"losses_W": 1})
        noise = rng.normal(0, 0.05, 600)
        truth = dict(made.truth)
        truth["winding_degC"] = truth["winding_degC"] + noise
        shaken = iter(noise)
        made = made.with_cells(
            "winding_degC", lambda cell, shaken=shaken: f"{float(cell) + next(shaken):.5f}"
        )
        # Rounded twice to four digits.
        made = replace(made, truth=truth, tolerance={**made.tolerance, "winding_degC": 1.1e-4})
        yield made.case(PLAIN, f"noise, machine {machine}", Truth.PLAIN)
