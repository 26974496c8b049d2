"""The width that no method can beat: the Cramér-Rao bound with the true noise and the priors."""

from __future__ import annotations

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from coverage_bench import READING_S, SensorNoise

from heatrun.model.problem import Problem, linearise
from heatrun.record.blocks import Blocks

NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


def bound(
    problem: Problem,
    true: Mapping[str, float],
    noise: SensorNoise,
    start_degC: tuple[float, float],
) -> dict[str, float]:
    """Return the smallest standard deviation of the logarithm of each network parameter [1].

    Args:
        problem: Model and the one test.
        true: True values by parameter name.
        noise: True noise; its variance counts, not its tails.
        start_degC: True temperatures of winding and stator at the start.

    Reference: H. L. Van Trees, Detection, Estimation, and Modulation Theory, part I, section 2.4
        (the bound with prior information).
    """
    starts = dict(zip(("Tw_start", "Tsr_start"), start_degC, strict=True))
    slots = problem.parameters.slots
    known = {**true, **starts}
    z = np.array(
        [float(slot.parameter.score(known.get(slot.parameter.name, 0.0))) for slot in slots]
    )
    _, jacobian = linearise(problem.structure, problem.data, jnp.asarray(z))
    factor = np.linalg.cholesky(covariance(problem.tests[0], noise))
    columns = np.linalg.solve(factor, np.asarray(jacobian)[problem.is_observed])
    spread = np.linalg.inv(columns.T @ columns + np.eye(z.size))
    names = problem.parameters.names
    return {
        name: float(np.sqrt(spread[at, at]) * slots[at].parameter.sd)
        for name in NETWORK
        for at in [names.index(name)]
    }


def covariance(test: Blocks, noise: SensorNoise) -> np.ndarray:
    """Return the exact covariance of the observed block means [K^2], shape (block, block).

    The mean of an Ornstein-Uhlenbeck process over a block is correlated with that over another by
    the decay between their samples, summed over both.
    """
    num = round(test.block_s / READING_S)
    keep = float(np.exp(-READING_S / noise.time_s))
    sample = np.arange(num)
    size = int(np.sum(test.is_observed))
    within = float(np.mean(keep ** np.abs(sample[:, None] - sample)))
    lag = np.abs(np.arange(size)[:, None] - np.arange(size))
    between = float(np.mean(keep ** sample[::-1])) * float(np.mean(keep ** (sample + 1)))
    correlation = np.where(lag == 0, within, between * keep ** (num * np.maximum(lag - 1, 0)))
    white = noise.white_sd_K**2 / READING_S + noise.resolution_K**2 / 12.0
    level = np.where(test.time[test.is_observed] > 0.5 * test.duration_s, noise.grows, 1.0)
    drift = noise.sd_K**2 * correlation + white / num * np.eye(size)
    return level[:, None] * drift * level
