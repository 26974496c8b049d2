"""Is what is left noise? Adequacy of a model, in statistics and in kelvin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects.engine import Engine, Refit
from ..effects.search import plain_noise
from ..inference.fitting.adequacy import low_frequency_excess
from ..inference.loggers import scales_of
from ..inference.networks.form import WINDING
from ..inference.noise import variance_of_mean
from .folds import rmse

WINDOW_S = 600.0
"""Window over which what is slow is looked at [s]."""

FEWEST_WINDOWS = 3
"""Windows that a test has at least [1]: in one shorter than half an hour they are shorter too."""

LONGEST_S = 75.0
"""Correlation time of the residuals from which on they count as a misfit [s]."""

RELEVANT_K = 0.08
"""A slow misfit below this is of no consequence on a bench [K]: instruments, lumping and the
loss balance leave as much."""

RELEVANT_SHARE = 0.5
"""And below this share of the noise of a block mean it cannot be told from it [1]."""

FORM_SHARE = 0.15
"""A law of the catalogue leaves about this share of an effect that it names rightly [1]: the
machine's own law has another exponent, a threshold, a lag."""


@dataclass(frozen=True)
class Adequacy:
    """What is left by a model.

    Attributes:
        excess: Mean squared normalised window mean of the whitened residuals [1]; 1 if white.
        is_excessive: Whether that is above its limit.
        correlation_s: Correlation time of the residuals, without a limit [s].
        misfit_K: Root mean square of what is slow, less what noise would leave [K].
        rmse_K: Root mean square of all residuals of the same fit, slow and fast [K].
        window_s: Length of the means that count as slow [s].
        noise_K: Standard deviation of the noise of a block mean [K].
        closed_K: Gap that the effects in the model have closed [K].
        channel: The sensor whose slow misfit is largest; misfit and error are its.
        winding_rmse_K: The error of the winding, where that of another sensor is told [K].
    """

    excess: float
    is_excessive: bool
    correlation_s: float
    misfit_K: float
    rmse_K: float
    window_s: float
    noise_K: float
    closed_K: float = 0.0
    channel: str = WINDING
    winding_rmse_K: float | None = None

    @property
    def words(self) -> str:
        """The misfit beside the whole error, as printed."""
        return (
            f"a slow misfit of {self.misfit_K:.2f} K (means over {self.window_s / 60.0:.0f} min, "
            f"less what noise leaves in them) in an RMSE of {self.rmse_K:.2f} K"
            + ("" if self.channel == WINDING else f" of {self.channel}")
        )

    @property
    def is_relevant(self) -> bool:
        """Whether the misfit is large enough to matter."""
        least = max(RELEVANT_K, RELEVANT_SHARE * self.noise_K, FORM_SHARE * self.closed_K)
        return self.misfit_K > least

    @property
    def is_adequate(self) -> bool:
        """Whether only noise is left, or nothing that matters."""
        return not ((self.is_excessive or self.correlation_s > LONGEST_S) and self.is_relevant)


def adequacy(engine: Engine, refit: Refit, closed_K: float = 0.0) -> Adequacy:
    """Return what a model leaves.

    Args:
        engine: The tests.
        refit: Its fit under the noise that the library's directions leave.
        closed_K: Gap that the effects in the model have closed [K].
    """
    noise = refit.noise
    innovations, lengths = [], []
    slow: dict[str, list[np.ndarray]] = {}
    expected: dict[str, list[np.ndarray]] = {}
    longest_s = 0.0
    whitened = engine.problem.split(engine.whiten(noise, refit.residual))
    raw = engine.problem.split(refit.residual)
    for values, residual, test in zip(whitened, raw, engine.tests, strict=True):
        window_s = min(WINDOW_S, test.duration_s / FEWEST_WINDOWS)
        size = max(2, round(window_s / test.block_s))
        longest_s = max(longest_s, size * test.block_s)
        scales = scales_of(engine.problem.loggers, test)
        by_sensor = (test.by_sensor(rows) for rows in (values, residual, test.is_observed))
        for channel, scale, white, rest, seen in zip(
            (WINDING, *test.fitted), scales, *by_sensor, strict=True
        ):
            innovations.append(white[seen])
            lengths.append(test.block_s)
            num = int(seen.sum()) // size
            if num:
                means = rest[seen][: num * size].reshape(num, size).mean(axis=1)
                slow.setdefault(channel, []).append(means)
                variance = variance_of_mean(noise.scaled(scale), test.block_s, size)
                expected.setdefault(channel, []).append(np.full(num, variance))
    excess, is_excessive = low_frequency_excess(innovations, lengths)
    plain = plain_noise(engine, refit)
    is_slow = float(plain.sd) > RELEVANT_SHARE * float(plain.total())
    misfit = {
        channel: float(np.mean(np.concatenate(slow[channel]) ** 2)
                       - np.mean(np.concatenate(expected[channel])))
        for channel in slow
    }  # fmt: skip
    worst = max(misfit, key=lambda channel: misfit[channel], default=WINDING)
    return Adequacy(
        excess=excess,
        is_excessive=is_excessive,
        correlation_s=float(plain.time) if is_slow else 0.0,
        misfit_K=float(np.sqrt(max(misfit.get(worst, 0.0), 0.0))),
        rmse_K=rmse(refit.residual[engine.sensors[worst]]),
        window_s=longest_s,
        noise_K=float(noise.total()),
        closed_K=closed_K,
        channel=worst,
        winding_rmse_K=rmse(refit.residual[engine.sensors[WINDING]]),
    )
