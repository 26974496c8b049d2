r"""What it costs that a load step falls somewhere between two samples.

Samples of the load are joined by straight lines. A step of $\Delta P$ between two of them,
$\delta$ apart, then brings the right heat only if it falls half-way; at an unknown moment, the heat
errs by an energy of standard deviation $\Delta P\,\delta / \sqrt{12}$. At 1 Hz, a winding of a
hundred seconds hardly shows it; a small coil of ten is off by a kelvin behind each step, far beyond
its noise. So the blocks behind a step count for less: what such energies add to the variance of
their means, by the response of a crude two-node fit of the same record, joins that of rounding. The
moment that all steps have in common is a parameter besides (`load_timing`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.signal import fftconvolve

from ..motor import Motor
from .blocks import SLOW_LOGGER_S, Blocks
from .checks.crude_fit import CrudeFit, crude_fit
from .checks.samples import samples
from .record import Record

FINE_BLOCKS = 1800
"""Blocks of the crude fit [1]: 4 s in a test of two hours, well below a winding of ten seconds."""


def with_load_moments(blocks: Blocks, record: Record, motor: Motor) -> Blocks:
    """Return a reduced record that knows what its logger leaves open about the load.

    Args:
        blocks: The record, reduced.
        record: The record.
        motor: Says what the losses are, and the phase resistance.

    Returns:
        `blocks` as they are where the load is sampled at less than `SLOW_LOGGER_S`, where copper
        and other losses cannot be told apart, or where no crude fit describes the record.
    """
    time_s, current, losses, winding = samples(
        record, "phase_current_A", "losses_W", "winding_degC"
    )
    if time_s.size < 2 or np.median(np.diff(time_s)) < SLOW_LOGGER_S:
        return blocks
    copper = np.zeros(time_s.size)
    if np.any(current != 0.0):
        if motor.phase_resistance_ohm is None:
            return blocks
        B = motor.resistance_coefficient_degC
        warm = (B + winding) / (B + motor.reference_temperature_degC)
        copper = motor.phases * motor.phase_resistance_ohm * warm * current**2
    rest = losses - copper if motor.losses == "balance" else losses
    fit = crude_fit(record, motor, most_blocks=FINE_BLOCKS)
    if fit is None:
        return blocks
    between_s = np.diff(time_s)
    energy = np.diff(np.stack([copper, rest])) * between_s / np.sqrt(12.0)
    middle_s = time_s[:-1] + 0.5 * between_s - blocks.first_s
    return replace(blocks, load_variance=_variance(blocks, fit, middle_s, energy))


def _variance(
    blocks: Blocks,
    fit: CrudeFit,
    time_s: Float[np.ndarray, " step"],
    energy_J: Float[np.ndarray, "node step"],
) -> Float[np.ndarray, " block"]:
    """Return the variance of block means that energies of unknown sign at some times give [K^2].

    Args:
        blocks: The grid.
        fit: How the winding answers.
        time_s: When they come, from the begin of the grid [s].
        energy_J: Their standard deviations in winding and stator, of one sign each [J].
    """
    step_s, per_block = float(blocks.inputs.step), blocks.weight.shape[1]
    num = blocks.num_blocks * per_block
    place = np.floor(time_s / step_s).astype(int)
    kept = (place >= 0) & (place < num)
    # the winding's answer to a joule in each node, as means over the steps behind it
    edges_s = step_s * np.arange(num + 1)
    decay = np.exp(np.minimum(fit.rates_per_s[:, None] * edges_s, 0.0))
    answer = fit.response_K_per_J @ (np.diff(decay) / (fit.rates_per_s[:, None] * step_s))
    # and as means over blocks, the first of which ends with the step that it begins in
    sums = np.cumsum(np.pad(answer, ((0, 0), (per_block, 0))), axis=1)
    means = (sums[:, per_block:] - sums[:, :num]) / per_block
    variance = np.zeros(blocks.num_blocks)
    for i, j in ((0, 0), (0, 1), (1, 1)):
        at = np.bincount(place[kept], (energy_J[i] * energy_J[j])[kept], num)
        spread = fftconvolve(at, means[i] * means[j])[per_block - 1 : per_block - 1 + num]
        variance += (1.0 if i == j else 2.0) * spread[::per_block]
    return np.maximum(variance, 0.0)
