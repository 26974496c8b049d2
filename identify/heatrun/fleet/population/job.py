"""From the runs of the machines of a type to their population: `heatrun.population`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...errors import InputError
from ...runs.run import Run, open_run
from .files import NAME, write_population
from .of_runs import evidence_of_runs
from .report import content, default_hyperprior
from .sampling import sample_population


@dataclass(frozen=True)
class TypeOfMachine:
    """What is known of a type of machine.

    Attributes:
        content: What stands in `population.json`.
    """

    content: Mapping[str, Any]

    def summary(self) -> pd.DataFrame:
        """Return a row for each parameter: median, spread over machines, and the limits between
        which 95 % of the machines lie, at 95 % confidence; in their units, spreads as shares.
        """
        rows = [
            {
                "parameter": name,
                "median": said["median"]["value"],
                "low_95": said["median"]["interval_95"][0],
                "high_95": said["median"]["interval_95"][1],
                "spread": said["spread"]["value"],
                "spread_low_95": said["spread"]["interval_95"][0],
                "spread_high_95": said["spread"]["interval_95"][1],
                "tolerance_low": said["tolerance_95_95"][0],
                "tolerance_high": said["tolerance_95_95"][1],
            }
            for name, said in self.content["parameters"].items()
        ]
        return pd.DataFrame(rows)

    def machines(self) -> pd.DataFrame:
        """Return a row for each machine: probability that it does not belong to the type, what is
        different about it, and its parameters given all machines [their units].
        """
        rows = [
            {
                "machine": said["name"],
                "outlier_probability": said["outlier_probability"],
                "different": ", ".join(said["different"]),
                **{name: entry["value"] for name, entry in said["parameters"].items()},
            }
            for said in self.content["machines"]
        ]
        return pd.DataFrame(rows)

    def _repr_html_(self) -> str:
        return self.summary().to_html(index=False)


def population(
    runs: Sequence[Run | str | Path],
    *,
    network: str | None = None,
    covariates: Mapping[str, Sequence[float]] | None = None,
    type_name: str = "",
    seed: int = 0,
    out: str | Path | None = None,
) -> TypeOfMachine:
    """Say what machines of a type have in common, how they differ, and which do not fit.

    Each machine counts with the posterior of its calibration, with the prior divided out, so that a
    short test borrows from the others and never outweighs them.

    Args:
        runs: One calibration for each machine, as run folders or opened.
        network: Name of the network, where the runs have several.
        covariates: What may shift the parameters, by name, a number for each machine: the supplier
            as 0 and 1, the date in years.
        type_name: Of the machines, for the record.
        seed: Random seed.
        out: Folder for `population.json`, which `[population] run` of a motor file takes; made if
            it is not there. None writes nothing.

    Raises:
        InputError: If a run cannot be read, was fitted with another network than the first, or a
            covariate has not one finite number for each machine.

    Example:
        >>> known = heatrun.population(["runs/a", "runs/b", "runs/c"])  # doctest: +SKIP
        >>> known.summary()  # doctest: +SKIP
    """
    opened = [run if isinstance(run, Run) else open_run(run) for run in runs]
    evidence = evidence_of_runs(opened, network)
    design = _design(covariates or {}, len(opened))
    centre = np.median([_alone(run, evidence.names, network) for run in opened], axis=0)
    found = sample_population(evidence, default_hyperprior(np.log(centre)), design, seed=seed)
    names = [run.path.name for run in opened]
    if len(set(names)) < len(names):
        names = [str(run.path) for run in opened]
    known = content(found, names, list(covariates or {}), type_name=type_name, seed=seed)
    if out is not None:
        folder = Path(out)
        folder.mkdir(parents=True, exist_ok=True)
        write_population(folder / NAME, known)
    return TypeOfMachine(known)


def _alone(run: Run, names: Sequence[str], network: str | None) -> list[float]:
    values = run.values(network)
    return [values[name] for name in names]


def _design(covariates: Mapping[str, Sequence[float]], num: int) -> np.ndarray:
    columns = []
    for name, values in covariates.items():
        column = np.asarray(values, dtype=float)
        if column.shape != (num,) or not np.all(np.isfinite(column)):
            raise InputError(
                f"Expected a finite number for each of {num} machines as covariate {name!r}, got "
                f"{np.sum(np.isfinite(column))} in shape {column.shape}.",
                remedy="Give one number for each run, in their order.",
            )
        columns.append(column - column.mean())
    return np.stack(columns, axis=1) if columns else np.zeros((num, 0))
