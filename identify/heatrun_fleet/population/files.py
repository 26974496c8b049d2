"""The folder of a population: what it leaves for data sheets, queries and the next machine."""

from __future__ import annotations

from pathlib import Path

from heatrun.io.file_set import together
from heatrun.io.whole_files import is_other, refuse_replacing, write_whole
from heatrun.motor.file import NAME
from heatrun.results import to_json

from ..results.population import PopulationResult

TABLE, SHEET = "population.parquet", "type_sheet.pdf"


def write_population(folder: Path, result: PopulationResult, *, is_replacing: bool) -> list[Path]:
    """Write the files of a population; all of them appear, or none.

    Args:
        folder: Where they go; made if it is not there.
        result: The population.
        is_replacing: Whether another population there is replaced.

    Returns:
        The files: the table is not among them where pyarrow is not installed.

    Raises:
        InputError: If another population stands there and is not to be replaced.
    """
    text = (to_json(result) + "\n").encode()
    if is_other(folder / NAME, text) and not is_replacing:
        refuse_replacing(folder, "another population, or this one with other inputs")
    folder.mkdir(parents=True, exist_ok=True)
    names = [NAME, SHEET]
    with together(folder, "population") as files:
        write_whole(files.aside / NAME, text)
        if _has_parquet():
            _write_table(files.aside / TABLE, result)
            names.insert(1, TABLE)
        _write_sheet(files.aside / SHEET, result)
    if TABLE not in names:
        (folder / TABLE).unlink(missing_ok=True)  # of the population that was replaced
    return [folder / name for name in names]


def is_same(folder: Path, result: PopulationResult) -> bool:
    """Return whether a folder holds just this population, or nothing yet."""
    return not folder.exists() or (
        (folder / NAME).is_file() and not is_other(folder / NAME, (to_json(result) + "\n").encode())
    )


def _has_parquet() -> bool:
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        return False
    return True


def _write_table(path: Path, result: PopulationResult) -> None:
    from pyarrow.parquet import write_table

    from .table import table_of

    write_table(table_of(result), path, compression="zstd", write_page_checksum=True)


def _write_sheet(path: Path, result: PopulationResult) -> None:
    from .sheet import write_type_sheet  # slow to import

    write_type_sheet(result, path)
