r"""A sensor that loses contact over many minutes: from a moment on it shows less of the rise.

What comes off at once is an `unexplained_movement`. A contact that is lost over ten to forty
minutes moves no faster than heat does; but no network of two nodes makes what it reads,

$$ T_{read} = T_0 + (1 - a\,s(t)) (T - T_0) $$

with $s$ from 0 to 1 over that time. So moment, length and share $a$ are sought with which the
readings, as they would have been, are described best. A cooling that becomes stronger in the midst
of a test does much the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float

from ..record.motor import Motor
from ..record.record import Record
from .quick_fit import (
    GRID,
    NOISE_K,
    START_SD_K,
    Course,
    course_of,
    fit_of,
    pairs_on,
    places_of,
    solved,
)

BLOCKS = 150
"""Block means of a record that do for this [1]."""

LEAST_K, LEAST_SHARE = 0.2, 0.01
"""Misfit of a simple network [K], and in parts of the swing [1], that is worth a question."""

MOMENTS, LENGTHS_S, SHARES = 10, (700.0, 1800.0), (0.2, 0.35, 0.55)
"""Moments that are tried, lengths [s] and shares [1]."""

NARROWED, MOST_ROUNDS, PROMISING = 3, 15, 0.8
"""How often the steps to the tries beside the best are halved, rounds of such tries at most, and
the misfit over that of the readings as they are up to which they go on [1]."""

LIMITS = (300.0, 0.02), (3000.0, 0.9)
"""Least and largest length [s] and share [1]: what goes on longer is a drift of the network's."""

MOVES = np.array([*product((-1.0, 0.0, 1.0), repeat=3)])
"""From the best try to those beside it, in steps of each."""

NEAR = 2.5
"""Factor about time constants within which others are sought [1]."""

LEAST_SHARE_LOST = 0.25
"""Of the rise [1]: what a network of two nodes leaves of a fan or a rotor looks like less; 0.18 was
seen."""

BETTER = 0.25
"""Misfit with the contact put right over that with the readings as they are [1]: where a fan
changes the cooling with the speed, 0.2 was seen."""


@dataclass(frozen=True)
class LostContact:
    """What the readings lose, slowly."""

    from_s: float  # When it begins [s].
    to_s: float  # When it ends [s]; the end of the record if that comes first.
    share: float  # Of the rise above the sink that is not shown from then on [1].
    misfit_K: float  # What a simple network leaves of the readings [K].
    misfit_put_right_K: float  # What it leaves of them with that share given back [K].


def lost_contact(record: Record, motor: Motor) -> LostContact | None:
    """Return how the winding's sensor loses contact over minutes; None where nothing shows it."""
    course = course_of(record, motor, most_blocks=BLOCKS)
    if course is None:
        return None
    as_read = fit_of(course)
    swing_K = float(np.ptp(course.winding_degC))
    misfit_K = 0.1 * swing_K if as_read is None else as_read.rms_K
    if misfit_K < max(LEAST_K, LEAST_SHARE * swing_K):
        return None
    step_s = course.duration_s / (MOMENTS + 1)
    first_s = float(course.time_s[0])
    tried = np.array([*product(first_s + step_s * np.arange(1, MOMENTS + 1), LENGTHS_S, SHARES)])
    width = np.array([0.5 * step_s, 0.25 * LENGTHS_S[0], 0.5 * (SHARES[1] - SHARES[0])])
    misfits, near_s = _misfits_K(course, _put_right(course, tried))
    best, num_left = tried[np.argmin(misfits)], NARROWED
    for _ in range(MOST_ROUNDS):
        tried = best + MOVES * width * np.array([1.0, best[1] / LENGTHS_S[0], 1.0])
        tried[:, 1:] = np.clip(tried[:, 1:], *LIMITS)
        misfits, near_s = _misfits_K(course, _put_right(course, tried), near_s)
        nearest = tried[np.argmin(misfits)]
        if np.array_equal(nearest, best):
            width, num_left = 0.5 * width, num_left - 1
        best = nearest
        if not num_left or np.min(misfits) > PROMISING * misfit_K:
            break
    put_right = fit_of(replace(course, winding_degC=_put_right(course, best[None])[0]))
    end_s = float(course.time_s[-1])
    to_s = min(float(best[0] + best[1]), end_s)
    share = float(best[2] * (to_s - best[0]) / best[1])
    if put_right is None or put_right.rms_K > BETTER * misfit_K or share < LEAST_SHARE_LOST:
        return None
    return LostContact(float(best[0]), to_s, share, misfit_K, put_right.rms_K)


def _put_right(course: Course, tried: Float[np.ndarray, "try 3"]) -> Float[np.ndarray, "try block"]:
    """Return the readings as they would have been, had the contact not been lost."""
    from_s, lasts_s, share = tried.T[:, :, None]
    lost = share * np.clip((course.time_s - from_s) / lasts_s, 0.0, 1.0)
    return course.sink_degC + (course.winding_degC - course.sink_degC) / (1.0 - lost)


def _misfits_K(
    course: Course,
    windings_degC: Float[np.ndarray, "try block"],
    near_s: tuple[float, float] | None = None,
) -> tuple[Float[np.ndarray, " try"], tuple[float, float]]:
    """Fit two nodes to each of several readings in place of a course's own, on one grid.

    It lies near a fast and a slow time constant, if they are given. Returned is what is left of
    each, rms [K], and the time constants [s] of the one with the least.
    """
    first_s = np.array([course.step_s, 4.0 * course.step_s])
    last_s = np.array([0.3, 4.0]) * course.duration_s
    if near_s is not None:
        first_s, last_s = (np.array(near_s) * NEAR**sign for sign in (-1.0, 1.0))
    axes = np.geomspace(first_s, last_s, GRID, axis=1)
    pairs, pairs_s = pairs_on(axes)
    mixed, lagged = course.mixed(pairs_s), course.lagged(axes.ravel())[places_of(pairs)]
    rows, start = mixed[:, :5] @ lagged, mixed[:, 5:, :8] @ lagged[:, :8]
    sought = windings_degC - course.sink_degC[0] + start
    num = windings_degC.shape[0]
    sd = np.array([np.inf, np.inf, np.inf, course.body_sd_K, START_SD_K])
    squares = solved(
        np.repeat(rows @ rows.transpose(0, 2, 1), num, axis=0),
        (sought @ rows.transpose(0, 2, 1)).reshape(-1, 5),
        np.sum(sought**2, axis=2).ravel(),
        penalty=(NOISE_K / sd) ** 2,
        num_positive=2,
    ).squares.reshape(-1, num)
    pair = int(np.argmin(np.min(squares, axis=1)))
    fast, slow = map(float, pairs_s[:, pair])
    return np.sqrt(np.min(squares, axis=0) / course.time_s.size), (fast, slow)
