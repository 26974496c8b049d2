"""How the winding answers the drive's heat, as a linear regression at any offset of the two clocks.

The winding of any network of resistances and capacities answers heat as a sum of first-order lags.
The temperature is regressed on the heats after a fast and a slow lag, looked up over a bank of time
constants, plus a constant and the decay of whatever went before. The lagged heats are integrated
once on the drive's fine grid; an offset then only reads them elsewhere, far below the spacing of
the temperatures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

MAX_BLOCKS = 1500
"""Blocks of the temperature: 3.6 s for 90 minutes, well under a winding's time constant."""

NUM_LAGS = 14
SHORTEST_LAG_S = 3.0
LONGEST_LAG_SHARE = 3.0
"""The bank spans from a bare thermocouple on a thin winding to three times the test [1]; neighbours
differ by less than a factor of two, closer than two lags of a sum can be told apart."""

APART = 2.5
"""Ratio of slow to fast lag from which their columns differ enough to be solved for [1]."""

RIDGE = 1e-12
"""Share of the square of a column [1] that keeps lags beyond the test, nearly the same column,
solvable; it shifts no gain that the record determines."""


@dataclass(frozen=True)
class Heats:
    """What the drive logged, on an even grid of its own clock.

    Attributes:
        start_s: First sample [s].
        step_s: Distance of samples [s].
        values: Heats, each scaled to a peak of about one [1], shape (heat, time).
        is_off_before: The log begins with the load, so that before it nothing flowed.
        is_off_after: The log ends at rest, so that after it nothing flows.
    """

    start_s: float
    step_s: float
    values: np.ndarray
    is_off_before: bool
    is_off_after: bool

    @property
    def end_s(self) -> float:
        """Last sample [s]."""
        return self.start_s + self.step_s * (self.values.shape[1] - 1)


@dataclass(frozen=True)
class Whitening:
    """What makes the residuals of a regression independent.

    Attributes:
        coefficients: Autoregression as a filter, shape (order + 1,).
        start: Decorrelates the first samples, that have no history, shape (order, order). Left out,
            a misfit of any size at the start would cost nothing.
    """

    coefficients: np.ndarray
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

    Attributes:
        middle_s: Mean time of each block on the thermometer's clock [s], shape (blocks,).
        mean_degC: Mean temperature of each block [degC], shape (blocks,).
        width_s: Width of a block [s].
        heats: What the drive logged.
        lags_s: Bank of time constants [s], shape (lag,).
        areas: Integral over time of each heat after each lag [s], shape (lag * heat, time).
        pairs: Fast and slow lag of each pair, as places in the bank, shape (pair, 2).
    """

    middle_s: np.ndarray
    mean_degC: np.ndarray
    width_s: float
    heats: Heats
    lags_s: np.ndarray
    areas: np.ndarray
    pairs: np.ndarray

    def columns(self, offset_s: float, rate: float = 1.0) -> np.ndarray:
        """Return all regressors at an offset, shape (blocks, lag * heat + lag + 1).

        Args:
            offset_s: What is added to the drive's clock to give the thermometer's [s].
            rate: Seconds of the thermometer per second of the drive [1].
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
        """Regress the temperature on the best pair of lags.

        Args:
            columns: From `columns`, shape (blocks, regressors).
            whitening: What makes the residuals independent.
            without_heat: Leave the drive out, as a base to compare with.

        Returns:
            The fit with the least sum of whitened squares.
        """
        level = float(np.mean(self.mean_degC))
        X, y = whitening(columns), whitening(self.mean_degC - level)
        # After whitening the sizes of fast and slow columns are many decades apart.
        scale = np.maximum(np.sqrt(np.sum(X**2, axis=0)), 1e-30)
        X = X / scale
        G, c, total = X.T @ X, X.T @ y, float(y @ y)
        least, used, gain = np.inf, np.empty(0, dtype=int), np.empty(0)
        for has_heat, has_decay in self._combinations(without_heat):
            chosen = self._chosen(has_heat, has_decay)
            G_pairs = G[chosen[:, :, None], chosen[:, None, :]]
            c_pairs = c[chosen]
            ridge = RIDGE * np.eye(chosen.shape[1])
            gains = np.linalg.solve(G_pairs + ridge, c_pairs[:, :, None])[:, :, 0]
            squares = total + np.sum(
                gains * (np.einsum("pij,pj->pi", G_pairs, gains) - 2.0 * c_pairs), axis=1
            )
            gains = gains / scale[chosen]
            squares = np.where(self._is_possible(gains, has_heat, has_decay), squares, np.inf)
            best = int(np.argmin(squares))
            if squares[best] < least:
                least, used, gain = float(squares[best]), chosen[best], gains[best]
        residual = self.mean_degC - level - columns[:, used] @ gain
        return Fit(max(least, 1e-300), residual, used, gain)

    def _combinations(self, without_heat: bool) -> tuple[tuple[bool, bool], ...]:
        """What a fit may be made of, as (heat, decays); a constant alone is always possible."""
        unheated = ((False, True), (False, False))
        return unheated if without_heat else ((True, True), (True, False), *unheated)

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
    """A regression at one offset.

    Attributes:
        squares: Least sum of whitened squares [K^2].
        residual_K: Residuals before whitening [K], shape (blocks,).
        used: Columns of the best pair of lags, shape (gains,).
        gain: Their gains [K], shape (gains,).
    """

    squares: float
    residual_K: np.ndarray
    used: np.ndarray
    gain: np.ndarray


def prepare_response(
    time_s: np.ndarray, temperature_degC: np.ndarray, heats: Heats, max_offset_s: float
) -> Response:
    """Reduce a temperature to blocks and integrate the lagged heats.

    Args:
        time_s: Increasing times on the thermometer's clock [s], shape (time,).
        temperature_degC: Winding temperature [degC], shape (time,).
        heats: What the drive logged.
        max_offset_s: Largest offset in both directions [s]; blocks that lack the drive at any of
            them are left out, or the fits could not be compared.

    Returns:
        The regression, with no block where the logs overlap too little.
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
    """Integrals of the lagged heats, lag by lag."""
    areas = []
    for lag in lags_s:
        decay = float(np.exp(-step_s / lag))
        lagged = np.asarray(lfilter([0.5 * (1.0 - decay)] * 2, [1.0, -decay], values, axis=1))
        middle = 0.5 * step_s * (lagged[:, 1:] + lagged[:, :-1])
        areas.append(np.pad(np.cumsum(middle, axis=1), ((0, 0), (1, 0))))
    return np.concatenate(areas)
