"""From the calibrations of the machines of a type to their population: `heatrun.population`.

Its folder holds what data sheets, queries and the next machine need.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd

from heatrun.errors import InputError
from heatrun.io.whole_files import (
    folder_name,
    is_other,
    numbered,
    refuse_replacing,
    together,
    write_whole,
)
from heatrun.motor.population import NAME
from heatrun.results import to_json, to_plain
from heatrun.runs.run import Run, open_run
from heatrun.runs.run_folder import refuse_unwritable

from ..job import FleetResult
from ..results import PopulationParameter, PopulationResult
from .gathered import FEWEST, Gathered, designed, given_columns
from .of_fleet import FleetRows, gathered_of_fleet, gathered_of_runs, is_fleet, read_fleet
from .report import NOISE_SPREAD, default_hyperprior, population_result
from .sampling import sample_population

Covariates = Mapping[str, Sequence[Any]] | Sequence[str]


@dataclass(frozen=True)
class TypeOfMachine:
    """What is known of a type of machine."""

    result: PopulationResult  # What stands in `population.json`.

    @property
    def content(self) -> dict[str, Any]:
        """The same as plain lists and mappings."""
        return to_plain(self.result)

    def summary(self) -> pd.DataFrame:
        """Return a row for each parameter: median, spread over machines, and the limits between
        which 95 % of the machines lie, at 95 % confidence; in their units, spreads as shares.
        """
        return _summary(self.result.parameters)

    def noise(self) -> pd.DataFrame:
        """Return the same for noise and unmodelled heat; no rows where they are not known."""
        return _summary(self.result.noise.parameters if self.result.noise else {})

    def machines(self) -> pd.DataFrame:
        """Return a row for each machine: probability that it does not belong to the type, what is
        different about it, its parameters given all machines [their units], and the probability
        that its noise is not that of the type (NaN where its noise does not count).
        """
        of_noise = self.result.noise.machines if self.result.noise else []
        odd_noise = {said.name: said.outlier_probability for said in of_noise}
        rows = [
            {
                "machine": said.name,
                "outlier_probability": said.outlier_probability,
                "different": ", ".join(said.different),
                **{name: entry.value for name, entry in said.parameters.items()},
                "noise_outlier_probability": odd_noise.get(said.name, math.nan),
            }
            for said in self.result.machines
        ]
        return pd.DataFrame(rows)

    def left_out(self) -> pd.DataFrame:
        """Return a row for each machine that does not count, with the reason."""
        rows = [(each.name, each.reason) for each in self.result.left_out]
        return pd.DataFrame(rows, columns=["machine", "reason"])

    def _repr_html_(self) -> str:
        return self.summary().to_html(index=False)


def _summary(parameters: Mapping[str, PopulationParameter]) -> pd.DataFrame:
    rows = [
        {
            "parameter": name,
            "median": said.median.value,
            "low_95": said.median.interval_95[0],
            "high_95": said.median.interval_95[1],
            "spread": said.spread.value,
            "spread_low_95": said.spread.interval_95[0],
            "spread_high_95": said.spread.interval_95[1],
            "tolerance_low": said.tolerance_95_95[0],
            "tolerance_high": said.tolerance_95_95[1],
            "unit": said.unit,
        }
        for name, said in parameters.items()
    ]
    return pd.DataFrame(rows)


def population(
    source: FleetResult | str | Path | Sequence[Run | str | Path],
    *,
    type: str | None = None,
    covariates: Covariates = (),
    network: str | None = None,
    type_name: str = "",
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
) -> TypeOfMachine:
    """Say what machines of a type have in common, how they differ, and which do not fit.

    Each machine counts with the posterior of its calibration, with the prior divided out, so that a
    short test borrows from the others and never outweighs them.

    Args:
        source: A fleet: its folder, its `machines.parquet`, or what `heatrun.calibrate_fleet`
            returns. Or a run for each machine, as folders or opened.
        type: Of a fleet with several types, the one that is meant.
        covariates: What may shift the parameters: of a fleet, names of columns of the fleet file;
            of runs, a value for each machine by name. Numbers count as they are, dates (ISO 8601)
            in years, other texts as categories, such as the supplier.
        network: Name of the network, where runs have several.
        type_name: Of the machines, for the record; by default the fleet's.
        seed: Random seed.
        out: Folder for `population.json`, `population.parquet` and `type_sheet.pdf`, which
            `[population] run` of a motor file takes; made if it is not there. None writes nothing.
        force: Whether another population in `out` is replaced.

    Raises:
        InputError: If the source cannot be read, has several types and none is chosen, has fewer
            than three machines that can count, runs were fitted with different networks, or a
            covariate is not there or has not a value for each run.

    Example:
        >>> known = heatrun.population("results/fleets/line-3", covariates=["supplier"])
        ... # doctest: +SKIP
        >>> known.summary()  # doctest: +SKIP
    """
    if is_fleet(source):
        fleet = read_fleet(source)  # type: ignore[arg-type]
        if isinstance(covariates, Mapping):
            raise InputError(
                "Expected names of columns of the fleet file as covariates, got values.",
                remedy='Write covariates=["supplier"].',
            )
        chosen = _only_type(fleet) if type is None else type
        names = [covariates] if isinstance(covariates, str) else list(covariates)
        result = pooled(
            gathered_of_fleet(fleet, chosen), names, str(fleet.path), type_name=type_name or chosen,
            seed=seed,
        )  # fmt: skip
    elif type is not None:
        raise InputError(
            "Runs have no types to choose from.", remedy="Leave type out, or write type_name."
        )
    else:
        result = _of_runs(source, covariates, network, type_name=type_name, seed=seed)
    if out is not None:
        write_population(Path(out), result, is_replacing=force)
    return TypeOfMachine(result)


def pooled(
    gathered: Gathered, covariates: Sequence[str], where: str, *, type_name: str, seed: int
) -> PopulationResult:
    """Return the population of machines with the covariates from some columns.

    Raises:
        InputError: If fewer than three machines are left, or a covariate is not there.
    """
    machines = designed(gathered, covariates, where)
    found = sample_population(
        machines.evidence(), default_hyperprior(machines), machines.matrix(), seed=seed
    )
    noise, of_noise = machines.noise, None
    if noise is not None and len(noise.machines) >= FEWEST + len(machines.covariates):
        used = [machines.machines.index(name) for name in noise.machines]
        law = default_hyperprior(noise, NOISE_SPREAD)
        of_noise = sample_population(noise.evidence(), law, machines.matrix(used), seed=seed)
    return population_result(machines, found, of_noise, type_name=type_name, seed=seed)


def _of_runs(
    source: Any, covariates: Covariates, network: str | None, *, type_name: str, seed: int
) -> PopulationResult:
    if isinstance(source, str | Path):
        raise InputError(
            "Expected the folder of a fleet, or the runs of several machines, got one path that is "
            "no fleet.",
            where=str(source),
            remedy="Give the folder that `heatrun fleet` wrote, or a list of run folders.",
        )
    if any(is_fleet(each) for each in source):
        raise InputError(
            "Expected one fleet alone, or runs alone, got a fleet among several.",
            where=", ".join(map(str, source))[:200],
            remedy="Put all machines into one fleet file.",
        )
    if covariates and not isinstance(covariates, Mapping):
        raise InputError(
            "Expected a value for each run of a covariate, got names alone.",
            remedy='Write covariates={"supplier": ["north", "south", …]}.',
        )
    opened = [run if isinstance(run, Run) else open_run(run) for run in source]
    given = covariates if isinstance(covariates, Mapping) else {}
    gathered = given_columns(gathered_of_runs(opened, network), given)
    return pooled(gathered, list(given), "", type_name=type_name, seed=seed)


def _only_type(fleet: FleetRows) -> str:
    if len(fleet.types) == 1:
        return next(iter(fleet.types))
    named = ", ".join(f"{name!r} ({num} machines)" for name, num in fleet.types.items())
    raise InputError(
        f"Expected one type of machine, found {len(fleet.types)}: {named}.",
        where=str(fleet.path),
        remedy="Choose one with type=…; `heatrun population` works out all of them.",
    )


TABLE, SHEET = "population.parquet", "type_sheet.pdf"


@dataclass(frozen=True)
class Written:
    """The population of a type and where it stands, or the refusal in its place."""

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
    fleet: FleetRows, types: Sequence[str], out: Path | None, covariates: Sequence[str] = (), *,
    seed: int = 0, is_replacing: bool = False,
) -> list[Written]:  # fmt: skip
    """Work out and write the population of each type; one that cannot be does not stop the others.

    Args:
        fleet: The rows.
        types: Some of `fleet.types`.
        out: Folder, in which each type has one of its own if there are several; None for
            `results/populations`, where nothing is replaced.
        covariates: Names of columns of the fleet file.
        seed: Random seed.
        is_replacing: Whether other populations in `out` are replaced.

    Raises:
        InputError: If it is one type, and that has no population.
    """
    base = default_folder("").parent if out is None else out
    written: list[Written] = []
    places: list[Path] = []
    for type in types:
        if len(types) > 1:
            wanted = numbered(base / _slug(type or "no-type"))
            place = next(each for each in wanted if each not in places)  # two never share one
        else:
            place = default_folder(type or fleet.name) if out is None else out
        places.append(place)
        try:
            refuse_unwritable(place)
            result = pooled(
                gathered_of_fleet(fleet, type), covariates, str(fleet.path), type_name=type,
                seed=seed,
            )  # fmt: skip
            files = write_population(
                place, result, is_named=out is not None, is_replacing=is_replacing
            )
            written.append(Written(type, result, files))
        except InputError as refusal:
            if len(types) == 1:
                raise
            written.append(Written(type, refusal=refusal))
    return written


def default_folder(name: str) -> Path:
    """Return where a population goes if no folder is given: named after its type."""
    return Path("results") / "populations" / _slug(name)


def _slug(name: str) -> str:
    return folder_name(name) or "type"


def write_population(
    folder: Path, result: PopulationResult, *, is_replacing: bool, is_named: bool = True
) -> tuple[Path, ...]:
    """Write the files of a population; all of them appear, or none.

    Args:
        folder: Where they go; made if it is not there.
        result: The population.
        is_replacing: Whether another population there is replaced.
        is_named: Whether the folder is where the user wants it; else it gets a number where
            another population stands there.

    Returns:
        The files: the table is not among them where pyarrow is not installed.

    Raises:
        InputError: If another population stands there and is not to be replaced.
    """
    text = (to_json(result) + "\n").encode()

    def is_same(place: Path) -> bool:
        return (place / NAME).is_file() and not is_other(place / NAME, text)

    if not is_named and not is_replacing:
        folder = next(each for each in numbered(folder) if not each.exists() or is_same(each))
    if is_other(folder / NAME, text) and not is_replacing:
        refuse_replacing(folder, "another population, or this one with other inputs")
    folder.mkdir(parents=True, exist_ok=True)
    names = [NAME, *([TABLE] if find_spec("pyarrow") else []), SHEET]
    with together(folder, "population") as files:
        write_whole(files.aside / NAME, text)
        if TABLE in names:
            from pyarrow.parquet import write_table

            from .table import table_of

            write_table(table_of(result), files.aside / TABLE, compression="zstd",
                        write_page_checksum=True)  # fmt: skip
        from .sheet import write_type_sheet  # slow to import

        write_type_sheet(result, files.aside / SHEET)
    if TABLE not in names:
        (folder / TABLE).unlink(missing_ok=True)  # of the population that was replaced
    return tuple(folder / name for name in names)
