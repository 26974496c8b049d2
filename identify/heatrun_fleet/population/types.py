"""`heatrun population`: the populations of a fleet's types, each in a folder and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.quantities import clean, printed_unit, rounded
from heatrun.io.whole_files import folder_name, numbered
from heatrun.reports.printed import signed
from heatrun.results import to_plain
from heatrun.results.discovery import ValueWithInterval
from heatrun.runs.run_folder import refuse_unwritable

from ..results import PopulationNoise, PopulationParameter, PopulationResult
from .job import is_same, pooled, write_population
from .of_fleet import FleetRows, gathered_of_fleet


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
    return folder_name(name) or "type"


MOST_NAMED = 10
"""Machines that are named with their reason on the terminal; all stand in the files."""

PARQUET_HINT = 'population.parquet needs pyarrow: pip install "heatrun[fleet]"'


def population_text(written: Written) -> str:
    """Return a population as plain text for the terminal.

    Args:
        written: The population, or why there is none.
    """
    if written.result is None:
        return f"{_named(written.type)}: no population. {written.refusal}"
    return "\n".join([*_lines(written.result), "", *_files(written.files)])


def _lines(result: PopulationResult) -> list[str]:
    out = f", {len(result.left_out)} left out" if result.left_out else ""
    lines = [f"{_named(result.type)}: {result.num_machines} machines{out}."]
    lines += [f"  left out {clean(each.name)}: {each.reason}"
              for each in result.left_out[:MOST_NAMED]]  # fmt: skip
    if len(result.left_out) > MOST_NAMED:
        lines.append(f"  and {len(result.left_out) - MOST_NAMED} more, all in the files.")
    lines += [f"  note: {note}" for note in result.notes]
    lines += _table(result.parameters)
    for label, covariate in result.covariate_columns.items():
        effects = ", ".join(
            f"{name} {change(each, name, result)}" for name, each in covariate.over_range.items()
        )
        over = f" from {covariate.first} to {covariate.last}" if covariate.first else ""
        against = f" against {covariate.reference}" if covariate.reference else ""
        lines.append(f"  {label}{against}{over}: {effects}")
    outliers = [machine for machine in result.machines if machine.is_outlier]
    for machine in outliers[:MOST_NAMED]:
        what = ", ".join(machine.different) or "no single parameter"
        lines.append(
            f"  does not fit: {clean(machine.name)} (probability "
            f"{machine.outlier_probability:.2f}; different: {what})"
        )
    if len(outliers) > MOST_NAMED:
        lines.append(f"  and {len(outliers) - MOST_NAMED} more that do not fit.")
    return lines + (_noise_lines(result.noise) if result.noise else [])


def _noise_lines(noise: PopulationNoise) -> list[str]:
    """Return noise and unmodelled heat over the machines."""
    lines = ["  noise, and heat that the network misses:", *_table(noise.parameters)]
    outliers = [machine for machine in noise.machines if machine.is_outlier]
    for machine in outliers[:MOST_NAMED]:
        what = ", ".join(machine.different) or "no single one"
        lines.append(
            f"  another noise: {clean(machine.name)} (probability "
            f"{machine.outlier_probability:.2f}; different: {what})"
        )
    if len(outliers) > MOST_NAMED:
        lines.append(f"  and {len(outliers) - MOST_NAMED} more with another noise.")
    return lines


def _table(parameters: Mapping[str, PopulationParameter]) -> list[str]:
    heads = ("median (95 %)", "spread (95 %)", "95 % of the machines (at 95 %)")
    rows = [("", *heads), *(_row(name, said) for name, said in parameters.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return [
        "  "
        + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _row(name: str, said: PopulationParameter) -> tuple[str, str, str, str]:
    unit = printed_unit(said.unit)
    low, high = said.tolerance_95_95
    return (
        name,
        f"{_ranged(said.median)} {unit}".rstrip(),
        spread(said.spread, said.transform, said.unit),
        f"{rounded(low, 4)} … {rounded(high, 4)} {unit}".rstrip()
        if said.tells((low, high))
        else "not determined",
    )


def spread(entry: ValueWithInterval, transform: str, unit: str) -> str:
    """Return a spread over machines as it is printed."""
    if transform == "linear":
        return f"{_ranged(entry, 3)} {printed_unit(unit)}".rstrip()
    low, high = entry.interval_95
    return f"{100 * entry.value:.1f} ({100 * low:.1f} … {100 * high:.1f}) %"


def change(entry: ValueWithInterval, name: str, result: PopulationResult) -> str:
    """Return what a covariate does to a parameter as it is printed."""
    parameter = result.parameters[name]
    if parameter.transform == "linear":
        return f"{_ranged(entry, 3)} {printed_unit(parameter.unit)}".rstrip()
    low, high = entry.interval_95
    said, low, high = (signed(100 * each, 1) for each in (entry.value, low, high))
    return f"{said} ({low} … {high}) %"


def _ranged(entry: ValueWithInterval, digits: int = 4) -> str:
    low, high = (rounded(end, digits) for end in entry.interval_95)
    return f"{rounded(entry.value, digits)} ({low} … {high})"


def _files(files: tuple[Path, ...]) -> list[str]:
    lines = [f"Folder: {files[0].parent}", *(f"  {path.name}" for path in files)]
    has_table = any(path.suffix == ".parquet" for path in files)
    return lines if has_table else [*lines, f"  {PARQUET_HINT}"]


def _named(type: str) -> str:
    return f"Type {clean(type)}" if type else "Machines without a type"
