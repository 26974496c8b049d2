"""What the reduction of a record to steps costs, in kelvin of the simulated winding.

Two things are lost in it: what the load does within a step, and what it did between two samples.
Each is measured by simulating the fit once more on other means of the same record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from ...bench import Finding, Record
from ...bench.blocks import SLOW_LOGGER_S, Blocks
from ...bench.reduction import reduce
from ...motor import Motor
from ..problem import Problem, predict_batch
from .fit_result import Fit

COARSE_K = 0.05
"""Error of the reduction to steps from which on it is worth a warning [K]."""

BETWEEN_K = 0.25
"""The same for what the load does between its samples [K]. Drive cycles of the study's tuning seed,
point-sampled at 1 Hz, come to 0.5...0.8 K, its staircases and duties to 0.2 K at most."""

LOADS = ("phase_current_A", "losses_W", "speed_rpm")
"""Channels that may change faster than the sampling."""


def check_reduction(
    found: Fit, record: Record, blocks: Blocks, motor: Motor
) -> tuple[float, tuple[Finding, ...]]:
    """Return the error of the reduction to steps [K], and what is to be said about it.

    Args:
        found: A fit whose network is simulated.
        record: Any test of the motor.
        blocks: The test as it was reduced.
        motor: The machine.
    """
    error = reduction_error(found, record, blocks, motor)
    findings = [_coarse(blocks, error)] if error > COARSE_K else []
    between = between_samples(found, record, blocks, motor)
    if between > BETWEEN_K:
        findings.append(_lost(record, blocks, between))
    return error, tuple(findings)


def reduction_error(found: Fit, record: Record, blocks: Blocks, motor: Motor) -> float:
    """Return the largest error of a block mean that the reduction to steps causes [K].

    The test is simulated on its steps and on steps of a quarter of the length (no shorter than
    its samples), started alike; arguments as `check_reduction`.
    """
    step = float(blocks.inputs.step)
    shorter = max(step / 4.0, min(blocks.sample_s, step))
    finer = reduce(record, motor, step_s=shorter, block_s=blocks.block_s)
    means = _simulated(found, motor, blocks, [blocks, finer])
    num = min(part.size for part in means)
    seen = blocks.is_observed[:num]
    return float(np.max(np.abs(means[0][:num] - means[1][:num])[seen]))


def between_samples(found: Fit, record: Record, blocks: Blocks, motor: Motor) -> float:
    """Return the error of the block means that a slow logger of the load may cause [K].

    Half the root mean square of what the simulation on every second sample of the load differs
    from that on the others. If the samples are independent of each other, that is the error of
    the simulation on all of them; the smoother the load, the more of an upper limit it is.
    Arguments as `check_reduction`.

    Returns:
        0 for a logger that is fast enough.
    """
    if _period(record) < SLOW_LOGGER_S:
        return 0.0
    halves = [
        replace(blocks, inputs=reduce(
            _every_second(record, first), motor,
            step_s=float(blocks.inputs.step), block_s=blocks.block_s,
        ).inputs)
        for first in (0, 1)
    ]  # fmt: skip
    even, odd = _simulated(found, motor, blocks, halves)
    return 0.5 * float(np.sqrt(np.mean((even - odd)[blocks.is_observed] ** 2)))


def _simulated(
    found: Fit, motor: Motor, blocks: Blocks, versions: Sequence[Blocks]
) -> list[np.ndarray]:
    """Return the block means [degC] of versions of a test at the fit, all started as `blocks`."""
    problem = Problem.of(found.problem.model, motor, [blocks])
    names = found.problem.parameters.names
    z = np.zeros(problem.num_parameters)
    for position, slot in enumerate(problem.parameters.slots):
        if slot.name in names:
            z[position] = found.z[names.index(slot.name)]
    means = []
    for version in versions:
        data = replace(problem.data, tests=(version.observation(),))
        means.append(np.asarray(predict_batch(problem.structure, data, jnp.asarray(z[None]))[0])[0])
    return means


def _period(record: Record) -> float:
    """Return the median time between two samples of the fastest channel of the load [s]."""
    periods = [
        float(np.median(np.diff(record.time_s[np.isfinite(record[name])])))
        for name in LOADS
        if name in record and np.sum(np.isfinite(record[name])) > 1
    ]
    return min(periods)


def _every_second(record: Record, first: int) -> Record:
    """Return the record with every second sample of the load from `first` on, and its ends."""
    channels = dict(record.channels)
    for name in LOADS:
        if name in channels:
            there = np.flatnonzero(np.isfinite(channels[name]))
            dropped = there[1 - first :: 2]
            channels[name] = channels[name].copy()
            channels[name][np.setdiff1d(dropped, there[[0, -1]])] = np.nan
    return replace(record, channels=channels)


def _coarse(blocks: Blocks, error: float) -> Finding:
    return Finding(
        id="reduction",
        severity="warning",
        message=f"averaging the record over steps of {float(blocks.inputs.step):g} s changes the "
        f"simulated winding temperature by up to {error:.2g} K (limit {COARSE_K} K): the "
        "parameters may be biased.",
        where=blocks.name,
        remedy="The winding responds faster than the steps resolve: record at a shorter interval.",
        test=blocks.name,
        values={"reduction_error_K": error},
    )


def _lost(record: Record, blocks: Blocks, error: float) -> Finding:
    period = _period(record)
    return Finding(
        id="between_samples",
        severity="warning",
        message=f"the load changes faster than it is sampled, every {period:.3g} s (aliasing): the "
        f"simulated winding temperature may be wrong by {error:.2g} K (limit {BETWEEN_K} K). The "
        "95 % intervals allow for single load steps, not for what many add up to; bands of "
        "predicted tests for neither.",
        where=blocks.name,
        remedy="Record the load at a shorter interval, or as means over the logger's period; if "
        "the values are such means, nothing is lost.",
        test=blocks.name,
        values={"between_samples_K": error, "period_s": period},
    )
