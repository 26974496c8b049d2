"""Integrals over a record's own time axis, by sign, with gaps left out and counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.bench.checks.samples import median_step
from heatrun.bench.checks.time_axis import GAP_STEPS


@dataclass(frozen=True)
class Integral:
    """An integral over time, its parts above and below zero apart.

    Attributes:
        positive: Integral of the part above zero [unit of the values times s].
        negative: Integral of the part below zero, not above 0 [the same].
        covered_s: Time that was integrated over [s].
        left_out_s: Time in gaps, which was not [s].
        num_gaps: Number of gaps.
    """

    positive: float
    negative: float
    covered_s: float
    left_out_s: float
    num_gaps: int

    @property
    def net(self) -> float:
        """The integral itself."""
        return self.positive + self.negative

    @property
    def absolute(self) -> float:
        """The integral of the magnitude."""
        return self.positive - self.negative


def bridged_steps(time_s: Float[np.ndarray, " time"]) -> Float[np.ndarray, " step"]:
    """Return the steps of a time axis [s], those across a gap as 0.

    Args:
        time_s: Increasing times [s].
    """
    steps = np.diff(time_s)
    return np.where(steps <= GAP_STEPS * median_step(time_s), steps, 0.0)


def integrate(time_s: Float[np.ndarray, " time"], values: Float[np.ndarray, " time"]) -> Integral:
    r"""Return the trapezoidal integral of samples over their own time axis, by sign.

    $$ \int x\,dt = \sum_i \tfrac12 (x_i + x_{i+1})(t_{i+1} - t_i) $$

    Between two samples of different sign the straight line's zero is one more point, so that the
    part above zero is not counted too high. A step above three usual ones is a gap: nothing is
    known of the values in it, so it adds nothing, and its length is returned.

    Args:
        time_s: Increasing times [s].
        values: In any unit.
    """
    steps = np.diff(time_s)
    bridged = bridged_steps(time_s)
    start, end = values[:-1], values[1:]
    span = np.abs(start) + np.abs(end)
    crosses = start * end < 0.0
    at_crossing = np.maximum(start, end) ** 2 / (2.0 * np.where(crosses, span, 1.0))
    mean = 0.5 * (start + end)
    above = np.where(crosses, at_crossing, np.maximum(mean, 0.0))
    return Integral(
        positive=float(np.sum(above * bridged)),
        negative=float(np.sum((mean - above) * bridged)),
        covered_s=float(np.sum(bridged)),
        left_out_s=float(np.sum(steps[bridged == 0.0])),
        num_gaps=int(np.sum(bridged == 0.0)),
    )
