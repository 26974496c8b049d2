r"""What it costs that a load step falls somewhere between two samples.

Samples of the load are joined by straight lines. A step of $\Delta P$ between two of them,
$\delta$ apart, then brings the right heat only if it falls half-way; at an unknown moment, the heat
errs by an energy of standard deviation $\Delta P\,\delta / \sqrt{12}$. At 1 Hz, a winding of a
hundred seconds hardly shows it; a small coil of ten is off by a kelvin behind each step, far beyond
its noise. What such an energy does to the blocks behind its step is one column of their covariance:
taken for independent errors of the blocks, forty of them behind one step would seem to know it six
times better than they do. The strongest directions are kept, eight at most; of what is left the
blocks know the variance. The energy's response is that of a quick two-node fit of the same record.
Its slow mode remembers all steps: in a body of a few times the winding's capacity, an intermittent
duty adds up more than a step leaves in the winding. The moment that all steps have in common is a
parameter besides (`load_timing`). What a clock that was set wrong does is far more, and `load_late`
tells it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
from jaxtyping import Float

from ..record.blocks import Blocks, strongest
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import SLOW_LOGGER_S, median_step, place, samples
from ..record.stretch import move_load
from .advice import section_of
from .contact import lost_contact
from .quick_fit import MAX_RESIDUAL_SHARE, quick_fit
from .unexplained import unexplained_movement

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


LATE_S = (5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 160.0, 240.0, 320.0, 480.0)
"""Offsets of the load's clock that are tried [s], up to `PART` of the record."""

PROBES, PROMISING, PART = 3, 0.9, 0.1
"""The first of them, and the misfit over that with the load as it is up to which one of these asks
for the others [1]; and the largest, in parts of the record [1]."""

LEAST_K, LEAST_SHARE = 0.2, 0.002
"""Misfit of a simple network [K], and in parts of the swing [1], that is worth a question."""

FOLLOWED = 0.03
"""Misfit in parts of the swing [1] beyond which a simple network does not follow the winding, and
all are tried."""

BETTER, FINE = 0.33, 0.02
"""Misfit of a simple network with the load moved over that with the load as it is, up to which it
is late, and share of the offset to which that is sought [1]."""

BLOCKS = 240
"""Block means of a record that do for this [1]."""


def load_late(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a load whose clock is behind that of the temperatures: a simple network describes the
    winding three times as well with the load moved to earlier.

    A load that comes early is none: there the sensor may be late.
    """
    time_s, winding = samples(record, "winding_degC")
    swing_K = float(np.ptp(winding)) if winding.size else 0.0

    def misfit_K(late_s: float) -> float:
        fit = quick_fit(move_load(record, -late_s, ""), motor, most_blocks=BLOCKS)
        return MAX_RESIDUAL_SHARE * swing_K if fit is None else fit.rms_K

    if not swing_K:
        return
    offsets = [late_s for late_s in LATE_S if late_s < PART * float(np.ptp(time_s))]
    if not offsets:
        return
    tried = {0.0: misfit_K(0.0)}
    if tried[0.0] < max(LEAST_K, LEAST_SHARE * swing_K):
        return
    tried |= {late_s: misfit_K(late_s) for late_s in offsets[:PROBES]}
    if PROMISING * tried[0.0] < min(tried.values()) and tried[0.0] < FOLLOWED * swing_K:
        return
    tried |= {late_s: misfit_K(late_s) for late_s in offsets[PROBES:]}
    best = min(tried, key=lambda late_s: tried[late_s])
    width_s = 0.25 * best
    while width_s > FINE * best:
        tried |= {late_s: misfit_K(late_s) for late_s in (best - width_s, best + width_s)}
        best = min(tried, key=lambda late_s: tried[late_s])
        width_s *= 0.5
    # within two samples the moment of a step is not known, which `load_timing` is for
    if tried[best] > BETTER * tried[0.0] or best < 2.0 * median_step(time_s):
        return
    moved = unexplained_movement(record, motor)
    if moved is not None:
        spans = [(moved.from_s, moved.until_s)]
        rest = quick_fit(record, motor, left_out_s=spans, most_blocks=BLOCKS)
        if rest is not None and rest.rms_K < tried[best]:
            return  # a sensor that came off explains as much
    lost = lost_contact(record, motor)
    if lost is not None and lost.misfit_put_right_K < tried[best]:
        return  # and so does one that comes off slowly
    yield Finding(
        "load_late",
        "error",
        f"The winding moves about {best:.1f} s before the load that moves it: the load is recorded "
        f"late. Moved, it leaves {tried[best]:.2g} K of {tried[0.0]:.2g} K to a simple network.",
        place(record, "losses_W", *map(float, record.time_s[[0, -1]])),
        f"Check the clocks of the loggers. To move the load: {section_of(record)} load_offset = "
        f"{-best:.1f} in the motor file.",
        values={"late_s": best, "misfit_K": tried[0.0], "misfit_moved_K": tried[best]},
    )


def with_load_moments(blocks: Blocks, record: Record, motor: Motor) -> Blocks:
    """Return a reduced record that knows what its logger leaves open about the load.

    For records that are fitted: it looks at all readings of the winding. The blocks stay as they
    are where the load is sampled at less than `SLOW_LOGGER_S`, where copper and other losses cannot
    be told apart, or where no quick fit describes the record.
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
    sd_K = fit.response_K_per_J.T @ steps_W * between_s / np.sqrt(12.0)
    middle_s = time_s[:-1] + 0.5 * between_s - blocks.first_s
    return _known(blocks, -1.0 / np.array(fit.taus_s), middle_s, sd_K)


def _known(
    blocks: Blocks,
    rates_per_s: Float[np.ndarray, " mode"],
    time_s: Float[np.ndarray, " step"],
    sd_K: Float[np.ndarray, "mode step"],
) -> Blocks:
    """Return blocks that know what shocks of unknown size do to their means.

    Args:
        blocks: The record.
        rates_per_s: At which the modes decay, negative [1/s].
        time_s: When the shocks come, from the begin of the grid [s].
        sd_K: What a standard deviation of each adds to each mode at once [K].
    """
    from scipy import fft

    step_s, per_block = float(blocks.means["step"]), blocks.weight.shape[1]
    num = blocks.num_blocks * per_block
    place = np.floor(time_s / step_s).astype(int)
    inside = (place >= 0) & (place < num)
    place, sd_K = place[inside], sd_K[:, inside]
    # what is left of a shock, as means over the steps behind it
    edges = rates_per_s[:, None] * step_s * np.arange(num + 1)
    left = np.diff(np.exp(edges)) / (rates_per_s[:, None] * step_s)
    # and as means over blocks, the first of which ends with the step that it comes in
    sums = np.cumsum(np.pad(left, ((0, 0), (per_block, 0))), axis=1)
    means = (sums[:, per_block:] - sums[:, :num]) / per_block
    length = fft.next_fast_len(2 * num - 1, real=True)
    variance = np.zeros(blocks.num_blocks)
    for one, other in combinations_with_replacement(range(rates_per_s.size), 2):
        at = np.bincount(place, sd_K[one] * sd_K[other], num) * (1 + (one != other))
        shocked, decayed = np.asarray(fft.rfft(np.stack([at, means[one] * means[other]]), length))
        spread = np.asarray(fft.irfft(shocked * decayed, length))[per_block - 1 :][:num]
        variance += spread[::per_block]
    variance = np.maximum(variance, 0.0)

    # of a shock alone, in the square, over all blocks
    weight = np.einsum("ms,ns,mn->s", sd_K, sd_K, means @ means.T)
    largest = np.argsort(-weight, kind="stable")[:LARGEST]
    behind = per_block * np.arange(1, blocks.num_blocks + 1)[:, None] - 1 - place[largest]
    shocks = np.where(
        behind >= 0, np.einsum("mbs,ms->bs", means[:, np.maximum(behind, 0)], sd_K[:, largest]), 0.0
    )
    columns = strongest(shocks, NUM_COLUMNS[-1])
    matter = np.count_nonzero(np.linalg.norm(columns, axis=0) >= NEGLIGIBLE_K)
    if not matter:
        return replace(blocks, load_variance=variance)
    kept = next(few for few in NUM_COLUMNS if few >= matter)
    columns = np.pad(columns, ((0, 0), (0, NUM_COLUMNS[-1] - columns.shape[1])))[:, :kept]
    rest = np.maximum(variance - np.sum(columns**2, axis=1), 0.0)
    return replace(blocks, load_variance=rest, load_columns=columns)
