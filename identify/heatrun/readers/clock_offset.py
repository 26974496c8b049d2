"""Where on the thermometer's clock the drive's clock starts, by the motor's own response.

For each offset the winding temperature is regressed on the lagged heats of the drive. The residuals
are whitened by a short autoregression, since neighbouring samples of a logger do not err
independently, and the profile of their sum of squares is the likelihood of the offset. How many
samples it may count is judged twice, and the smaller number holds: by the correlation that
whitening has left, and by how the contributions to the slope of the likelihood, which come in lumps
at the steps of the load, add up.

The regression (`Response`) comes first, then the search and how far its likelihood can be trusted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..checks.quick_fit import first_order, solved

MAX_BLOCKS = 1500
"""Blocks of the temperature: 3.6 s for 90 minutes, well under a winding's time constant."""

NUM_LAGS = 14
SHORTEST_LAG_S = 3.0
LONGEST_LAG_SHARE = 3.0
"""The bank spans from a bare thermocouple on a thin winding to three times the test [1]; neighbours
differ by less than a factor of two, closer than two lags of a sum can be told apart."""

APART = 2.5
"""Ratio of slow to fast lag from which their columns differ enough to be solved for [1]."""

HEATED = ((True, True), (True, False))
"""What a fit may be made of beside a constant: heat, and decays of what went before."""


@dataclass(frozen=True)
class Heats:
    """What the drive logged, on an even grid of its own clock."""

    start_s: float  # First sample [s].
    step_s: float  # Distance of samples [s].
    values: np.ndarray  # Heats, each scaled to a peak of about one [1], shape (heat, time).
    is_off_before: bool  # The log begins with the load, so that before it nothing flowed.
    is_off_after: bool  # The log ends at rest, so that after it nothing flows.

    @property
    def end_s(self) -> float:
        """Last sample [s]."""
        return self.start_s + self.step_s * (self.values.shape[1] - 1)


@dataclass(frozen=True)
class Whitening:
    """What makes the residuals of a regression independent."""

    coefficients: np.ndarray  # Autoregression as a filter, shape (order + 1,).
    # Decorrelates the first samples, that have no history, shape (order, order). Left out, a misfit
    # of any size at the start would cost nothing.
    start: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return values whitened along the first axis, in their shape."""
        order = self.start.shape[0]
        last = values.shape[0]
        later = values[order:].copy()
        for lag, coefficient in enumerate(self.coefficients[1:], start=1):
            later += coefficient * values[order - lag : last - lag]
        return np.concatenate([self.start @ values[:order], later])


@dataclass(frozen=True)
class Response:
    """Block means of one temperature, and the lagged heats to regress them on.

    The winding of any network of resistances and capacities answers heat as a sum of first-order
    lags. The temperature is regressed on the heats after a fast and a slow lag, looked up over a
    bank of time constants, plus a constant and the decay of whatever went before. The lagged heats
    are integrated once on the drive's fine grid; an offset then only reads them elsewhere, far
    below the spacing of the temperatures.
    """

    middle_s: np.ndarray  # Mean time of each block on the thermometer's clock [s], shape (blocks,).
    mean_degC: np.ndarray  # Mean temperature of each block [degC], shape (blocks,).
    width_s: float  # Width of a block [s].
    heats: Heats  # What the drive logged.
    lags_s: np.ndarray  # Bank of time constants [s], shape (lag,).
    # Integral over time of each heat after each lag [s], shape (lag * heat, time).
    areas: np.ndarray
    pairs: np.ndarray  # Fast and slow lag of each pair, as places in the bank, shape (pair, 2).

    def columns(self, offset_s: float, rate: float = 1.0) -> np.ndarray:
        """Return all regressors, shape (blocks, lag * heat + lag + 1), at an offset [s] that is
        added to the drive's clock, and a rate in seconds of the thermometer per second of the drive
        [1].
        """
        begin = self.middle_s - offset_s - 0.5 * self.width_s - self.heats.start_s
        position = np.stack([begin, begin + self.width_s]) / (rate * self.heats.step_s)
        last = self.areas.shape[1] - 1
        position = np.clip(position, 0.0, last)
        below = np.minimum(position.astype(int), last - 1)
        share = position - below
        area = self.areas[:, below] * (1.0 - share) + self.areas[:, below + 1] * share
        lagged = (area[:, 1] - area[:, 0]) / self.width_s
        decays = np.exp(-(self.middle_s - self.middle_s[0])[:, None] / self.lags_s)
        return np.hstack([lagged.T, decays, np.ones((self.middle_s.size, 1))])

    def fit(self, columns: np.ndarray, whitening: Whitening, *, without_heat: bool = False) -> Fit:
        """Regress the temperature on the pair of lags of `columns` with the least whitened squares.

        Without the drive's heat it is a base to compare with.
        """
        level = float(np.mean(self.mean_degC))
        X, y = whitening(columns), whitening(self.mean_degC - level)
        G, c, total = X.T @ X, X.T @ y, float(y @ y)
        least, used, gain = np.inf, np.empty(0, dtype=int), np.empty(0)
        unheated = ((False, True), (False, False))
        for has_heat, has_decay in unheated if without_heat else (*HEATED, *unheated):
            chosen = self._chosen(has_heat, has_decay)
            found = solved(
                G[chosen[:, :, None], chosen[:, None, :]], c[chosen], np.full(len(chosen), total)
            )
            possible = self._is_possible(found.solution, has_heat, has_decay)
            squares = np.where(possible, found.squares, np.inf)
            best = int(np.argmin(squares))
            if squares[best] < least:
                least, used, gain = float(squares[best]), chosen[best], found.solution[best]
        residual = self.mean_degC - level - columns[:, used] @ gain
        return Fit(max(least, 1e-300), residual, used, gain)

    def _chosen(self, has_heat: bool, has_decay: bool) -> np.ndarray:
        """Columns that each pair of lags uses, shape (pair, gains)."""
        num_heats = self.heats.values.shape[0]
        fast, slow = self.pairs[:, :1], self.pairs[:, 1:]
        decay = self.lags_s.size * num_heats
        heat = np.arange(num_heats)
        parts = [np.full_like(fast, decay + self.lags_s.size)]
        if has_decay:
            parts = [decay + fast, decay + slow, *parts]
        if has_heat:
            parts = [fast * num_heats + heat, slow * num_heats + heat, *parts]
        return np.hstack(parts)

    def _is_possible(self, gains: np.ndarray, has_heat: bool, has_decay: bool) -> np.ndarray:
        """Which pairs warm under the load, and cool without one, all the time, shape (pair,).

        A sum of two exponentials moves one way throughout if it does so at first and at last. This
        leaves room for the delay of a sensor, not for a winding that warms on after the load has
        gone. Decays are free where a load may have gone before.
        """
        num_heats = self.heats.values.shape[0]
        possible = np.ones(gains.shape[0], dtype=bool)
        load = np.mean(self.heats.values, axis=1)
        parts = []
        if has_heat:
            halves = gains[:, :num_heats], gains[:, num_heats : 2 * num_heats]
            parts.append([half @ load for half in halves])
        if has_decay and self.heats.is_off_before:
            parts.append([gains[:, -3], gains[:, -2]])
        for fast, slow in parts:
            lags = self.lags_s[self.pairs]
            possible &= (slow >= 0.0) & (fast / lags[:, 0] + slow / lags[:, 1] >= 0.0)
        return possible


@dataclass(frozen=True)
class Fit:
    """A regression at one offset."""

    squares: float  # Least sum of whitened squares [K^2].
    residual_K: np.ndarray  # Residuals before whitening [K], shape (blocks,).
    used: np.ndarray  # Columns of the best pair of lags, shape (gains,).
    gain: np.ndarray  # Their gains [K], shape (gains,).


def prepare_response(
    time_s: np.ndarray, temperature_degC: np.ndarray, heats: Heats, max_offset_s: float
) -> Response:
    """Reduce a temperature [degC] over time [s] to blocks, and integrate the lagged heats.

    Blocks that lack the drive at any offset up to the largest [s], in both directions, are left
    out, or the fits could not be compared: where the logs overlap too little none is left.
    """
    duration_s = float(time_s[-1] - time_s[0])
    width_s = max(float(np.median(np.diff(time_s))), duration_s / MAX_BLOCKS)
    block = np.floor((time_s - time_s[0]) / width_s + 1e-6)
    first = np.concatenate(([0], np.flatnonzero(np.diff(block)) + 1))
    counts = np.diff(np.append(first, time_s.size))
    middle = np.add.reduceat(time_s, first) / counts
    mean = np.add.reduceat(temperature_degC, first) / counts
    margin_s = max_offset_s + width_s
    from_s = -np.inf if heats.is_off_before else heats.start_s + margin_s
    to_s = np.inf if heats.is_off_after else heats.end_s - margin_s
    used = (middle >= from_s) & (middle <= to_s)
    lags_s = np.geomspace(SHORTEST_LAG_S, LONGEST_LAG_SHARE * duration_s, NUM_LAGS)
    pairs = np.argwhere(lags_s[None, :] >= APART * lags_s[:, None])
    # After a log that ends at rest the lags still decay, as far as a block may lie.
    reach_s = time_s[-1] + margin_s - heats.end_s if heats.is_off_after else 0.0
    values = np.pad(heats.values, ((0, 0), (0, max(int(1.5 * reach_s / heats.step_s), 0) + 2)))
    return Response(
        middle[used],
        mean[used],
        width_s,
        heats,
        lags_s,
        _lagged_areas(values, heats.step_s, lags_s),
        pairs,
    )


def _lagged_areas(values: np.ndarray, step_s: float, lags_s: np.ndarray) -> np.ndarray:
    areas = []
    means = 0.5 * (values + np.pad(values[:, :-1], ((0, 0), (1, 0))))
    for lag in lags_s:
        lagged = first_order(means, float(np.exp(-step_s / lag)))
        middle = 0.5 * step_s * (lagged[:, 1:] + lagged[:, :-1])
        areas.append(np.pad(np.cumsum(middle, axis=1), ((0, 0), (1, 0))))
    return np.concatenate(areas)


ORDER = 4
"""An Ornstein-Uhlenbeck process plus white and rounding noise, as a short autoregression [1]."""

COARSE_S = 1.0
"""The response is smooth over the shortest lag of 3 s: no peak hides between steps of 1 s."""

FALLEN = 12.0
"""A log likelihood this far below the peak holds under a 1e-5 of its probability."""

NUM_TRIED, ENOUGH = 61, 0.4
"""Offsets tried across a range, and the share of them [1] that must carry likelihood, so that its
width is resolved; until then the range is drawn closer to where the likelihood is."""

NUM_UNKNOWN = 9
"""Gains of up to two heats after two lags, two decays, the constant, and the two lags [1]."""

LUMP_S = 60.0
"""Errors of a 1 degC reading stay together for up to a minute; slopes are summed over as much."""

RATES = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3)
RATE_STEP_S = 3.0
RATE_BLOCKS = 200
"""Clock rates tried. Quartz is good to 1e-4; a rate off by per cents means rows that were lost."""

PLAIN = Whitening(np.eye(1, ORDER + 1)[0], np.eye(ORDER))
"""Leaves residuals as they are."""


@dataclass(frozen=True)
class OffsetProfile:
    """The likelihood of an offset where it is not negligible, under a flat prior."""

    offset_s: np.ndarray  # Offsets, increasing [s], shape (tried,).
    log_likelihood: np.ndarray  # Relative to the best, shape (tried,).
    is_at_edge: bool  # The likelihood reaches the end of the range that was searched.

    @property
    def mean_s(self) -> float:
        """Mean of the offset [s]."""
        return float(self._mass() @ self.offset_s)

    @property
    def sd_s(self) -> float:
        """Standard deviation of the offset [s]."""
        return float(np.sqrt(self._mass() @ (self.offset_s - self.mean_s) ** 2))

    def _mass(self) -> np.ndarray:
        mass = np.exp(self.log_likelihood)
        return mass / mass.sum()


def search_offset(log_likelihood: Callable[[float], float], offset_s: np.ndarray) -> OffsetProfile:
    """Search for an offset of two clocks, closer and closer to where its log likelihood is highest.

    The offsets that are tried first increase [s], and are fine enough to show each peak.
    """
    is_at_edge: bool | None = None
    while True:
        values = np.array([log_likelihood(float(one)) for one in offset_s])
        values -= np.max(values)
        near = np.flatnonzero(values > -FALLEN)
        first, last = max(int(near[0]) - 1, 0), min(int(near[-1]) + 1, values.size - 1)
        if is_at_edge is None:
            is_at_edge = bool(near[0] == 0 or near[-1] == values.size - 1)
        if last - first > ENOUGH * NUM_TRIED:
            return OffsetProfile(offset_s, values, is_at_edge)
        offset_s = np.linspace(offset_s[first], offset_s[last], NUM_TRIED)


def stamp_sd_s(step_s: float, other_s: float) -> float:
    """Return the standard uncertainty [s] of the stamps of two loggers against each other.

    A stamp may mark the beginning, middle or end of its interval: uniform over one step each.
    """
    return float(np.hypot(step_s, other_s)) / float(np.sqrt(12.0))


@dataclass(frozen=True)
class ResponseOffset:
    """The offset at which the winding answers the drive."""

    profile: OffsetProfile  # Its likelihood.
    # Share of the temperature's variance that the drive's heat explains beyond constant and decays
    # [1].
    explained: float
    gain: float  # Log likelihood over that of a drive without influence.
    num_effective: float  # Independent samples that the likelihood counts [1].


def offset_of_response(response: Response, max_offset_s: float) -> ResponseOffset:
    """Search the offset of the drive's clock in both directions up to a limit [s]."""
    coarse = np.arange(-max_offset_s, max_offset_s + 0.5 * COARSE_S, COARSE_S)
    regressors = [response.columns(float(offset)) for offset in coarse]
    whitening, best, at = PLAIN, None, 0
    # The autoregression moves the best offset, and that the residuals it comes from: twice.
    for _ in range(3):
        whitening = PLAIN if best is None else autoregression(best.residual_K)
        fits = [response.fit(X, whitening) for X in regressors]
        at = int(np.argmin([fit.squares for fit in fits]))
        best = fits[at]
    num_effective = _effective(response, float(coarse[at]), whitening)

    def log_likelihood(offset_s: float) -> float:
        return -0.5 * num_effective * float(np.log(fit_at(offset_s).squares))

    def fit_at(offset_s: float, whitening: Whitening = whitening, **options: bool) -> Fit:
        return response.fit(response.columns(offset_s), whitening, **options)

    profile = search_offset(log_likelihood, coarse)
    likeliest = float(profile.offset_s[np.argmax(profile.log_likelihood)])
    unheated = fit_at(likeliest, without_heat=True).squares
    plain, plain_unheated = (fit_at(likeliest, PLAIN, without_heat=no) for no in (False, True))
    return ResponseOffset(
        profile,
        explained=1.0 - plain.squares / plain_unheated.squares,
        gain=0.5 * num_effective * float(np.log(unheated / fit_at(likeliest).squares)),
        num_effective=num_effective,
    )


def best_rate(response: Response, max_offset_s: float) -> tuple[float, float]:
    """Return the clock rate that fits best, and its log likelihood over that of equal clocks.

    The rate, seconds of the thermometer per second of the drive [1], is chosen by plain squares,
    and both are then judged with the noise that the better one leaves: the misfit of a wrong rate
    would pass as noise of its own. It is 1 with a gain of 0 where no other fits better.
    """
    offsets = np.arange(-max_offset_s, max_offset_s + 0.5 * RATE_STEP_S, RATE_STEP_S)

    def best_fit(response: Response, rate: float, whitening: Whitening) -> Fit:
        fits = (response.fit(response.columns(float(x), rate), whitening) for x in offsets)
        return min(fits, key=lambda fit: fit.squares)

    # Plain squares need no neighbours, so every few blocks are enough to choose by.
    few = slice(None, None, max(response.middle_s.size // RATE_BLOCKS, 1))
    thin = replace(response, middle_s=response.middle_s[few], mean_degC=response.mean_degC[few])
    rate = min((1.0, *RATES), key=lambda rate: best_fit(thin, rate, PLAIN).squares)
    if rate == 1.0:
        return 1.0, 0.0
    whitening = autoregression(best_fit(response, rate, PLAIN).residual_K)
    other, equal = best_fit(response, rate, whitening), best_fit(response, 1.0, whitening)
    white = whitening(other.residual_K)
    num_effective = (white.size - NUM_UNKNOWN) / correlation(white)
    gain = 0.5 * num_effective * float(np.log(equal.squares / other.squares))
    return (rate, gain) if gain > 0.0 else (1.0, 0.0)


def _effective(response: Response, offset_s: float, whitening: Whitening) -> float:
    """Independent samples that the likelihood may count."""
    fit = response.fit(response.columns(offset_s), whitening)
    white = whitening(fit.residual_K)
    num_free = white.size - NUM_UNKNOWN
    # How the fitted temperature moves with the offset, beyond what the gains could make up for.
    apart_s = 0.1 * COARSE_S
    after, before = response.columns(offset_s + apart_s), response.columns(offset_s - apart_s)
    moves = (after - before)[:, fit.used] @ fit.gain / (2.0 * apart_s)
    X = whitening(response.columns(offset_s)[:, fit.used])
    moves = whitening(moves)
    moves = moves - X @ np.linalg.lstsq(X, moves, rcond=1e-10)[0]
    information = float(np.mean(white**2) * np.sum(moves**2))
    size = max(1, round(LUMP_S / response.width_s))
    slopes = np.add.reduceat(moves * white, np.arange(0, white.size, size))
    lumps = float(np.sum((slopes - np.mean(slopes)) ** 2))
    dilution = lumps / information if information > 0.0 else 1.0
    return num_free / max(correlation(white), dilution, 1.0)


def autoregression(residual: np.ndarray) -> Whitening:
    """Return what whitens a residual, by the Yule-Walker equations."""
    centred = residual - np.mean(residual)
    covariance = np.array(
        [float(centred[lag:] @ centred[: centred.size - lag]) for lag in range(ORDER + 1)]
    )
    if not covariance[0] > 0.0:
        return PLAIN
    lags = np.arange(ORDER)
    matrix = covariance[np.abs(lags[:, None] - lags)] + 1e-9 * covariance[0] * np.eye(ORDER)
    weights = np.linalg.solve(matrix, covariance[1:])
    innovation = max(float(covariance[0] - weights @ covariance[1:]), 1e-9 * covariance[0])
    start = np.sqrt(innovation) * np.linalg.inv(np.linalg.cholesky(matrix))
    return Whitening(np.concatenate(([1.0], -weights)), start)


def correlation(residual: np.ndarray) -> float:
    """Return how many neighbouring residuals count as one [1], at least 1.

    The sum of the autocorrelation up to the first lag that is five times it (Sokal's window).
    """
    centred = residual - np.mean(residual)
    spectrum = np.abs(np.fft.rfft(centred, 2 * centred.size)) ** 2
    covariance = np.fft.irfft(spectrum)[: max(centred.size // 2, 1)]
    if not covariance[0] > 0.0:
        return 1.0
    time = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    window = np.arange(time.size) >= 5.0 * time
    return max(1.0, float(time[np.argmax(window)] if window.any() else time[-1]))
