"""The noise of a test's logger: unlike loggers are not of one noise."""

from __future__ import annotations

from collections.abc import Mapping

from ..record.blocks import Blocks, Logger

Loggers = Mapping[Logger, float]
"""Noise of each logger over that of the first one [1]; empty where all tests share one noise."""


def scale_of(loggers: Loggers, logger: Logger) -> float:
    """Return the noise of a logger over that of the first one [1].

    One that the fit does not know is taken to be as noisy as the noisiest.
    """
    return loggers.get(logger, max(loggers.values(), default=1.0))


def scales_of(loggers: Loggers, test: Blocks) -> list[float]:
    """Return the noise of each sensor of a test over that of the first logger [1]."""
    return [scale_of(loggers, logger) for logger in test.loggers]
