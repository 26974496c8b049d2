"""Plain good files as benches and loggers write them: a question about one of them is a fault."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .case import Case, Truth
from .clocks import clock, moment
from .layouts import chosen
from .numbers_text import comma
from .table import Layout, sheet
from .units import DRIVE, FIVE, SEVEN

PLAIN = "plain files of loggers"


def loggers() -> Iterator[Case]:
    """Plain good files as loggers write them; none of them deserves a question."""
    number = 0
    thesis = {"time_s": "t", "phase_current_A": "Is", "losses_W": "Pd", "ambient_degC": "Te",
              "winding_degC": "Tw_m"}  # fmt: skip
    stems = {"time_s": "time", "phase_current_A": "phase_current", "losses_W": "losses",
             "ambient_degC": "ambient", "winding_degC": "winding"}  # fmt: skip
    for step, rows in ((0.1, 1500), (0.5, 800), (1.0, 900), (2.0, 400), (5.0, 300), (10.0, 250)):
        for name, headers, channels in (
            ("canonical names", {}, FIVE),
            ("canonical names with a drive", {}, DRIVE),
            ("names of the thesis", thesis, FIVE),
            ("stems", stems, FIVE),
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

    def foreign(name, headers, layout, units=None, more=None, decimal_comma=False, channels=FIVE):
        nonlocal number
        number += 1
        made = sheet(
            number, rows=300, headers=headers, units=units, channels=channels, **(more or {})
        )
        if decimal_comma:
            made = made.with_cells("*", comma)
        return made.case(
            PLAIN, name, Truth.READ, layout, columns=chosen(headers) if headers else {}
        )

    yield foreign(
        "HIOKI LR8450",
        {"time_s": "Time[s]", "phase_current_A": "CH1[A]", "losses_W": "CH2[W]",
         "ambient_degC": "CH3[°C]", "winding_degC": "CH4[°C]"},
        Layout(before=('"HIOKI LR8450"', '"Ver","1.10"', '"Title comment",""',
                       '"Trigger time","24-05-17 10:00:00"', "")),
    )  # fmt: skip
    yield foreign(
        "Yokogawa WT",
        {"time_s": "Elapsed Time [s]", "phase_current_A": "Irms-1 [A]", "losses_W": "Loss [kW]",
         "ambient_degC": "AUX1 [degC]", "winding_degC": "AUX2 [degC]"},
        Layout(before=("WT1800E", "Update Rate,2 s", "")), {"losses_W": "kW"},
    )  # fmt: skip
    yield foreign(
        "Yokogawa, units row",
        {"time_s": "Time", "phase_current_A": "CH001", "losses_W": "CH002",
         "ambient_degC": "CH003", "winding_degC": "CH004"},
        Layout(before=("Model Name,GM10",), below=(("s", "A", "W", "C", "C"),)),
    )  # fmt: skip
    yield foreign(
        "Dewesoft",
        {"time_s": "Time (s)", "phase_current_A": "I_rms (A)", "losses_W": "P_loss (W)",
         "ambient_degC": "T_amb (°C)", "winding_degC": "T_wdg (°C)"},
        Layout(delimiter="\t", before=("File name: Test_0001.dxd", "Sample rate: 0.5",
                                       "Store date: 5/17/2024", "")),
    )  # fmt: skip
    yield foreign(
        "imc FAMOS",
        {"time_s": "Zeit [s]", "phase_current_A": "I_eff [A]", "losses_W": "P_v [W]",
         "ambient_degC": "T_U [°C]", "winding_degC": "T_W [°C]"},
        Layout(delimiter=";", encoding="cp1252", newline="\r\n"), decimal_comma=True,
    )  # fmt: skip
    yield foreign(
        "HBM catman",
        {"time_s": "Zeit [s]", "phase_current_A": "Strom [A]",
         "losses_W": "Verlustleistung [W]", "ambient_degC": "Pt100_1 [°C]",
         "winding_degC": "Pt100_2 [°C]"},
        Layout(delimiter="\t", encoding="cp1252", before=("HBM_CATMAN_DATAFILE_40", "")),
        decimal_comma=True, more=None,
    )  # fmt: skip
    yield foreign(
        "HBM catman, time in [columns]",
        {"phase_current_A": "Strom [A]", "losses_W": "Verlustleistung [W]",
         "ambient_degC": "Pt100_1 [°C]", "winding_degC": "Pt100_2 [°C]"},
        Layout(delimiter="\t", encoding="cp1252"), decimal_comma=True,
    )  # fmt: skip
    yield foreign(
        "Fluke Hydra", {"time_s": "Time (s)", "winding_degC": "Chan 1 (C)",
                        "ambient_degC": "Chan 2 (C)"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "PicoLog", {"time_s": '"Time (s)"', "winding_degC": "Winding Ave. (°C)",
                    "ambient_degC": "Air Ave. (°C)"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "Agilent BenchLink",
        {
            "time_s": "Time (s)",
            "winding_degC": "101 <Winding> (C)",
            "ambient_degC": "102 <Air> (C)",
        },
        Layout(
            before=("Name:,Config1", "Owner:,lab", "Acquisition Date:,5/17/2024 10:00:00 AM", "")
        ),
    )
    yield foreign(
        "Graphtec", {"time_s": "Time [s]", "winding_degC": "CH1 [degC]",
                     "ambient_degC": "CH2 [degC]"},
        Layout(before=("Vendor,GRAPHTEC Corporation", "Model,GL840", "Sampling interval,2s")),
    )  # fmt: skip
    yield foreign(
        "Keysight DAQ970A", {"time_s": "Time [s]", "winding_degC": "101 (VDC) T_w [C]",
                             "ambient_degC": "T_a [C]"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "MATLAB writetable", {"time_s": "time_s", "winding_degC": "T_w_degC",
                              "losses_W": "P_v_kW"}, Layout(), {"losses_W": "kW"},
    )  # fmt: skip
    yield foreign(
        "LabVIEW write to spreadsheet", {"time_s": "Time [s]", "winding_degC": "Winding [degC]"},
        Layout(delimiter="\t", newline="\r\n"),
    )  # fmt: skip
    yield foreign(
        "INCA", {"time_s": "time [s]", "winding_degC": "TWdg\\ETKC:1 [degC]",
                 "losses_W": "PLoss\\ETKC:1 [W]"}, Layout(delimiter=";"),
    )  # fmt: skip
    yield foreign(
        "CANape", {"time_s": "t[s]", "winding_degC": "Inv.T_Wdg[°C]", "losses_W": "Inv.P_Loss[kW]"},
        Layout(delimiter=";"), {"losses_W": "kW"}, decimal_comma=True,
    )  # fmt: skip
    yield foreign(
        "kelvin and mA", {"time_s": "time [s]", "winding_degC": "TW [K]",
                          "phase_current_A": "I [mA]"}, Layout(),
        {"winding_degC": "K", "phase_current_A": "mA"},
    )  # fmt: skip
    yield foreign(
        "drive in foreign units",
        {
            "time_s": "Time [ms]",
            "speed_rpm": "Omega [rad/s]",
            "torque_Nm": "Torque [mNm]",
            "losses_W": "Loss [mW]",
        },
        Layout(),
        {"time_s": "ms", "speed_rpm": "rad/s", "torque_Nm": "mNm", "losses_W": "mW"},
        channels=SEVEN,
    )
    yield foreign(
        "names with figures and units of others",
        {"winding_degC": "T_20kW_bench [degC]", "losses_W": "P_12V_supply [W]"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "names that end in letters of units",
        {"winding_degC": "temp_K1 [degC]", "losses_W": "loss_A [W]", "phase_current_A": "I_W [A]",
         "ambient_degC": "T_C2 [degC]"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "phases U V W in the names",
        {"phase_current_A": "I_V", "losses_W": "P_U", "winding_degC": "T_W"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "slot numbers in the names",
        {"winding_degC": "T winding slot 12 (DE)", "losses_W": "P loss total (calc.)",
         "phase_current_A": "I phase mean (3 phases)"}, Layout(),
    )  # fmt: skip
    yield foreign(
        "sensor types in the names",
        {"winding_degC": "T_w (PT100)", "ambient_degC": "T_a (type K)"}, Layout(),
    )  # fmt: skip
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
