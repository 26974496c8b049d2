"""A population in numbers that users read: the type, its machines, and which do not fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...version import __version__
from .law import Hyperprior
from .machines import given_population
from .next_machine import next_machine
from .sampling import Population
from .tolerance import tolerance_limits

OUTLIER = 0.5
"""Probability from which on a machine is called an outlier [1]."""

DIFFERENT = 3.0
"""Standard deviations from what is expected, from which on a parameter is named [1]."""

MEAN_SD, EFFECT_SD, SPREAD = 2.0, 0.2, 0.1
"""Default hyperprior, of logarithms: the mean to a factor of 50 about the machines' middle, what a
covariate does to 20 %, a spread of 10 % with a long tail (half-Cauchy)."""


def default_hyperprior(centre: np.ndarray) -> Hyperprior:
    """Return the hyperprior for logarithms of parameters.

    Args:
        centre: Middle of the machines, shape (parameter,).
    """
    ones = np.ones(centre.size)
    return Hyperprior(centre, MEAN_SD * ones, EFFECT_SD * ones, SPREAD * ones)


def content(
    population: Population,
    machines: Sequence[str],
    covariates: Sequence[str] = (),
    *,
    type_name: str = "",
    seed: int = 0,
) -> dict[str, Any]:
    """Return what stands in `population.json`.

    Args:
        population: Draws of the law of logarithms of parameters.
        machines: Name of each.
        covariates: Name of each.
        type_name: Of the machines.
        seed: Random seed, for the record.
    """
    names = population.evidence.names
    return {
        "heatrun": __version__,
        "type": type_name,
        "num_machines": len(machines),
        "method": population.method,
        "pareto_k": population.pareto_k,
        "is_converged": population.is_converged,
        "seed": seed,
        "parameters": {name: _parameter(population, place) for place, name in enumerate(names)},
        "correlation": np.asarray(population.laws.correlation).mean(axis=0).tolist(),
        "covariates": {
            label: {
                name: _ranged(np.expm1(np.asarray(population.laws.effects)[:, row, place]))
                for place, name in enumerate(names)
            }
            for row, label in enumerate(covariates)
        },
        "machines": _machines(population, machines),
    }


def _parameter(population: Population, place: int) -> dict[str, Any]:
    laws, limits = population.laws, tolerance_limits(population)
    centre, covariance = next_machine(population)
    return {
        "median": _ranged(np.exp(np.asarray(laws.mean)[:, place])),
        "spread": _ranged(np.expm1(np.asarray(laws.sd)[:, place])),
        "tolerance_95_95": np.exp(limits.two_sided[:, place]).tolist(),
        "next_median": float(np.exp(centre[place])),
        "next_log_sd": float(np.sqrt(covariance[place, place])),
    }


def _ranged(draws: np.ndarray) -> dict[str, Any]:
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    return {"value": float(middle), "interval_95": [float(low), float(high)]}


def _machines(population: Population, machines: Sequence[str]) -> list[dict[str, Any]]:
    evidence = population.evidence
    names = evidence.names
    found = given_population(population)
    sd = np.sqrt(np.einsum("mii->mi", found.covariance))
    return [
        {
            "name": machine,
            "outlier_probability": float(found.outlier[row]),
            "is_outlier": bool(found.outlier[row] > OUTLIER),
            "different": [
                name for name, far in zip(names, found.distance[row], strict=True)
                if abs(far) > DIFFERENT
            ],
            "clipped": float(evidence.clipped[row]),
            "parameters": {
                name: {
                    "value": float(np.exp(found.mean[row, place])),
                    "interval_95": np.exp(
                        found.mean[row, place] + np.array([-1.96, 1.96]) * sd[row, place]
                    ).tolist(),
                    "distance_sd": float(found.distance[row, place]),
                }
                for place, name in enumerate(names)
            },
        }
        for row, machine in enumerate(machines)
    ]  # fmt: skip
