r"""What it costs that a load step falls somewhere between two samples.

Samples of the load are joined by straight lines. A step of $\Delta P$ between two of them,
$\delta$ apart, then brings the right heat only if it falls half-way; at an unknown moment, the heat
errs by an energy of standard deviation $\Delta P\,\delta / \sqrt{12}$. At 1 Hz, a winding of a
hundred seconds hardly shows it; a small coil of ten is off by a kelvin behind each step, far beyond
its noise. What such an energy does to the blocks behind its step is one column of their covariance:
taken for independent errors of the blocks, forty of them behind one step would seem to know it six
times better than they do. The strongest directions are kept, eight at most; of what is left the
blocks know the variance. The energy's response is taken from the fast mode of a quick two-node fit
of the same record. The slow mode remembers all steps: what they add up to there is left to the
unmodelled heat and to the finding `between_samples`. The moment that all steps have in common is a
parameter besides (`load_timing`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy import fft

from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.record import Record
from ..record.samples import SLOW_LOGGER_S, samples
from .quick_fit import quick_fit

NUM_COLUMNS = (2, 4, 8)
"""Columns that are kept [1], one of these, as what is compiled depends on it. A staircase of so
many steps needs no more; two cost a density 5 % in a test of 90 minutes, eight a quarter."""

LARGEST = 200
"""Steps among which those columns are sought, the largest first [1]."""

NEGLIGIBLE_K = 0.1
"""Length of a column below which the blocks' variance is enough [K]: an error of all blocks that
is lost in their noise."""

FINE_BLOCKS = 1800
"""Blocks of the quick fit [1]: 4 s in a test of two hours, well below a winding of ten seconds."""


def with_load_moments(blocks: Blocks, record: Record, motor: Motor) -> Blocks:
    """Return a reduced record that knows what its logger leaves open about the load.

    For records that are fitted: it looks at all readings of the winding.

    Args:
        blocks: The record, reduced.
        record: The record.
        motor: Says what the losses are, and the phase resistance.

    Returns:
        `blocks` as they are where the load is sampled at less than `SLOW_LOGGER_S`, where copper
        and other losses cannot be told apart, or where no quick fit describes the record.
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
        copper = motor.copper_loss_W(current, winding)
    rest = losses - copper if motor.losses == "balance" else losses
    fit = quick_fit(record, motor, most_blocks=FINE_BLOCKS)
    if fit is None:
        return blocks
    between_s = np.diff(time_s)
    steps_W = np.diff(np.stack([copper, rest]), axis=1)
    sd_K = np.abs(fit.response_K_per_J[:, 0] @ steps_W) * between_s / np.sqrt(12.0)
    middle_s = time_s[:-1] + 0.5 * between_s - blocks.first_s
    return _known(blocks, -1.0 / fit.taus_s[0], middle_s, sd_K)


def _known(
    blocks: Blocks,
    rate_per_s: float,
    time_s: Float[np.ndarray, " step"],
    sd_K: Float[np.ndarray, " step"],
) -> Blocks:
    """Return blocks that know what shocks of unknown sign, at times from the begin of the grid and
    with standard deviations at once, do to their means: they decay at a rate, negative [1/s].
    """
    step_s, per_block = float(blocks.means["step"]), blocks.weight.shape[1]
    num = blocks.num_blocks * per_block
    place = np.floor(time_s / step_s).astype(int)
    inside = (place >= 0) & (place < num)
    # what is left of a shock, as means over the steps behind it
    edges_s = step_s * np.arange(num + 1)
    left = np.diff(np.exp(rate_per_s * edges_s)) / (rate_per_s * step_s)
    # and as means over blocks, the first of which ends with the step that it comes in
    sums = np.cumsum(np.pad(left, (per_block, 0)))
    means = (sums[per_block:] - sums[:num]) / per_block
    at = np.bincount(place[inside], sd_K[inside] ** 2, num)
    length = fft.next_fast_len(2 * num - 1, real=True)
    shocked, decayed = np.asarray(fft.rfft(np.stack([at, means**2]), length))
    spread = np.asarray(fft.irfft(shocked * decayed, length))[per_block - 1 :][:num]
    variance = np.maximum(spread[::per_block], 0.0)

    largest = np.argsort(-at, kind="stable")[:LARGEST]
    behind = per_block * np.arange(1, blocks.num_blocks + 1)[:, None] - 1 - largest
    shocks = np.where(behind >= 0, means[np.maximum(behind, 0)], 0.0) * np.sqrt(at[largest])
    turned, length, _ = np.linalg.svd(shocks, full_matrices=False)
    matter = np.count_nonzero(length >= NEGLIGIBLE_K)
    if not matter:
        return replace(blocks, load_variance=variance)
    kept = next((few for few in NUM_COLUMNS if few >= matter), NUM_COLUMNS[-1])
    columns = np.zeros((blocks.num_blocks, kept))
    columns[:, : length.size] = turned[:, :kept] * length[:kept]
    rest = np.maximum(variance - np.sum(columns**2, axis=1), 0.0)
    return replace(blocks, load_variance=rest, load_columns=columns)
