"""Time constants without any network: of the longest stretch of steady load, and of a cool-down.

A motor of many nodes under one load settles as a sum of exponentials whose last one is the slow
one. Three consecutive means late in the stretch approach the end in a geometric row, and its ratio
is the answer. It stands beside the two-node fit, which books a slow rotor or a wandering coolant as
a slow stator.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares, nnls

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


GRID = 24
"""Time constants that a cool-down is first looked for with."""

APART = 2.0
"""Factor between two time constants [1] below which a record shows one."""

BETTER = 0.7
"""Rms residual of two over that of one [1] below which there are two."""


def cooling_constants(record: Record, motor: Motor) -> tuple[float, ...]:
    """Return the time constants of a cool-down [s], the fastest first: two, one or none.

    Args:
        record: Without load throughout.
        motor: Says which channel is the sink.
    """
    time_s, winding, sink = samples(record, "winding_degC", sink_channel(motor))
    width_s = float(np.ptp(time_s)) / 400.0 if time_s.size else 0.0
    if width_s <= 0.0:
        return ()
    time_s, excess = block_means(time_s, width_s, winding - sink)
    time_s = time_s - time_s[0]
    if time_s.size < MIN_BLOCKS:
        return ()
    usual_s = float(np.median(np.diff(time_s)))

    def rest(log_tau: np.ndarray) -> np.ndarray:
        terms = np.exp(-time_s[:, None] / np.exp(log_tau))
        return terms @ nnls(terms, excess)[0] - excess

    grid = np.log(np.geomspace(0.5 * usual_s, 2.0 * time_s[-1], GRID))
    tried = [np.array([a, b]) for i, a in enumerate(grid) for b in grid[i + 1 :]]
    found = []
    for starts in (grid[:, None], tried):
        best = min(starts, key=lambda at: float(np.sum(rest(at) ** 2)))
        solved = least_squares(rest, best, x_scale=0.1, bounds=(grid[0], grid[-1] + 1e-9)).x
        found.append((np.sort(np.exp(solved)), float(np.sqrt(np.mean(rest(solved) ** 2)))))
    (one, alone), (two, both) = found
    is_two = both < BETTER * alone and two[1] > APART * two[0] and two[1] < 2.0 * time_s[-1]
    return tuple(float(tau) for tau in (two if is_two else one))


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
