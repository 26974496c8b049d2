"""The stretches of a test over which load and cooling are held."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from heatrun.bench.checks.samples import block_means, runs, samples
from heatrun.bench.record import Record

from .drive import has

BLOCK_S = 60.0
"""Means that are compared [s]: a duty that repeats within a minute counts as a constant load."""

SIDE = 3
"""Means on each side of a moment whose medians are compared [1]: one outlier moves neither."""

STEP_SHARE = 0.05
"""A change of the load by this share of its largest magnitude ends a stretch [1]: above what the
warming of copper or a controller changes within minutes, below every step of a test plan."""

GAP_BLOCKS = 3.0
"""Minutes without a sample that end a stretch [1]."""

LOADS = (
    ("torque_Nm", "phase_current_A"),
    ("losses_W",),
    ("mechanical_power_W", "electrical_power_W", "dc_power_W"),
    ("i_d_A", "i_q_A"),
)
"""What tells the load, the most direct first: the first group that was recorded counts."""

BESIDE = ("speed_rpm", "coolant_flow_L_per_min", "fan")
"""What changes losses or cooling beside it."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of constant load.

    Attributes:
        from_s: Its beginning, on the record's clock [s].
        to_s: Its end [s].
    """

    from_s: float
    to_s: float

    @property
    def length_s(self) -> float:
        """How long it is [s]."""
        return self.to_s - self.from_s


def load_channels(record: Record) -> tuple[str, ...]:
    """Return the channels that tell whether the load was held; empty where none was recorded."""
    for group in LOADS:
        found = [channel for channel in group if has(record, channel)]
        if found:
            return (*found, *(channel for channel in BESIDE if has(record, channel)))
    return tuple(channel for channel in BESIDE if has(record, channel))


def stretches(record: Record, shortest_s: float) -> tuple[Stretch, ...]:
    """Return the stretches of constant load, in their order.

    The minutes on both sides of a step belong to no stretch.

    Args:
        record: With one of the `load_channels`.
        shortest_s: Shorter ones are left out [s].
    """
    channels = load_channels(record)
    time_s, *loads = samples(record, *channels)
    if time_s.size == 0:
        return ()
    middle_s, *means = block_means(time_s, BLOCK_S, *loads)
    is_held = np.ones(middle_s.size, dtype=bool)
    for values in means:
        is_held &= ~_changes(values)
    width_s = max(BLOCK_S, float(np.median(np.diff(middle_s)))) if middle_s.size > 1 else BLOCK_S
    is_cut = np.append(False, np.diff(middle_s) > GAP_BLOCKS * width_s)
    found = []
    for first, end in zip(*runs(is_held), strict=True):
        cuts = [first, *(k for k in np.flatnonzero(is_cut) if first < k < end), end]
        for low, high in pairwise(cuts):
            from_s = float(middle_s[low]) - 0.5 * BLOCK_S
            to_s = float(middle_s[high - 1]) + 0.5 * BLOCK_S
            stretch = Stretch(max(from_s, float(time_s[0])), min(to_s, float(time_s[-1])))
            if stretch.length_s >= shortest_s:
                found.append(stretch)
    return tuple(found)


def _changes(values: np.ndarray) -> np.ndarray:
    """Whether the load changes on either side of a block."""
    limit = STEP_SHARE * float(np.max(np.abs(values)))
    jump = np.zeros(values.size + 1, dtype=bool)
    for k in range(1, values.size):
        before = np.median(values[max(0, k - SIDE) : k])
        after = np.median(values[k : k + SIDE])
        # the medians also change beside a step; the step itself is where the neighbours differ
        jump[k] = abs(after - before) > limit and abs(values[k] - values[k - 1]) > 0.5 * limit
    return jump[:-1] | jump[1:]
