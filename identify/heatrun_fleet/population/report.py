"""A population in numbers that users read: the type, its machines, and which do not fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET, UnsetType

from heatrun.results.discovery import ValueWithInterval
from heatrun.version import __version__

from ..results import (
    POPULATION_FORMAT,
    Assumed,
    MachineLeftOut,
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
    """Return the hyperprior of the parameters in the space of their transforms.

    That of a parameter which is normal by its value is in units of its calibrations' prior.

    Args:
        gathered: The machines.
        spread: Median of the prior of the spread over machines.
    """
    is_log = np.array([transform == "log" for transform in gathered.transforms])
    unit = np.where(is_log, 1.0, np.median(gathered.prior_sd, axis=0))
    return Hyperprior(
        np.median(gathered.mean, axis=0), MEAN_SD * unit, EFFECT_SD * unit, spread * unit
    )


def population_result(
    population: Population,
    gathered: Gathered,
    covariates: Sequence[Covariate] = (),
    *,
    type_name: str = "",
    noise: PopulationNoise | UnsetType = UNSET,
    seed: int = 0,
    notes: Sequence[str] = (),
) -> PopulationResult:
    """Return what stands in `population.json`.

    Args:
        population: Draws of the law of the parameters in the space of their transforms.
        gathered: Its machines.
        covariates: Columns of its design, each of which was divided by its span.
        type_name: Of the machines.
        noise: From `noise_result`.
        seed: Random seed, for the record.
        notes: What else must be known of it.
    """
    spaces = _spaces(gathered)
    effects = np.asarray(population.laws.effects)
    return PopulationResult(
        format=POPULATION_FORMAT,
        heatrun=__version__,
        type=type_name,
        source=dict(gathered.source),
        num_machines=len(gathered.machines),
        left_out=[
            MachineLeftOut(name=each.machine, reason=each.reason) for each in gathered.left_out
        ],
        method=population.method,
        pareto_k=float(population.pareto_k) if np.isfinite(population.pareto_k) else None,
        is_converged=bool(population.is_converged),
        seed=seed,
        parameters=_parameters(population, spaces, seed),
        correlation=_correlation(population),
        outlier_share=_ranged(np.asarray(population.laws.outlier_share)),
        covariates={
            each.label: {
                space.name: _ranged(space.change(effects[:, row, place] / each.span))
                for place, space in enumerate(spaces)
            }
            for row, each in enumerate(covariates)
        },
        covariate_columns={
            each.label: PopulationCovariate(
                column=each.column, kind=each.kind, unit=each.unit, reference=each.reference,
                first=each.low, last=each.high,
                over_range={
                    space.name: _ranged(space.change(effects[:, row, place]))
                    for place, space in enumerate(spaces)
                },
            )
            for row, each in enumerate(covariates)
        },
        machines=_machines(population, gathered, spaces),
        assumed=_assumed(population, spaces),
        notes=list(notes),
        noise=noise,
    )  # fmt: skip


def noise_result(
    population: Population,
    gathered: Gathered,
    covariates: Sequence[Covariate] = (),
    *,
    seed: int = 0,
) -> PopulationNoise:
    """Return what stands under `noise` in `population.json`; arguments as `population_result`."""
    spaces = _spaces(gathered)
    effects = np.asarray(population.laws.effects)
    return PopulationNoise(
        num_machines=len(gathered.machines),
        is_converged=bool(population.is_converged),
        parameters=_parameters(population, spaces, seed),
        correlation=_correlation(population),
        outlier_share=_ranged(np.asarray(population.laws.outlier_share)),
        covariates={
            each.label: {
                space.name: _ranged(space.change(effects[:, row, place]))
                for place, space in enumerate(spaces)
            }
            for row, each in enumerate(covariates)
        },
        machines=_machines(population, gathered, spaces),
        assumed=_assumed(population, spaces),
    )


def _spaces(gathered: Gathered) -> list[_Space]:
    return [
        _Space(*each)
        for each in zip(gathered.names, gathered.units, gathered.transforms, strict=True)
    ]


def _correlation(population: Population) -> list[list[float]]:
    return np.asarray(population.laws.correlation).mean(axis=0).tolist()


def _assumed(population: Population, spaces: Sequence[_Space]) -> dict[str, Assumed]:
    hyper = population.hyper
    return {
        space.name: Assumed(
            mean=float(space.value(hyper.mean[place])),
            mean_sd=float(hyper.mean_sd[place]),
            spread=float(hyper.spread[place]),
            effect_sd=float(hyper.effect_sd[place]),
        )
        for place, space in enumerate(spaces)
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
            tolerance_95_95=_pair(space.value(limits.two_sided[:, place])),
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
