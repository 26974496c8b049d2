"""The populations of all types of a fleet, each in a folder of its own: `heatrun population`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.free_names import numbered
from heatrun.results import to_plain
from heatrun.runs.places import refuse_unwritable

from ..results.population import PopulationResult
from .files import is_same, write_population
from .job import pooled
from .of_fleet import FleetRows, gathered_of_fleet

LONGEST_SLUG = 80


@dataclass(frozen=True)
class Written:
    """The population of a type, or why there is none.

    Attributes:
        type: Of the machines.
        result: The population.
        files: Where it stands.
        refusal: In its place.
    """

    type: str
    result: PopulationResult | None = None
    files: tuple[Path, ...] = ()
    refusal: InputError | None = None

    def described(self) -> dict[str, Any]:
        """Return what `heatrun population --json` prints of it."""
        if self.result is not None:
            return {**to_plain(self.result), "files": [str(path) for path in self.files]}
        assert self.refusal is not None
        error = self.refusal
        said = {"problem": error.problem, "where": error.where, "remedy": error.remedy}
        return {"type": self.type, "error": said}


def populations_of_fleet(
    fleet: FleetRows,
    out: Path | None,
    *,
    covariates: Sequence[str] = (),
    seed: int = 0,
    is_replacing: bool = False,
) -> list[Written]:
    """Work out and write the population of each type; one that cannot be does not stop the others.

    Args:
        fleet: The rows.
        out: Folder, in which each type has one of its own if there are several; None for
            `results/populations`, where nothing is replaced.
        covariates: Names of columns of the fleet file.
        seed: Random seed.
        is_replacing: Whether other populations in `out` are replaced.

    Raises:
        InputError: If the fleet has one type, and that has no population.
    """
    types = list(fleet.types)
    places = _folders(types, fleet.name, out)
    written = []
    for type, place in zip(types, places, strict=True):
        try:
            written.append(
                population_of_type(
                    fleet, type, place, covariates=covariates, seed=seed,
                    is_named=out is not None, is_replacing=is_replacing,
                )
            )  # fmt: skip
        except InputError as refusal:
            if len(types) == 1:
                raise
            written.append(Written(type, refusal=refusal))
    return written


def population_of_type(
    fleet: FleetRows,
    type: str,
    out: Path | None,
    *,
    covariates: Sequence[str] = (),
    seed: int = 0,
    is_named: bool = True,
    is_replacing: bool = False,
) -> Written:
    """Work out and write the population of one type.

    Args:
        fleet: The rows.
        type: One of `fleet.types`.
        out: Its folder; None for one of its name below `results/populations`.
        covariates: Names of columns of the fleet file.
        seed: Random seed.
        is_named: Whether `out` is where the user wants it; else it gets a number where another
            population stands there.
        is_replacing: Whether another population there is replaced.

    Raises:
        InputError: As `heatrun.population`.
    """
    is_named = is_named and out is not None
    place = default_folder(type or fleet.name) if out is None else out
    refuse_unwritable(place)
    result = pooled(
        gathered_of_fleet(fleet, type), covariates, str(fleet.path), type_name=type, seed=seed
    )
    files = _written(place, result, is_named=is_named, is_replacing=is_replacing)
    return Written(type, result, files)


def written_to(
    out: Path | None, name: str, result: PopulationResult, *, is_replacing: bool
) -> tuple[Path, ...]:
    """Write a population and return its files.

    Args:
        out: Its folder; None for one below `results/populations`, where nothing is replaced.
        name: Of that folder.
        result: The population.
        is_replacing: Whether another population there is replaced.
    """
    place = default_folder(name) if out is None else out
    refuse_unwritable(place)
    return _written(place, result, is_named=out is not None, is_replacing=is_replacing)


def _written(
    place: Path, result: PopulationResult, *, is_named: bool, is_replacing: bool
) -> tuple[Path, ...]:
    if not is_named and not is_replacing:
        place = next(each for each in numbered(place) if is_same(each, result))
    return tuple(write_population(place, result, is_replacing=is_replacing))


def default_folder(name: str) -> Path:
    """Return where a population goes if no folder is given: named after its type."""
    return Path("results") / "populations" / slug(name)


def _folders(types: Sequence[str], fleet: str, out: Path | None) -> list[Path]:
    """Return the folder of each type; two types never share one."""
    if len(types) == 1:
        return [default_folder(types[0] or fleet) if out is None else out]
    base = default_folder("").parent if out is None else out
    found: list[Path] = []
    for type in types:
        wanted = base / slug(type or "no-type")
        found.append(next(place for place in numbered(wanted) if place not in found))
    return found


def slug(name: str) -> str:
    """Return a name as that of a folder: letters, digits and dashes."""
    text = "".join(c if c.isalnum() and c.isascii() else "-" for c in name.lower())
    while "--" in text:
        text = text.replace("--", "-")
    return text.strip("-")[:LONGEST_SLUG] or "type"
