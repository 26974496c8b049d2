r"""Movements of the winding's reading that no heat explains.

Whatever the network, its temperatures are linear in the heat through first-order lags,

$$ T(t) = \sum_j L_{\tau_j} * (a_j I^2 + b_j P + c_j T_0)(t) + d_j \, e^{-t/\tau_j} $$

with time constants from one sample to the length of the test. The weights are found from the
changes between samples, by a regression that outliers do not move; what then changes otherwise, far
beyond its usual scatter and beyond what the load makes of it there, is of the sensor. A reading
that fails early would teach the regression that heat does nothing: so the shortest beginning of
the record that shows something decides.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..record.motor import Motor
from ..record.record import Record
from ..record.samples import (
    is_loaded,
    leaps_K,
    median_step,
    rounding_step,
    samples,
    sink_channel,
    with_all_heat,
)
from .quick_fit import first_order

MAX_CELLS, MAX_ROWS = 20_000, 3_000
"""Samples of the course, and changes that the weights are found from."""

MIN_CELLS = 60
LAGS = 10
RIDGE = 1e-4
"""Of the squared length of a column [1]: what the loads do not tell apart stays small."""

ROUNDS, TUKEY = 8, 4.685
"""Of the reweighting, and its constant in standard deviations [1]: 95 % efficient on clean data."""

WINDOWS_S = (0.0, 10.0, 30.0, 100.0)
"""Changes within one sample and over these times are looked at [s]: a sensor in air cools with a
time constant of a second to a minute."""

LEAST_K = (1.5, 3.0)
"""Less hides in what a linear network leaves of a machine [K]: at once, and over the longest
window. Of 65 records of machines with shaft fans, lags and rotors it left none beyond what scatter
and load steps are given."""

SIGMAS = 8.0
OF_LOAD = 0.6
"""A load step and what follows on it is known to this share [1], with its moment."""

PARTS = 12
"""Beginnings of a record that are tried."""

BEGUN = 0.2
"""Share of the largest change between two samples [1] from which the movement has begun."""

LEAP = 0.3
"""Share of the fall [1] that a return makes up within a sample, and keeps."""


@dataclass(frozen=True)
class Movement:
    """A movement of the reading that no heat explains."""

    from_s: float  # Last time at which the reading was that of the winding [s].
    to_s: float  # Time at which it has moved [s].
    from_degC: float  # Reading before [degC].
    to_degC: float  # Reading after [degC].
    expected_K: float  # What heat makes of it in that time [K].
    # Last time before the reading is back; the record's last if it does not come back.
    until_s: float
    is_back: bool  # Whether it comes back.


def unexplained_movement(record: Record, motor: Motor) -> Movement | None:
    """Return the first movement of the winding's reading that no heat explains, None if none is."""
    course = _course(record, motor)
    if course is None or not (whole := course.events(course.time_s.size)):
        return None
    found: int | None = None
    for size in course.beginnings():
        events = course.events(size) if size < course.time_s.size else whole
        if found is not None and any(abs(one - found) <= course.near for one in events):
            return course.movement(found, size)
        found = events[0] if events else None
    return None if found is None else course.movement(found, course.time_s.size)


@dataclass(frozen=True)
class _Course:
    """Reading and lagged heat on an even grid of times."""

    time_s: np.ndarray  # Times [s], shape (cell,).
    reading: np.ndarray  # The winding [degC], shape (cell,).
    terms: np.ndarray  # What may explain it, scaled, shape (cell, term).
    # Whether the cell before is a sample away and not behind a gap, shape (cell,).
    is_known: np.ndarray
    widths: tuple[int, ...]  # Cells of each window.
    step_K: float  # Rounding of the reading [K].
    from_cell: int  # First cell under load.

    @property
    def near(self) -> int:
        """Cells within which two movements are one."""
        return 2 * self.widths[-1]

    def beginnings(self) -> Iterator[int]:
        """Yield the cells of the beginnings that are tried, the shortest first."""
        size = self.time_s.size
        for part in np.linspace(0.0, 1.0, PARTS + 1)[1:]:
            cells = int(self.from_cell + part * (size - self.from_cell))
            if cells >= MIN_CELLS:
                yield cells

    def explained(self, size: int, *, is_firm: bool = True) -> np.ndarray:
        """Return what heat makes of the reading, by the weights of a beginning of so many cells
        [K].

        Where it is firm, outliers count nothing; else they count by their size, not its square.
        """
        width = max(1, self.widths[1] if len(self.widths) > 1 else 1)
        rows = np.arange(0, size - width, max(1, (size - width) // MAX_ROWS))
        rows = rows[self._is_whole(rows, width)]
        change = self.reading[rows + width] - self.reading[rows]
        terms = self.terms[rows + width] - self.terms[rows]
        length = np.maximum(np.linalg.norm(terms, axis=0), 1e-12)
        terms = terms / length
        floor = 0.3 * self.step_K + 0.01
        weights, solved = np.ones(rows.size), np.zeros(length.size)
        for _ in range(ROUNDS):
            weighed = weights[:, None] * terms
            gram = terms.T @ weighed + RIDGE * np.eye(length.size)
            solved = np.linalg.solve(gram, change @ weighed)
            by_heat = terms @ solved
            rest = np.abs(change - by_heat)
            scale = max(1.4826 * float(np.median(rest)), floor)
            # of a long test at one load, rounded to 1 K, the steps of the load are all that tells
            far = rest / (TUKEY * scale + OF_LOAD * np.abs(by_heat))
            weights = np.maximum(1.0 - far**2, 0.0) ** 2 if is_firm else 1.0 / np.maximum(far, 1.0)
        return self.terms @ (solved / length)

    def events(self, size: int) -> list[int]:
        """Return the cells from which a beginning of the record moves as no heat moves it.

        Both regressions must say so: the one takes a first load step for an outlier, the other
        bends to a large one; in place of the other, that the reading leaps as no temperature does.
        """
        if size < MIN_CELLS:
            return []
        firm = self._events(self.explained(size)[:size])
        plain = self._events(self.explained(size, is_firm=False)[:size]) if firm else []
        return [
            cell
            for cell in firm
            if any(abs(cell - one) <= self.near for one in plain) or self._leaps(cell, size)
        ]

    def _leaps(self, cell: int, size: int) -> bool:
        """Return whether the reading moves within two cells beyond both slopes beside them."""
        if not 2 <= cell < size - 4:
            return False
        noise_K = 1.4826 * float(np.median(np.abs(np.diff(self.reading[:size]))))
        leap_K, _ = leaps_K(self.time_s, self.reading, np.array([cell]))
        return abs(float(leap_K[0])) > LEAST_K[0] + 2.0 * self.step_K + SIGMAS * noise_K

    def _events(self, by_heat: np.ndarray) -> list[int]:
        size = by_heat.size
        found: set[int] = set()
        for width in self.widths:
            begin = np.arange(size - width)
            begin = begin[self._is_whole(begin, width)]
            if begin.size < MIN_CELLS:
                continue
            expected = by_heat[begin + width] - by_heat[begin]
            beside = self.reading[begin + width] - self.reading[begin] - expected
            middle = float(np.median(beside))
            scatter = 1.4826 * float(np.median(np.abs(beside - middle)))
            lasts_s = width * float(self.time_s[1] - self.time_s[0])
            least_K = float(np.interp(lasts_s, (WINDOWS_S[0], WINDOWS_S[-1]), LEAST_K))
            limit = least_K + 2.0 * self.step_K + SIGMAS * scatter
            limit = limit + OF_LOAD * _swing(by_heat, begin, width)
            beyond = np.flatnonzero(np.abs(beside - middle) > limit)
            found |= {self._moment(by_heat, int(begin[at]), width) for at in beyond}
        return sorted(found)

    def movement(self, cell: int, size: int) -> Movement:
        """Return what happens from a cell on, by the weights of a beginning of the record."""
        by_heat = self.explained(size)
        beside = self.reading - by_heat
        begins = self._moment(by_heat, cell, self.near)
        most = abs(float(beside[begins + 1] - beside[begins]))
        while cell > 0 and abs(float(beside[cell] - beside[cell - 1])) > BEGUN * most:
            cell -= 1
        beside = beside - np.median(beside[max(cell - 5, 0) : cell + 1])
        # it has moved where it first goes no further, within the longest window
        ahead = beside[cell : cell + self.near + 1]
        far = int(np.argmax(np.abs(ahead)))
        enough = np.abs(ahead) >= 0.9 * np.abs(ahead[far])
        moved = cell + int(np.argmax(enough))
        # a fault that lasts spoils the weights of the whole, one that passes those of a beginning
        back = self._back(cell, moved, by_heat)
        if back is None and size < self.time_s.size:
            back = self._back(cell, moved, self.explained(self.time_s.size))
        until = self.time_s.size - 1 if back is None else back
        return Movement(
            from_s=float(self.time_s[cell]),
            to_s=float(self.time_s[moved]),
            from_degC=float(self.reading[cell]),
            to_degC=float(self.reading[moved]),
            expected_K=float(by_heat[moved] - by_heat[cell]),
            until_s=float(self.time_s[until]),
            is_back=back is not None,
        )

    def _back(self, cell: int, moved: int, by_heat: np.ndarray) -> int | None:
        """Return the last cell before the reading is back by a leap, None if it does not come.

        A drift of the network's own may cross the old level: back is where it stays a while.
        """
        beside = self.reading - by_heat
        beside = beside - np.median(beside[max(cell - 5, 0) : cell + 1])
        fall = abs(float(beside[moved]))
        near = np.abs(beside[moved + 1 :]) < max((1.0 - LEAP) * fall, 2.0 * self.step_K)
        stays = max(1, min(self.widths[-1], near.size))
        if near.size < stays:
            return None
        held = np.convolve(near, np.ones(stays), "valid") > stays - 0.5
        leaps = (-np.sign(beside[moved]) * np.diff(beside[moved:]))[: held.size] > LEAP * fall
        found = np.flatnonzero(held & leaps)
        return moved + int(found[0]) if found.size else None

    def _is_whole(self, begin: np.ndarray, width: int) -> np.ndarray:
        """Whether no gap lies within windows of a width."""
        holes = np.concatenate([[0], np.cumsum(~self.is_known)])
        return holes[begin + width + 1] == holes[begin + 1]

    def _moment(self, by_heat: np.ndarray, begin: int, width: int) -> int:
        """The cell behind which a window moves most."""
        span = slice(begin, begin + width + 1)
        return int(begin + np.argmax(np.abs(np.diff(self.reading[span] - by_heat[span]))))


def _swing(by_heat: np.ndarray, begin: np.ndarray, width: int) -> np.ndarray:
    """How far heat moves the reading in and about windows [K], shape of `begin`."""
    steps = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(by_heat)))])
    room = width + 2
    return (
        steps[np.minimum(begin + width + room, steps.size - 1)] - steps[np.maximum(begin - room, 0)]
    )


def _course(record: Record, motor: Motor) -> _Course | None:
    record = with_all_heat(record, motor)
    names = ("winding_degC", sink_channel(motor), "losses_W", "phase_current_A")
    time_s, winding, sink, losses, current = samples(record, *names)
    # losses in a wrong unit may be below zero; heat there is where a current flows
    loaded = is_loaded(losses) | is_loaded(current**2)
    if time_s.size < MIN_CELLS or not loaded.any():
        return None
    usual = median_step(time_s)
    step_s = max(usual, float(time_s[-1] - time_s[0]) / MAX_CELLS)
    grid = np.arange(time_s[0], time_s[-1] + 0.5 * step_s, step_s)
    at = np.clip(np.searchsorted(time_s, grid), 1, time_s.size - 1)
    on_grid = [np.interp(grid, time_s, values) for values in (winding, sink, losses, current**2)]
    reading, *drives = on_grid
    drives[0] = drives[0] - drives[0][0]
    lags_s = np.geomspace(step_s, 2.0 * (grid[-1] - grid[0]), LAGS)
    decays = np.exp(-step_s / lags_s)
    terms = []
    for drive in drives:
        scale = float(np.quantile(np.abs(drive), 0.99))
        if not 0.0 < scale < np.inf:
            continue
        # a burst of the load is no matter of the reading: `load_spike` tells it
        held = np.clip(drive / scale, -2.0, 2.0)
        mean = 0.5 * (held + np.concatenate([held[:1], held[:-1]]))
        terms += [first_order(mean, d) for d in decays]
    terms += [np.exp(-(grid - grid[0]) / lag) for lag in lags_s]
    if not np.all(np.isfinite(reading)):
        return None
    longest = max(1, grid.size // 8)
    widths = sorted({min(longest, max(1, round(s / step_s))) for s in WINDOWS_S})
    return _Course(
        time_s=grid,
        reading=reading,
        terms=np.stack(terms, axis=1),
        is_known=time_s[at] - time_s[at - 1] <= 3.0 * step_s,
        widths=tuple(widths),
        step_K=rounding_step(winding) or 0.0,
        from_cell=int(np.argmax(np.interp(grid, time_s, loaded) > 0.5)),
    )
