"""Is anything wrong? What the whitened residuals say about a model that should leave only noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

WINDOWS_S = (300.0, 600.0, 1200.0)
"""Windows over which whitened residuals are averaged [s]: ten minutes, halved and doubled; at most
a third of the test, so that a test of minutes is looked at too."""

FLAG = 2.2
"""Excess from which on a model counts as inadequate: it flagged 8 of 8 unknown causes and 2 of 32
known ones on simulated motors."""


def low_frequency_excess(
    innovations: Sequence[np.ndarray], block_s: Sequence[float]
) -> tuple[float, bool]:
    """Return the mean squared normalised window mean of whitened residuals, and if it is flagged.

    The sum of n white residuals has variance n; a slow misfit makes it grow with n^2. Of the
    windows, the one with the largest excess counts.

    Args:
        innovations: Whitened residuals of each test, observed blocks only [1].
        block_s: Length of a block of each test [s].

    Returns:
        The excess [1], 1 if white, and whether it is above both `FLAG` and the 99.9 % quantile
        that white residuals would have in as many windows.
    """
    worst, is_flagged = 0.0, False
    for window_s in WINDOWS_S:
        squares = []
        for values, length in zip(innovations, block_s, strict=True):
            size = max(2, min(round(window_s / length), values.size // 3))
            num = values.size // size
            if num >= 3:
                sums = values[: num * size].reshape(num, size).sum(axis=1)
                squares.append(sums**2 / size)
        if not squares:
            continue
        joined = np.concatenate(squares)
        excess = float(np.mean(joined))
        limit = max(FLAG, float(chi2.ppf(0.999, joined.size)) / joined.size)
        worst = max(worst, excess)
        is_flagged = is_flagged or excess > limit
    return worst, is_flagged


def ljung_box(innovations: np.ndarray, num_lags: int = 10) -> float:
    """Return the p-value that whitened residuals of one test are white [1].

    Reference: G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models,
        Biometrika 65 (1978) 297-303.
    """
    num = innovations.size
    num_lags = min(num_lags, max(1, num // 5))
    centred = innovations - innovations.mean()
    power = float(np.sum(centred**2))
    if num < 8 or power == 0.0:
        return 1.0
    lags = np.arange(1, num_lags + 1)
    correlation = np.array([np.sum(centred[lag:] * centred[:-lag]) / power for lag in lags])
    statistic = num * (num + 2) * np.sum(correlation**2 / (num - lags))
    return float(chi2.sf(statistic, num_lags))
