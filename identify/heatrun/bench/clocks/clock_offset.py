"""Where on the thermometer's clock does the drive's clock start? A search by the motor's own
response.

For each offset the winding temperature is regressed on the lagged heats of the drive. The residuals
are whitened by a short autoregression, since neighbouring samples of a logger do not err
independently, and the profile of their sum of squares is the likelihood of the offset. How many
samples it may count is judged twice, and the smaller number holds: by the correlation that
whitening has left, and by how the contributions to the slope of the likelihood, which come in lumps
at the steps of the load, add up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .clock_response import Fit, Response, Whitening

ORDER = 4
"""An Ornstein-Uhlenbeck process plus white and rounding noise, as a short autoregression [1]."""

COARSE_S = 1.0
"""The response is smooth over the shortest lag of 3 s: no peak hides between steps of 1 s."""

FALLEN = 12.0
"""A log likelihood this far below the peak holds under a 1e-5 of its probability."""

NUM_FINE = 161
NUM_REFINEMENTS = 3
"""Each refinement narrows the grid to where the likelihood is, down to well under its width."""

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
    """The likelihood of the offset.

    Attributes:
        offset_s: Offsets of the last refinement, increasing [s], shape (tried,).
        log_likelihood: Relative to the best, shape (tried,).
        is_at_edge: The likelihood reaches the end of the range that was searched.
        explained: Share of the temperature's variance that the drive's heat explains beyond
            constant and decays [1].
        gain: Log likelihood over that of a drive without influence.
        num_effective: Independent samples that the likelihood counts [1].
        whitening: What made the residuals independent.
        residual_K: Residuals at the best offset [K], shape (blocks,).
    """

    offset_s: np.ndarray
    log_likelihood: np.ndarray
    is_at_edge: bool
    explained: float
    gain: float
    num_effective: float
    whitening: Whitening
    residual_K: np.ndarray

    @property
    def mean_s(self) -> float:
        """Mean of the offset under a flat prior [s]."""
        return float(self._mass() @ self.offset_s)

    @property
    def sd_s(self) -> float:
        """Standard deviation of the offset under a flat prior [s]."""
        return float(np.sqrt(self._mass() @ (self.offset_s - self.mean_s) ** 2))

    def _mass(self) -> np.ndarray:
        mass = np.exp(self.log_likelihood)
        return mass / mass.sum()


def search_offset(response: Response, max_offset_s: float) -> OffsetProfile:
    """Search the offset in both directions up to a limit.

    Args:
        response: The regression of the temperature on the drive.
        max_offset_s: Largest offset [s].

    Returns:
        The likelihood where it is not negligible.
    """
    coarse = np.arange(-max_offset_s, max_offset_s + 0.5 * COARSE_S, COARSE_S)
    regressors = [response.columns(float(offset)) for offset in coarse]
    whitening = PLAIN
    fits = [response.fit(X, whitening) for X in regressors]
    # The autoregression moves the best offset, and that the residuals it comes from: twice.
    for _ in range(2):
        best = min(fits, key=lambda fit: fit.squares)
        whitening = autoregression(best.residual_K)
        fits = [response.fit(X, whitening) for X in regressors]
    squares = np.array([fit.squares for fit in fits])
    best_coarse = int(np.argmin(squares))
    num_effective = _effective(
        response, float(coarse[best_coarse]), whitening, fits[best_coarse].residual_K
    )
    offsets, is_at_edge = coarse, False
    for _ in range(NUM_REFINEMENTS):
        likelihood = -0.5 * num_effective * np.log(squares / squares.min())
        near = np.flatnonzero(likelihood > -FALLEN)
        low = offsets[max(near[0] - 1, 0)]
        high = offsets[min(near[-1] + 1, offsets.size - 1)]
        is_at_edge |= bool(near[0] == 0 or near[-1] == offsets.size - 1) and offsets is coarse
        offsets = np.linspace(low, high, NUM_FINE)
        fits = [response.fit(response.columns(float(x)), whitening) for x in offsets]
        squares = np.array([fit.squares for fit in fits])
    best = int(np.argmin(squares))
    columns = response.columns(float(offsets[best]))
    unheated = response.fit(columns, PLAIN, without_heat=True)
    return OffsetProfile(
        offset_s=offsets,
        log_likelihood=-0.5 * num_effective * np.log(squares / squares.min()),
        is_at_edge=is_at_edge,
        explained=1.0 - response.fit(columns, PLAIN).squares / unheated.squares,
        gain=0.5
        * num_effective
        * float(
            np.log(response.fit(columns, whitening, without_heat=True).squares / squares.min())
        ),
        num_effective=num_effective,
        whitening=whitening,
        residual_K=fits[best].residual_K,
    )


def best_rate(response: Response, max_offset_s: float) -> tuple[float, float]:
    """Return the clock rate that fits best, and its log likelihood over that of equal clocks.

    The rate is chosen by plain squares, and both are then judged with the noise that the better one
    leaves: the misfit of a wrong rate would pass as noise of its own.

    Args:
        response: The regression of the temperature on the drive.
        max_offset_s: Largest offset [s].

    Returns:
        Seconds of the thermometer per second of the drive [1], and the gain; a rate of 1 and a gain
        of 0 where no other rate fits better.
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


def _effective(
    response: Response, offset_s: float, whitening: Whitening, residual_K: np.ndarray
) -> float:
    """Independent samples that the likelihood may count."""
    white = whitening(residual_K)
    num_free = white.size - NUM_UNKNOWN
    fit = response.fit(response.columns(offset_s), whitening)
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
