"""From a calibration, or a run folder, to the parameter sheet and its figures."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...calibration import Calibration
from ...errors import InputError
from ...io.file_set import together
from ...io.whole_files import writable, write_whole
from ...runs.run_folder import MANIFEST, dump, listed_anew, load_result, read_listed
from .bands import band_table
from .content import sheet_content
from .figures import draw
from .pdf import write_pdf
from .xlsx import write_xlsx


def write_sheet_of(found: Calibration, folder: Path) -> list[Path]:
    """Write courses, figures and sheet of a calibration into its folder.

    Sheet and figures are made of the files of the run and of nothing else, so that `heatrun sheet`
    makes the same bytes of them at any later time.

    Args:
        found: The calibration.
        folder: With `fit.json` and the draws of the run in it.
    """
    for index, _ in enumerate(found.tests):
        table = band_table({order: rows[index] for order, rows in found.predictions.items()})
        text = table.to_csv(index=False)  # to all digits
        write_whole(folder / _course_name(index + 1), text.encode())
    return _write(_read(folder, lambda name: (folder / name).read_bytes()), folder)


def rewrite_sheet(run: Path, folder: Path) -> list[Path]:
    """Write the sheet of a run again from its files.

    Args:
        run: The run folder.
        folder: Where the sheet and the figures go: all of them, or none.

    Raises:
        InputError: If the folder is no run, or misses one of its files.
    """
    load_result(run)
    try:
        content = _read(run, lambda name: read_listed(run, name))
    except InputError:
        raise
    except Exception as error:  # what is no run of ours fails in nearly any way
        raise InputError(
            f"a file of the run cannot be read ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again.",
        ) from error
    try:
        with writable("the sheet", folder), together(folder, "sheet") as files:
            written = _write(content, files.aside)
            if folder.resolve() == run.resolve():
                # what stands in the run and in its manifest changes together
                write_whole(files.aside / MANIFEST, listed_anew(run, files.aside))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"the run does not hold what a sheet needs ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again with this version.",
        ) from error
    return [folder / path.relative_to(files.aside) for path in written]


@dataclass(frozen=True)
class _Content:
    """What a sheet is made of: `fit.json`, courses by test, draws by parameter."""

    result: Mapping[str, Any]
    tables: Sequence[tuple[str, str, pd.DataFrame]]
    draws: Mapping[str, np.ndarray]


def _read(run: Path, read: Callable[[str], bytes]) -> _Content:
    """Return what a sheet is made of from the files of a run, each by its name."""
    from ...runs import netcdf as archive

    result = json.loads(read("fit.json"))
    order = "second" if "second" in result["models"] else "first"
    tables = [
        (test["name"], test["role"], _course(read(_course_name(number))))
        for number, test in enumerate(result["tests"], start=1)
    ]
    name = f"posterior_{order}.nc"
    read(name)
    group = archive.read(run / name)["posterior"]
    free = [n for n, e in result["models"][order]["parameters"].items() if not e["fixed"]]
    return _Content(result, tables, {name: np.asarray(group[name]).ravel() for name in free})


def _course_name(number: int) -> str:
    return f"course_{number}.csv"


def _course(content: bytes) -> pd.DataFrame:
    # as words first: read as numbers, some versions of pandas lose the last digit
    words = pd.read_csv(io.BytesIO(content), dtype=str, keep_default_na=False)
    return words.replace("", "nan").astype(float)


def _write(content: _Content, folder: Path) -> list[Path]:
    result = content.result
    units = {
        name: entry["unit"]
        for model in result["models"].values()
        for name, entry in model["parameters"].items()
    }
    figures = draw(content.tables, content.draws, units, folder / "figures")
    write_whole(folder / "sheet.json", (dump(sheet_content(result)) + "\n").encode())
    return [
        write_pdf(result, figures, folder / "sheet.pdf"),
        write_xlsx(result, content.tables, folder / "sheet.xlsx"),
        folder / "sheet.json",
        *figures,
    ]
