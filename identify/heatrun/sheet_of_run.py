"""From a calibration, or a run folder, to the parameter sheet and its figures."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .calibrate import Calibration
from .errors import InputError
from .folder_lock import FolderLock
from .run_folder import dump, list_again, load_result, read_listed
from .sheet.bands import band_table
from .sheet.content import sheet_content
from .sheet.figures import draw
from .sheet.pdf import write_pdf
from .sheet.xlsx import write_xlsx
from .whole_files import drop_partials, write_whole

Tables = Sequence[tuple[str, str, pd.DataFrame]]


def write_sheet_of(found: Calibration, folder: Path) -> list[Path]:
    """Write courses, figures and sheet of a calibration into a folder."""
    tables = [
        (
            test.record.name,
            test.role,
            band_table({order: rows[index] for order, rows in found.predictions.items()}),
        )
        for index, test in enumerate(found.tests)
    ]
    for number, (_, _, table) in enumerate(tables, start=1):
        text = table.to_csv(index=False, float_format="%.6g")
        write_whole(folder / f"course_{number}.csv", text.encode())
    order = "second" if "second" in found.posteriors else "first"
    posterior = found.posteriors[order]
    draws = {
        slot.name: posterior.values()[slot.name].ravel()
        for slot in posterior.fit.slots
        if slot.parameter.role in ("network", "resistance")
    }
    return _write(found.result, tables, draws, folder)


def rewrite_sheet(run: Path, folder: Path) -> list[Path]:
    """Write the sheet of a run again from its files.

    Args:
        run: The run folder.
        folder: Where the sheet and the figures go.

    Raises:
        InputError: If the folder is no run, or misses one of its files.
    """
    from . import archive

    result = load_result(run)
    is_same = folder.resolve() == run.resolve()
    lock = FolderLock.take(run) if is_same else None
    try:
        order = "second" if "second" in result["models"] else "first"
        tables = [
            (test["name"], test["role"], _course(run, number))
            for number, test in enumerate(result["tests"], start=1)
        ]
        read_listed(run, f"posterior_{order}.nc")
        group = archive.read(run / f"posterior_{order}.nc")["posterior"]
        free = [n for n, e in result["models"][order]["parameters"].items() if not e["fixed"]]
        draws = {name: np.asarray(group[name]).ravel() for name in free}
    except InputError:
        raise
    except Exception as error:  # what is no run of ours fails in nearly any way
        raise InputError(
            f"a file of the run cannot be read ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again.",
        ) from error
    folder.mkdir(parents=True, exist_ok=True)
    try:
        written = _write(result, tables, draws, folder)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"the run does not hold what a sheet needs ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again with this version.",
        ) from error
    if lock is not None:
        drop_partials(run)
        list_again(run)
        lock.release()
    return written


def _course(run: Path, number: int) -> pd.DataFrame:
    return pd.read_csv(io.BytesIO(read_listed(run, f"course_{number}.csv")))


def _write(
    result: Mapping[str, Any], tables: Tables, draws: Mapping[str, np.ndarray], folder: Path
) -> list[Path]:
    units = {
        name: entry["unit"]
        for model in result["models"].values()
        for name, entry in model["parameters"].items()
    }
    figures = draw(tables, draws, units, folder / "figures")
    write_whole(folder / "sheet.json", (dump(sheet_content(result)) + "\n").encode())
    return [
        write_pdf(result, figures, folder / "sheet.pdf"),
        write_xlsx(result, tables, folder / "sheet.xlsx"),
        folder / "sheet.json",
        *figures,
    ]
