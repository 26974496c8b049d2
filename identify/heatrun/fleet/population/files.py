"""The folder of a population: what it leaves for data sheets, queries and the next machine."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...io.file_set import together
from ...io.free_names import is_other, refuse_replacing
from ...io.whole_files import write_whole
from ...motor import HEAT_LIMITS, ParameterOverride
from ...results import to_json
from ...results.population import PopulationResult

NAME, TABLE, SHEET = "population.json", "population.parquet", "type_sheet.pdf"


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
    from ...reports.type_sheet.document import write_type_sheet  # slow to import

    write_type_sheet(result, path)


HEAT = "unmodelled_heat"
"""Name of the heat that a network misses, among the parameters of the noise."""


@dataclass(frozen=True)
class NextMachine:
    """What a population says of its next machine before its first test.

    Attributes:
        parameters: Prior of each thermal parameter.
        effects: Ids of the effects that its machines were calibrated with.
        unmodelled_heat: Median of the prior of the heat that the network misses, sd over the mean
            loss [1]; None where the machines do not tell it.
    """

    parameters: dict[str, ParameterOverride]
    effects: tuple[str, ...] = ()
    unmodelled_heat: float | None = None


def read_next_machine(folder: Path, where: str) -> NextMachine:
    """Return what a population says of its next machine before its first test.

    Args:
        folder: Of the population, or its file.
        where: What asked for it, for messages.

    Raises:
        InputError: If there is no such file, or it is not one that heatrun wrote.
    """
    path = folder / NAME if folder.is_dir() else folder
    remedy = "Give the folder that `heatrun population` wrote."
    try:
        content = json.loads(path.read_bytes())
        found = {name: _prior(said) for name, said in content["parameters"].items()}
        heat = _heat(content.get("noise") or {})
    except OSError as error:
        types = sorted(each.parent.name for each in folder.glob(f"*/{NAME}"))
        raise InputError(
            f"Expected a population, found no readable {path} ({error.strerror}).",
            where=where,
            remedy=f"Name one of the types in it: {', '.join(types)[:200]}." if types else remedy,
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
        raise InputError(
            f"Expected a population as heatrun writes it, got another content in {path}.",
            where=where,
            remedy=remedy,
        ) from None
    sound = [_is_sound(each) for each in found.values()]
    if not found or not all(sound) or not (heat is None or 0.0 < heat < math.inf):
        raise InputError(
            f"Expected positive medians and widths of the parameters in {path}.",
            where=where,
            remedy=remedy,
        )
    effects = dict.fromkeys(name.partition(".")[0] for name in found if "." in name)
    return NextMachine(found, tuple(effects), _within_limits(heat))


def _heat(noise: dict[str, Any]) -> float | None:
    said = noise.get("parameters", {}).get(HEAT)
    return None if said is None else float(said["next_median"])


def _within_limits(heat: float | None) -> float | None:
    """Return the heat as far as a motor file may say it: the tail of a law may reach beyond."""
    low, high = HEAT_LIMITS
    return None if heat is None else min(max(heat, low), high)


def _prior(said: dict[str, Any]) -> ParameterOverride:
    centre = float(said["next_median"])
    if said.get("transform", "log") == "linear":
        return ParameterOverride(value=centre, sd=float(said["next_sd"]))
    return ParameterOverride(value=centre, relative_sd=math.expm1(float(said["next_log_sd"])))


def _is_sound(prior: ParameterOverride) -> bool:
    width = prior.sd if prior.relative_sd is None else prior.relative_sd
    assert prior.value is not None
    assert width is not None
    is_positive = prior.relative_sd is None or prior.value > 0.0
    return math.isfinite(prior.value) and is_positive and math.isfinite(width) and width > 0.0
