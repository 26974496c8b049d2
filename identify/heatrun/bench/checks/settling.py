"""The slow time constant as the longest stretch of steady load shows it, without any network.

A motor of many nodes under one load settles as a sum of exponentials whose last one is the slow
one. Three consecutive means late in the stretch approach the end in a geometric row, and its ratio
is the answer. It stands beside the two-node fit, which books a slow rotor or a wandering coolant as
a slow stator.
"""

from __future__ import annotations

import numpy as np

from ...motor import Motor
from ..record import Record
from .samples import block_means, samples, sink_channel

BLOCK_S = 30.0
"""A third of a winding's time constant."""

STEP_SHARE = 0.1
"""A change of current or losses between blocks by this share of the peak [1] ends a stretch."""

MIN_BLOCKS = 20
"""Ten minutes: several of a winding's time constants, so that its own transient is over."""

SKIPPED_SHARE = 0.25
"""Share of the stretch at its start that belongs to the faster exponentials [1]."""

SETTLED_SHARE = 0.02
"""Means that differ by less than this share of the excess over the sink are equal [1]: the losses
themselves hold no better."""


def settling_constants(record: Record, motor: Motor) -> float:
    """Return how many slow time constants the longest stretch of steady load lasts.

    Args:
        record: Any record.
        motor: Says which channel is the sink.

    Returns:
        Length of the stretch over the time constant in it [1]; inf where it has settled, 0 where
        there is no such stretch or it does not approach an end.
    """
    channels = ["winding_degC", sink_channel(motor), "losses_W"]
    channels += ["phase_current_A"] * ("phase_current_A" in record)
    time_s, winding, sink, *loads = samples(record, *channels)
    means_s, excess, *levels = block_means(time_s, BLOCK_S, winding - sink, *loads)
    if means_s.size < MIN_BLOCKS:
        return 0.0
    steps = np.zeros(means_s.size - 1, dtype=bool)
    for values in levels:
        steps |= np.abs(np.diff(values)) > STEP_SHARE * np.max(np.abs(values))
    edges = np.concatenate(([0], np.flatnonzero(steps) + 1, [means_s.size]))
    longest = int(np.argmax(np.diff(edges)))
    stretch = excess[edges[longest] : edges[longest + 1]]
    if stretch.size < MIN_BLOCKS:
        return 0.0
    late = stretch[int(SKIPPED_SHARE * stretch.size) :]
    first, middle, last = (float(np.mean(third)) for third in np.array_split(late, 3))
    tolerance = SETTLED_SHARE * float(np.max(np.abs(stretch)))
    if abs(last - middle) < tolerance and abs(middle - first) < tolerance:
        return float("inf")
    ratio = (last - middle) / (middle - first) if middle != first else 1.0
    if ratio <= 0.0 or abs(last - middle) < tolerance:
        return float("inf")
    return -3.0 * np.log(ratio) / (1.0 - SKIPPED_SHARE) if ratio < 1.0 else 0.0
