r"""A two-node fit of a record within a tenth of a second, good enough to judge the record by.

The winding of two nodes answers its own heat $P_w$, the heat $P_s$ of the body behind it and the
sink $T_0$ by two first-order lags. With $L_\tau$ a lag of unit gain and $W = (\tau_2 L_{\tau_2} -
\tau_1 L_{\tau_1})/(\tau_2 - \tau_1)$ both in a row,

$$ T = W\,T_0 + \frac{\tau_1}{C_w} L_{\tau_1} P_w + R\,W (P_w + P_s) + R'\,W P_w + \text{start} $$

which is linear in all but the two time constants. So a grid of them is solved at once, drawn closer
to where the likelihood is, and what the grid keeps is the posterior: a record that leaves the slow
time constant open says so. One node is the limit of a fast lag that answers at once. A sensor that
lags, behind both, is tried in a few sizes. The noise is that of residuals whose neighbours
within a minute tell the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from ..record.motor import Motor
from ..record.record import Record
from ..record.samples import EQUILIBRIUM_K, integral, lead_in, samples, sink_channel, with_all_heat

MAX_BLOCKS = 400
"""A block of a 90-minute test is then 13 s long, an eighth of a winding's time constant."""

MIN_BLOCKS = 30
"""Six unknowns, and five blocks for each."""

COLD_BODY_SD_K, WARM_BODY_SD_K = 0.5, 10.0
"""Prior sd of the stator's start against the winding's, for a start in equilibrium and for
another."""

START_SD_K = 5.0
"""Of both starts about the first readings [K], which a lag, a wrong clock or noise may move."""

NOISE_K, NOISE_TIME_S, LEAST_FREE = 0.3, 60.0, 12
"""About the residual that rounding to 1 °C and a simple model leave; residuals closer than twice a
correlation time of 30 s tell the same. A test of less than twelve minutes, whose clock may be
wrong, counts as twelve independent blocks."""

LOG_SD = 2.8
"""Prior sd of the logarithm of each time constant: a factor of 250, so that a record without any
gives one."""

FAST_SHARE = 0.015
"""Centre of the prior of the fast time constant over the length of the test [1]; that of the slow
one is the length."""

LONGEST = 20.0
"""Slow time constants reach so many lengths of the test [1]: beyond, the course is straight."""

APART = 1.3
"""Ratio of the two time constants [1] below which they are one."""

SENSOR_S, LAG_SHOWN, LAG_REACH = (6.0, 10.0, 16.0, 25.0, 40.0), 3.0, 4.0
"""Lags of a sensor that are tried [s], the gain of the log likelihood [1] that shows one, and the
factor [1] by which it may have made time constants longer; it may have taken the place of the fast
one, which is then its square longer."""

GRID, MOST_LOOKS, ENOUGH, SMALLEST = 18, 8, 0.3, 1e-3
"""Time constants on each axis; the grid is drawn closer until this share of it [1] has more than
the smallest weight beside the best [1]."""

RIDGE, FLOOR = 1e-12, 1e-12
"""Share of the square of a column [1] that keeps two that are nearly alike solvable, and of what is
to be explained that no fit falls below: products are no more exact."""

MAX_RESIDUAL_SHARE = 0.1
"""A fit whose rms residual exceeds this share of the temperature's range explains nothing [1]."""


@dataclass(frozen=True)
class Course:
    """Means of a test over blocks of one length."""

    time_s: Float[np.ndarray, " block"]  # Middle of each block [s], shape (block,).
    step_s: float  # Length of a block [s].
    winding_degC: Float[np.ndarray, " block"]  # Winding temperature, shape (block,).
    sink_degC: Float[np.ndarray, " block"]  # Temperature of the sink, shape (block,).
    # Loss of the winding, or the shape of it, shape (block,).
    copper_W: Float[np.ndarray, " block"]
    all_W: Float[np.ndarray, " block"]  # All losses, shape (block,).
    start_degC: float  # Winding temperature at the start.
    body_sd_K: float  # Standard deviation of the body's start about the winding's.
    is_counted: np.ndarray  # Which temperatures count, shape (block,).

    @property
    def duration_s(self) -> float:
        """Length of the test [s]."""
        return self.step_s * self.winding_degC.size

    def lagged(self, taus_s: Float[np.ndarray, " lag"]) -> Float[np.ndarray, "row block"]:
        """Return what any pair of lags [s] is mixed of: copper [W], all losses [W] and sink [K]
        after each lag, the decay of each [1], and the winding above the first sink [K].
        """
        above = self.sink_degC - self.sink_degC[0]
        drives = np.stack([self.copper_W, self.all_W, above])[:, None]
        ratio = (self.step_s / taus_s)[:, None]
        start = -np.expm1(-ratio) / ratio * np.exp(-ratio * np.arange(above.size))
        winding = self.winding_degC - self.sink_degC[0]
        return np.concatenate([*_lagged(drives, ratio), start, winding[None]])

    def behind(self, sensor_s: float) -> Course:
        """Return the course whose heat comes as late as a sensor shows it."""
        if sensor_s == 0.0:
            return self
        copper, heat = _lagged(np.stack([self.copper_W, self.all_W]), self.step_s / sensor_s)
        return replace(self, copper_W=copper, all_W=heat)

    def mixed(self, pairs_s: Float[np.ndarray, "2 pair"]) -> Float[np.ndarray, "pair 6 9"]:
        """Return how pairs of fast and slow time constants [s] mix lagged rows.

        They are weights of the drives of `lagged` after the fast lag, after the slow one, and of
        the winding, that give the columns of 1/C_w, R, R', of a body that starts 1 K above the
        winding and of both that start 1 K above the readings, and what they are to explain.
        """
        fast, slow = pairs_s
        quick, late = -fast / (slow - fast), slow / (slow - fast)
        found = np.zeros((fast.size, 6, 9))
        found[:, 0, 0] = fast
        for row, drive, share in ((1, 1, 1.0), (2, 0, 1.0), (5, 2, -1.0)):
            found[:, row, drive], found[:, row, 4 + drive] = share * quick, share * late
        found[:, 3, 3], found[:, 3, 7] = -late, late
        found[:, 4, 3], found[:, 4, 7] = quick, late
        found[:, 5] -= (self.start_degC - self.sink_degC[0]) * found[:, 4]
        found[:, 5, 8] = 1.0
        return found


def first_order(
    values: Float[np.ndarray, "... time"], decay: ArrayLike
) -> Float[np.ndarray, "... time"]:
    """Return finite values on an even grid behind a first-order lag of unit gain, from 0 on.

    The decay is what is left of the lag after a step, 0 to 1 [1]; of several lags, along an axis
    before that of the time.
    """
    # by doubling, as SciPy has a filter for it that takes longer to load than all of this
    decay = np.asarray(decay)
    found, reach = (1.0 - decay) * values, 1
    while reach < values.shape[-1] and np.any(decay > 0.0):
        found[..., reach:] += decay * found[..., :-reach]
        decay, reach = decay * decay, 2 * reach
    return found


def _lagged(drives: np.ndarray, ratio: float | np.ndarray) -> np.ndarray:
    """Block means after lags of 1/ratio blocks, from 0 on, of drives held over each block."""
    decay, mean = np.exp(-ratio), -np.expm1(-ratio) / ratio
    ends = first_order(drives, decay)
    begins = np.zeros_like(ends)
    begins[..., 1:] = ends[..., :-1]
    return drives + (begins - drives) * mean


@dataclass(frozen=True)
class QuickFit:
    """A record as a two-node network sees them."""

    time_s: Float[np.ndarray, " block"]  # Middle of each block [s], shape (block,).
    # Winding temperature as the network makes it, shape (block,).
    fitted_degC: Float[np.ndarray, " block"]
    sd_K: Float[np.ndarray, " block"]  # Standard deviation of that, noise left out, shape (block,).
    rms_K: float  # Root mean square residual over the blocks that count.
    taus_s: tuple[float, float]  # Fast and slow time constant.
    log_sd: float  # Standard deviation of the logarithm of the slow one [1].
    # What a joule in the winding, and one in the body, adds to the winding's temperature in the
    # fast and the slow mode at once, shape (2, 2).
    response_K_per_J: Float[np.ndarray, "2 2"]

    @property
    def tau_s(self) -> float:
        """Slow time constant [s]."""
        return self.taus_s[1]


def quick_fit(
    record: Record,
    motor: Motor,
    *,
    left_out_s: Sequence[tuple[float, float]] = (),
    most_blocks: int = MAX_BLOCKS,
) -> QuickFit | None:
    """Fit two nodes to any record; None where it has too little, or they do not describe it.

    Without a phase resistance, or a current, the share of copper in the losses is fitted too.
    Temperatures in the spans that are left out [s] do not count; block means there are so many, at
    most.
    """
    course = course_of(record, motor, left_out_s=left_out_s, most_blocks=most_blocks)
    return None if course is None else fit_of(course)


def fit_of(course: Course, most: float = MAX_RESIDUAL_SHARE) -> QuickFit | None:
    """Fit two nodes to a course; as `quick_fit`. More than `most` of the range explains nothing."""
    if not np.max(course.all_W) > 0.0:
        return None
    rows = (course.winding_degC, course.sink_degC, course.copper_W, course.all_W)
    if not all(np.all(np.isfinite(each)) for each in rows):
        return None
    first_s = 0.25 * course.step_s, 2.0 * course.step_s
    last_s = 0.5 * course.duration_s, LONGEST * course.duration_s
    look = _closed_in(_look(course, np.geomspace(first_s, last_s, GRID, axis=1)))
    fast, slow = look.pairs_s[:, int(np.argmax(look.weight))]
    first_s, last_s = (fast / LAG_REACH, slow / LAG_REACH), (LAG_REACH**2 * fast, 2.0 * slow)
    axes = np.geomspace(first_s, last_s, GRID, axis=1)
    tried = [_look(course.behind(sensor_s), axes) for sensor_s in SENSOR_S]
    best = int(np.argmax([each.log_density for each in tried]))
    # a coarse grid misses the best pair by more than lags differ: from here on uphill
    lagging = {best: _closed_in(tried[best])}
    while True:
        for near in {max(best - 1, 0), min(best + 1, len(tried) - 1)} - set(lagging):
            lagging[near] = _closed_in(tried[near])
        top = max(lagging, key=lambda place: lagging[place].log_density)
        if top == best:
            break
        best = top
    if lagging[best].log_density > look.log_density + LAG_SHOWN:
        look = lagging[best]
    return _told(look, most)


def course_of(
    record: Record,
    motor: Motor,
    *,
    left_out_s: Sequence[tuple[float, float]] = (),
    most_blocks: int = MAX_BLOCKS,
) -> Course | None:
    """Return the block means of a record; as `quick_fit`."""
    # a constant of 0 A stands for a current that is not known
    has_current = "phase_current_A" in record and bool(np.any(record["phase_current_A"]))
    channels = ["winding_degC", sink_channel(motor), "losses_W"]
    channels += ["phase_current_A"] * has_current
    time_s, *columns = samples(record, *channels)
    if time_s.size < 2 * MIN_BLOCKS or np.ptp(columns[0]) == 0.0:
        return None
    if motor.losses == "map" and not (has_current and motor.phase_resistance_ohm):
        return None
    heat_W = samples(with_all_heat(record, motor), *channels)[3]
    lead = lead_in(time_s, heat_W if np.max(heat_W) > 0.0 else np.ones(time_s.size))
    edges = np.linspace(time_s[0], time_s[-1], min(most_blocks, time_s.size // 2) + 1)
    squares = (current**2 for current in columns[3:])
    winding, sink, losses, *squared = _on_grid(time_s, edges, *columns[:3], *squares)
    counted = np.ones(winding.size, dtype=bool)
    for from_s, to_s in left_out_s:
        counted &= (edges[1:] < from_s) | (edges[:-1] > to_s)
    copper = losses
    if np.sum(counted) < MIN_BLOCKS:
        return None
    if has_current:
        # as warm as the readings that count; without a resistance its shape is enough
        warm = np.interp(edges[1:], edges[1:][counted], winding[counted])
        copper = motor.phases * squared[0] * motor.resistance_ratio(warm)
        copper = copper * (motor.phase_resistance_ohm or 1.0)
    excess = float(np.median((columns[0] - columns[1])[:lead]))
    step_s = float(edges[1] - edges[0])
    return Course(
        time_s=0.5 * (edges[1:] + edges[:-1]),
        step_s=step_s,
        winding_degC=winding,
        sink_degC=sink,
        copper_W=copper,
        all_W=losses if motor.losses == "balance" else losses + copper,
        start_degC=float(np.median(columns[0][:lead])),
        body_sd_K=COLD_BODY_SD_K if abs(excess) < EQUILIBRIUM_K else WARM_BODY_SD_K,
        is_counted=counted,
    )


def _on_grid(time_s: np.ndarray, edges: np.ndarray, *channels: np.ndarray) -> list[np.ndarray]:
    """Means of channels between edges; across a gap they run straight."""
    steps = np.diff(time_s)
    means = []
    for values in channels:
        area = integral(values, steps)
        means.append(np.diff(np.interp(edges, time_s, area)) / np.diff(edges))
    return means


class Solved(NamedTuple):
    """Linear least squares, once for each point of a grid."""

    solution: np.ndarray  # Shape (point, column).
    squares: np.ndarray  # Sum of squares that is left, penalties included, shape (point,).
    # Covariance of the solution over the variance of a row, shape (point, column, column).
    inverse: np.ndarray


def solved(
    gram: Float[np.ndarray, "point column column"],
    moment: Float[np.ndarray, "point column"],
    total: Float[np.ndarray, " point"],
    *,
    penalty: ArrayLike = 0.0,
    num_positive: int = 0,
) -> Solved:
    """Solve linear least squares at each point of a grid.

    `gram` and `moment` are products of what explains with each other and with what is to be
    explained, `total` that of the latter with itself; a penalty is on the square of each
    coefficient, and so many of the first coefficients may not be negative.
    """
    num = moment.shape[1]
    size = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    scale = size[:, :, None] * size[:, None]
    ridge = RIDGE + np.broadcast_to(penalty, (num,)) / size**2
    gram, moment = gram / scale + ridge[:, :, None] * np.eye(num), moment / size
    best = Solved(np.zeros_like(moment), np.full(total.size, np.inf), np.zeros_like(gram))
    # the set of columns that leaves the least squares, of those with no coefficient below 0; where
    # all columns are such a set, no other leaves less
    open_points = np.arange(total.size)
    for used in product((1.0, 0.0), repeat=num_positive):
        mask = np.array([*used, *np.ones(num - num_positive)])
        both = np.outer(mask, mask)
        inverse = np.linalg.inv(gram[open_points] * both + np.diag(1.0 - mask)) * both
        found = (inverse @ moment[open_points, :, None])[:, :, 0]
        squares = total[open_points] - np.sum(found * moment[open_points], axis=1)
        is_right = np.all(found[:, :num_positive] >= 0.0, axis=1)
        is_better = is_right & (squares < best.squares[open_points])
        for kept, new in zip(best, (found, squares, inverse), strict=True):
            kept[open_points[is_better]] = new[is_better]
        if all(used):
            open_points = open_points[~is_right]
    return Solved(best.solution / size, np.maximum(best.squares, 0.0), best.inverse / scale)


def closer(grid: np.ndarray, likely: np.ndarray) -> np.ndarray:
    """Return a geometric grid from below the first to above the last likely place of another.

    A grid too coarse to show more than a few of them may have the best between places farther off.
    """
    by = 3 if np.ptp(likely) < 3 else 1
    first, last = max(int(np.min(likely)) - by, 0), min(int(np.max(likely)) + by, grid.size - 1)
    return np.geomspace(grid[first], grid[last], grid.size)


def weighed(log_weight: Float[np.ndarray, " point"]) -> Float[np.ndarray, " point"]:
    """Return the probabilities that belong to logarithms of a density."""
    weight = np.exp(log_weight - np.max(log_weight))
    return weight / np.sum(weight)


def _closed_in(look: _Look) -> _Look:
    """The grid of fast and slow time constants, drawn closer to the likely ones."""
    for _ in range(MOST_LOOKS):
        likely = look.weight > SMALLEST * np.max(look.weight)
        if np.sum(likely) > ENOUGH * GRID**2:
            break
        places = zip(look.axes, look.pairs, strict=True)
        look = _look(look.course, np.stack([closer(axis, at[likely]) for axis, at in places]))
    return look


class _Look(NamedTuple):
    """A grid of pairs of time constants."""

    course: Course  # What they are to explain.
    axes: np.ndarray  # Fast and slow time constants [s], shape (2, lag).
    lagged: np.ndarray  # As `Course.lagged`.
    pairs: np.ndarray  # Places of fast and slow lags on their axes, shape (2, pair).
    pairs_s: np.ndarray  # Time constants [s], shape (2, pair).
    found: Solved  # Solution of each pair, by the columns of `Course.mixed`.
    weight: np.ndarray  # Posterior probability of each pair, shape (pair,).
    log_density: float  # Its largest logarithm, before it is scaled to probabilities.
    freedom: float  # Independent blocks [1].


def places_of(pairs: np.ndarray) -> np.ndarray:
    """Rows of `Course.lagged` that pairs mix, shape (pair, 9)."""
    drives = 2 * GRID * np.arange(4)
    fast, slow = pairs[:, :, None]
    return np.concatenate([drives + fast, drives + GRID + slow, 0 * fast + 8 * GRID], axis=1)


def pairs_on(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of lags that are apart on their axes, and these [s], shape (2, pair)."""
    fast_s, slow_s = axes
    pairs = np.argwhere(slow_s[None] >= APART * fast_s[:, None]).T
    return pairs, np.stack([fast_s[pairs[0]], slow_s[pairs[1]]])


def _look(course: Course, axes: np.ndarray) -> _Look:
    pairs, pairs_s = pairs_on(axes)
    lagged, places = course.lagged(axes.ravel()), places_of(pairs)
    counted, mixed = lagged[:, course.is_counted], course.mixed(pairs_s)
    products = (counted @ counted.T)[places[:, :, None], places[:, None]]
    products = mixed @ products @ mixed.transpose(0, 2, 1)
    gram, moment, total = products[:, :5, :5], products[:, :5, 5], products[:, 5, 5]
    rise = max(float(np.ptp(course.winding_degC[course.is_counted])), 1.0)
    copper = max(float(np.mean(course.copper_W)), 1e-300)
    sd = np.array([np.inf, np.inf, rise / copper, course.body_sd_K, START_SD_K])
    dilution = max(min(NOISE_TIME_S, course.duration_s / LEAST_FREE) / course.step_s, 1.0)
    found = solved(gram, moment, total, penalty=dilution * (NOISE_K / sd) ** 2, num_positive=2)
    freedom = max(counted.shape[1] / dilution - sd.size, 1.0)
    away = np.log(pairs_s / course.duration_s / np.array([[FAST_SHARE], [1.0]])) / LOG_SD
    floor = FLOOR * float(np.max(total))
    log_weight = -0.5 * (freedom * np.log(found.squares + floor) + np.sum(away**2, axis=0))
    largest = float(np.max(log_weight))
    weight = weighed(log_weight)
    return _Look(course, axes, lagged, pairs, pairs_s, found, weight, largest, freedom)


def _told(look: _Look, most: float) -> QuickFit | None:
    """What the grid says: the best pair, and how far the others disagree with it."""
    course = look.course
    likely = np.flatnonzero(look.weight > SMALLEST * np.max(look.weight))
    weight = look.weight[likely] / np.sum(look.weight[likely])
    best = int(np.argmax(weight))
    solution = look.found.solution[likely]
    mixed, lagged = (
        course.mixed(look.pairs_s[:, likely]),
        look.lagged[places_of(look.pairs[:, likely])],
    )
    signs = np.concatenate([-solution, np.ones((weight.size, 1))], axis=1)
    errors = np.einsum("ki,kij,kjn->kn", signs, mixed, lagged, optimize=True)
    counted = errors[best, course.is_counted]
    rms = float(np.sqrt(np.mean(counted**2)))
    if not rms < most * float(np.ptp(course.winding_degC[course.is_counted])):
        return None
    columns = mixed[best, :5] @ lagged[best]
    within = np.einsum("in,ij,jn->n", columns, look.found.inverse[likely[best]], columns)
    within = within * float(counted @ counted) / look.freedom
    fast, slow = look.pairs_s[:, likely[best]]
    quick, R, more = solution[best, :3]
    in_slow = np.array([R + more, R]) / (slow - fast)
    log_slow = np.log(look.pairs_s[1, likely])
    return QuickFit(
        time_s=course.time_s,
        fitted_degC=course.winding_degC - errors[best],
        sd_K=np.sqrt(within + weight @ (errors - errors[best]) ** 2),
        rms_K=rms,
        taus_s=(float(fast), float(slow)),
        log_sd=float(np.sqrt(weight @ (log_slow - weight @ log_slow) ** 2)),
        response_K_per_J=np.array([[quick - in_slow[0], in_slow[0]], [-in_slow[1], in_slow[1]]]),
    )


def solved_decays(
    time_s: Float[np.ndarray, " time"],
    values: Float[np.ndarray, " time"],
    taus_s: Float[np.ndarray, "point decay"],
    *,
    has_rest: bool = False,
) -> Solved:
    """Solve for a sum of decays, whose sizes at the first time are not negative, at each point.

    Where the course, without load or under one that is constant, tends to a rest that is no decay,
    the last coefficient is the rest, and no coefficient has a sign.
    """
    terms = np.exp((time_s[0] - time_s) / taus_s[:, :, None])
    if has_rest:
        terms = np.concatenate([terms, np.ones((len(terms), 1, time_s.size))], axis=1)
    gram, moment = terms @ terms.transpose(0, 2, 1), terms @ values
    total = np.full(len(terms), float(values @ values))
    return solved(gram, moment, total, num_positive=0 if has_rest else taus_s.shape[1])
