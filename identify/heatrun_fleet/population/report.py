"""A population in numbers that users read: the type, its machines, and which do not fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import UNSET

from heatrun.results.discovery import ValueWithInterval
from heatrun.version import __version__

from ..results import (
    POPULATION_FORMAT,
    Assumed,
    MachineParameter,
    PopulationCovariate,
    PopulationMachine,
    PopulationNoise,
    PopulationParameter,
    PopulationResult,
)
from .gathered import Covariate, Gathered
from .law import Hyperprior
from .sampling import Population, given_population, next_interval, next_machine, tolerance_limits

OUTLIER = 0.5
"""Probability from which on a machine is called an outlier [1]."""

DIFFERENT = 3.0
"""Standard deviations from what is expected, from which on a parameter is named [1]."""

MEAN_SD, EFFECT_SD, SPREAD = 2.0, 0.2, 0.1
"""Default hyperprior, of logarithms: the mean to a factor of 50 about the machines' middle, what a
covariate does over its range to 20 %, a spread of 10 % with a long tail (half-Cauchy)."""

NOISE_SPREAD = 0.3
"""Median of the spread for noise and unmodelled heat, which machines share less [1]."""

LARGEST_LOG = 300.0
"""Logarithm beyond which a number means nothing any more [1]."""

NORMAL_95 = 1.96
"""Standard deviations on each side that hold 95 % of a normal law."""


def default_hyperprior(gathered: Gathered, spread: float = SPREAD) -> Hyperprior:
    """Return the hyperprior of the parameters in the space of their transforms, with the median of
    the prior of the spread; for a parameter normal by its value, in units of its calibrations'
    prior.
    """
    is_log = np.array([transform == "log" for transform in gathered.transforms])
    unit = np.where(is_log, 1.0, np.median(gathered.prior_sd, axis=0))
    return Hyperprior(
        np.median(gathered.mean, axis=0), MEAN_SD * unit, EFFECT_SD * unit, spread * unit
    )


def population_result(
    gathered: Gathered,
    population: Population,
    of_noise: Population | None = None,
    *,
    type_name: str = "",
    seed: int = 0,
) -> PopulationResult:
    """Return what stands in `population.json`.

    Args:
        gathered: The machines, with the covariates of the design, each divided by its span.
        population: Draws of the law of the parameters in the space of their transforms.
        of_noise: Of noise and unmodelled heat, if they are known.
        type_name: Of the machines.
        seed: Random seed, for the record.
    """
    notes, noise = list(gathered.notes), UNSET
    over_range = _changes(population, gathered, gathered.covariates)
    if not population.is_converged:
        notes.append("The sampling did not converge: the intervals are indicative.")
    if of_noise is not None and gathered.noise is not None:
        noise = PopulationNoise(
            **_of_both(of_noise, gathered.noise, seed),
            covariates=_changes(of_noise, gathered.noise, gathered.covariates),
        )
        if not noise.is_converged:
            notes.append(
                "The sampling of the noise did not converge: its intervals are indicative."
            )
    return PopulationResult(
        **_of_both(population, gathered, seed),
        format=POPULATION_FORMAT,
        heatrun=__version__,
        type=type_name,
        source=dict(gathered.source),
        left_out=list(gathered.left_out),
        method=population.method,
        pareto_k=float(population.pareto_k) if np.isfinite(population.pareto_k) else None,
        seed=seed,
        covariates=_changes(population, gathered, gathered.covariates, per_unit=True),
        covariate_columns={
            each.label: PopulationCovariate(
                column=each.column, kind=each.kind, unit=each.unit, reference=each.reference,
                first=each.low, last=each.high, over_range=over_range[each.label],
            )
            for each in gathered.covariates
        },
        notes=notes,
        noise=noise,
    )  # fmt: skip


def _of_both(population: Population, gathered: Gathered, seed: int) -> dict[str, Any]:
    """Return what is said alike of the parameters and of the noise."""
    spaces = [*map(_Space, gathered.names, gathered.units, gathered.transforms)]
    hyper = population.hyper
    return {
        "num_machines": len(gathered.machines),
        "is_converged": bool(population.is_converged),
        "parameters": _parameters(population, spaces, seed),
        "correlation": np.asarray(population.laws.correlation).mean(axis=0).tolist(),
        "outlier_share": _ranged(np.asarray(population.laws.outlier_share)),
        "machines": _machines(population, gathered, spaces),
        "assumed": {
            space.name: Assumed(
                mean=float(space.value(hyper.mean[place])),
                mean_sd=float(hyper.mean_sd[place]),
                spread=float(hyper.spread[place]),
                effect_sd=float(hyper.effect_sd[place]),
            )
            for place, space in enumerate(spaces)
        },
    }


def _changes(
    population: Population, gathered: Gathered, covariates: Sequence[Covariate], *,
    per_unit: bool = False,
) -> dict[str, dict[str, ValueWithInterval]]:  # fmt: skip
    """Return what each covariate does to each parameter over its range, or per unit."""
    effects = np.asarray(population.laws.effects)
    spaces = [*map(_Space, gathered.names, gathered.units, gathered.transforms)]
    return {
        each.label: {
            space.name: _ranged(
                space.change(effects[:, row, place] / (each.span if per_unit else 1.0))
            )
            for place, space in enumerate(spaces)
        }
        for row, each in enumerate(covariates)
    }


@dataclass(frozen=True)
class _Space:
    """A parameter between the space in which it is normal and its unit."""

    name: str
    unit: str
    transform: str

    @property
    def is_log(self) -> bool:
        return self.transform == "log"

    def value(self, at: np.ndarray) -> np.ndarray:
        """Return values [unit]."""
        return np.exp(_finite(at)) if self.is_log else np.asarray(at)

    def change(self, by: np.ndarray) -> np.ndarray:
        """Return differences as shares [1], or in the unit."""
        return np.expm1(_finite(by)) if self.is_log else np.asarray(by)


def _finite(logs: np.ndarray) -> np.ndarray:
    """Return logarithms of numbers that a file can hold: three machines exclude no spread."""
    return np.clip(logs, -LARGEST_LOG, LARGEST_LOG)


def _parameters(
    population: Population, spaces: Sequence[_Space], seed: int
) -> dict[str, PopulationParameter]:
    laws, limits = population.laws, tolerance_limits(population)
    centre, covariance = next_machine(population)
    sd = np.sqrt(np.diag(covariance))
    interval = next_interval(population, seed=seed)
    mean, spread = np.asarray(laws.mean), np.asarray(laws.sd)
    return {
        space.name: PopulationParameter(
            unit=space.unit,
            transform="log" if space.is_log else "linear",
            median=_ranged(space.value(mean[:, place])),
            spread=_ranged(space.change(spread[:, place])),
            tolerance_95_95=_pair(space.value(limits[:, place])),
            next_median=float(space.value(centre[place])),
            next_log_sd=float(sd[place]) if space.is_log else None,
            next_sd=None if space.is_log else float(sd[place]),
            next_interval_95=_pair(space.value(interval[:, place])),
        )
        for place, space in enumerate(spaces)
    }


def _ranged(draws: np.ndarray) -> ValueWithInterval:
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    return ValueWithInterval(value=float(middle), interval_95=(float(low), float(high)))


def _pair(ends: np.ndarray) -> tuple[float, float]:
    low, high = ends
    return float(low), float(high)


def _machines(
    population: Population, gathered: Gathered, spaces: Sequence[_Space]
) -> list[PopulationMachine]:
    found = given_population(population)
    sd = np.sqrt(np.einsum("mii->mi", found.covariance))
    alone_sd = np.sqrt(np.einsum("mii->mi", gathered.covariance))
    both = np.array([-NORMAL_95, NORMAL_95])

    def parameter(row: int, place: int, space: _Space) -> MachineParameter:
        mean, alone = found.mean[row, place], gathered.mean[row, place]
        return MachineParameter(
            value=float(space.value(mean)),
            interval_95=_pair(space.value(mean + both * sd[row, place])),
            alone_value=float(space.value(alone)),
            alone_interval_95=_pair(space.value(alone + both * alone_sd[row, place])),
            distance_sd=float(found.distance[row, place]),
        )

    return [
        PopulationMachine(
            name=machine,
            outlier_probability=float(found.outlier[row]),
            is_outlier=bool(found.outlier[row] > OUTLIER),
            different=[
                space.name for space, far in zip(spaces, found.distance[row], strict=True)
                if abs(far) > DIFFERENT
            ],
            clipped=float(population.evidence.clipped[row]),
            parameters={
                space.name: parameter(row, place, space) for place, space in enumerate(spaces)
            },
        )
        for row, machine in enumerate(gathered.machines)
    ]  # fmt: skip
