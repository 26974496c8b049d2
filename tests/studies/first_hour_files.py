"""Five files of one heat run, as five benches would hand it over.

The record is the bundled 90-min duty at 1 Hz. Nothing of heatrun writes them: pandas, openpyxl,
asammdf and scipy do.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

SOURCE = Path(__file__).parents[2] / "data" / "synthetic" / "duty_90min.csv.gz"
START = datetime.datetime(2025, 11, 20, 9, 15, 0)


def record() -> pd.DataFrame:
    """Return the heat run: t, Is, Pd, Te, Tw_m, speed_rpm; every second."""
    return pd.read_csv(SOURCE).iloc[::10].reset_index(drop=True)


def german_text(folder: Path) -> Path:
    """Write an export of a German logger: title rows, semicolons, decimal commas, clock times."""
    table = record()
    clock = [(START + datetime.timedelta(seconds=float(s))).strftime("%H:%M:%S") for s in table.t]
    columns = {
        "Uhrzeit": clock,
        "Strom Phase U [A eff]": table.Is,
        "Verlustleistung [W]": table.Pd,
        "Raumtemperatur [°C]": table.Te,
        "Wicklungstemperatur [°C]": table.Tw_m,
        "Drehzahl [1/min]": table.speed_rpm,
    }
    head = "Prüfprotokoll;Dauerlauf 7\r\nPrüfer;J. Weiß\r\nDatum;20.11.2025\r\n\r\n"
    text = pd.DataFrame(columns).to_csv(
        sep=";", decimal=",", index=False, float_format="%.3f", lineterminator="\r\n"
    )
    path = folder / "Dauerlauf_7.txt"
    path.write_bytes((head + text).encode("cp1252"))
    return path


def excel_with_titles(folder: Path) -> Path:
    """Write a workbook with merged title, a row of units and an empty first column."""
    from openpyxl import Workbook

    table = record()
    book = Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.title = "Heat run"
    sheet["B1"] = "Motor bench 3 - heat run of 20 November 2025"
    sheet.merge_cells("B1:G1")
    sheet["B2"], sheet["C2"] = "Operator", "M. Rossi"
    names = ("Elapsed time", "Motor current", "Total losses", "Lab air", "Slot thermocouple", "n")
    for column, (name, unit) in enumerate(
        zip(names, ("s", "A", "kW", "°C", "°C", "rpm"), strict=True), start=2
    ):
        sheet.cell(4, column, name)
        sheet.cell(5, column, unit)
    values = (table.t, table.Is, table.Pd / 1e3, table.Te, table.Tw_m, table.speed_rpm)
    for row, line in enumerate(zip(*values, strict=True), start=6):
        for column, value in enumerate(line, start=2):
            sheet.cell(row, column, round(float(value), 4))
    path = folder / "heat_run.xlsx"
    book.save(path)
    return path


def thesis_worksheet(folder: Path) -> Path:
    """Write the worksheet of the thesis, its columns as printed, with the whole of the test.

    Its ambient is one number: the mean in the first row of `Tw mod`.
    """
    table = record()
    resistance = 0.0062 * (234.5 + table.Tw_m) / (234.5 + 25.0)
    copper = 3.0 * table.Is**2 * resistance
    ratio = (234.5 + table.Tw_m) / (234.5 + 22.0)
    current = np.sqrt(np.maximum(table.Pd, 0.0) / ratio)
    copper_current = np.sqrt(copper / ratio)
    columns = {
        "row": np.arange(12, 12 + len(table)),
        "t [s]": table.t,
        "Tw [degC]": table.Tw_m.round(0),
        "Tw mod [degC]": [table.Te.mean()] + [np.nan] * (len(table) - 1),
        "Req DC [ohm]": ratio,
        "P [W]": table.Pd,
        "Ieq DC [A]": current,
        "Veq DC [V]": current * ratio,
        "Is [A]": table.Is,
        "Rs [ohm]": resistance,
        "Pjs [W]": copper,
        "Pol [W]": table.Pd - copper,
        "Ieq DC of Pjs [A]": copper_current,
        "Veq DC of Pjs [V]": copper_current * ratio,
    }
    path = folder / "worksheet.csv"
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")
    return path


def measurement_file(folder: Path) -> Path:
    """Write an MDF 4 of two loggers: the drive at 10 Hz, the temperatures every second."""
    import asammdf

    fast, slow = pd.read_csv(SOURCE), record()

    def signal(name: str, values: pd.Series, time: pd.Series, unit: str) -> asammdf.Signal:
        return asammdf.Signal(
            values.to_numpy(dtype=float), time.to_numpy(dtype=float), name=name, unit=unit
        )

    file = asammdf.MDF(version="4.10")
    file.start_time = START
    file.append(
        [signal("I_phase_rms", fast.Is, fast.t, "A"), signal("P_loss", fast.Pd, fast.t, "W"),
         signal("n_mot", fast.speed_rpm, fast.t, "1/min")],
        acq_name="Drive",
    )  # fmt: skip
    file.append(
        [signal("T_winding", slow.Tw_m, slow.t, "degC"), signal("T_amb", slow.Te, slow.t, "degC")],
        acq_name="Rig",
    )
    path = folder / "bench.mf4"
    file.save(path, overwrite=True)
    file.close()
    return path


def matlab_file(folder: Path) -> Path:
    """Write a MAT file of named vectors, as somebody saves a workspace."""
    from scipy.io import savemat

    table = record()
    columns = {
        "time": table.t, "I_rms": table.Is, "P_tot": table.Pd, "T_env": table.Te,
        "T_wdg": table.Tw_m, "speed": table.speed_rpm,
    }  # fmt: skip
    path = folder / "workspace.mat"
    savemat(path, {name: values.to_numpy(dtype=float)[:, None] for name, values in columns.items()})
    return path


FILES: dict[str, Callable[[Path], Path]] = {
    "German text export": german_text,
    "Excel with title rows": excel_with_titles,
    "worksheet of the thesis": thesis_worksheet,
    "MDF 4, two rates": measurement_file,
    "MATLAB workspace": matlab_file,
}
"""Kind of file to what writes it into a folder."""
