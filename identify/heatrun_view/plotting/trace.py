"""One signal of a test, and as much of it as a plot can show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from tsdownsample import MinMaxLTTBDownsampler

from heatrun.bench.channels.schema import CHANNEL
from heatrun.io.quantities import printed_unit

GAP = 5.0
"""Steps without a reading, in medians of the signal's own step, that break the line."""

MARGIN = 0.25
"""Share of the window that is sent on each side of it, so that a pan does not show an edge."""


@dataclass(frozen=True)
class Trace:
    """The readings of one channel in order of time.

    Attributes:
        test: Name of the test.
        channel: Canonical channel, or the name of a column that is none.
        time_s: Times with a reading, ascending [s], shape (reading,).
        value: Readings in the unit, shape (reading,).
        step_s: Median step between readings [s].
        unit: Unit of the readings.
    """

    test: str
    channel: str
    time_s: np.ndarray
    value: np.ndarray
    step_s: float
    unit: str

    @property
    def printed_unit(self) -> str:
        """The unit as it is written on the page."""
        return printed_unit(self.unit)

    @property
    def name(self) -> str:
        """The signal as it is written on the page."""
        if self.channel not in CHANNEL:
            return self.channel
        return self.channel.removesuffix("_" + self.unit).replace("_", " ")

    @classmethod
    def of(
        cls,
        test: str,
        channel: str,
        time_s: np.ndarray,
        value: np.ndarray,
        unit: str | None = None,
    ) -> Trace:
        """Take a channel of a record; samples that the file does not have are left out.

        Args:
            test: Name of the test.
            channel: Canonical channel, or the name of a column that is none.
            time_s: Time of each sample [s], shape (time,); put in order where it runs backwards.
            value: Reading of each sample, NaN where there is none, shape (time,).
            unit: Unit of a column that is no channel.
        """
        is_read = np.isfinite(value) & np.isfinite(time_s)
        if not is_read.all():
            time_s, value = time_s[is_read], value[is_read]
        steps = np.diff(time_s)
        if steps.size and steps.min() < 0.0:
            order = np.argsort(time_s, kind="stable")
            time_s, value = time_s[order], value[order]
            steps = np.diff(time_s)
        step = float(np.median(steps)) if steps.size else 0.0
        time_s, value = np.ascontiguousarray(time_s), np.ascontiguousarray(value)
        return cls(
            test, channel, time_s, value, step, CHANNEL[channel].unit if unit is None else unit
        )

    def at(self, time_s: float) -> float:
        """Return the reading nearest to a time; NaN where there is none within a usual step.

        Args:
            time_s: The time [s].
        """
        behind = int(np.searchsorted(self.time_s, time_s))
        near = [i for i in (behind - 1, behind) if 0 <= i < self.time_s.size]
        if not near:
            return float("nan")
        best = min(near, key=lambda i: abs(float(self.time_s[i]) - time_s))
        is_near = abs(float(self.time_s[best]) - time_s) <= max(GAP * self.step_s, 1e-9)
        return float(self.value[best]) if is_near else float("nan")

    def window(self, start: float, end: float, num_points: int) -> tuple[np.ndarray, np.ndarray]:
        """Return what a plot of a time window shows.

        Every reading where there are no more than `num_points`; else the least and the greatest
        of each stretch, thinned to the points that keep the shape (MinMaxLTTB, Van Der Donckt et
        al. 2023), each of them a reading of the file. NaN stands in every gap.

        Args:
            start: Begin of the window [s].
            end: End of the window [s].
            num_points: Points for the window itself.

        Returns:
            Times [s] and values, with a margin on both sides of the window.
        """
        margin = MARGIN * (end - start)
        first, last = np.searchsorted(self.time_s, [start - margin, end + margin])
        chosen = slice(max(int(first) - 1, 0), int(last) + 1)
        t, v = self.time_s[chosen], self.value[chosen]
        wanted = int(num_points * (1.0 + 2.0 * MARGIN))
        is_thin = t.size > wanted
        if is_thin:
            kept = MinMaxLTTBDownsampler().downsample(t, v, n_out=wanted)
            is_gap = self._gap_between(t, kept)
            t, v = t[kept], v[kept]
        else:
            is_gap = np.diff(t) > GAP * self.step_s
        where = np.flatnonzero(is_gap) + 1
        return np.insert(t, where, t[where - 1]), np.insert(v, where, np.nan)

    def _gap_between(self, t: np.ndarray, kept: np.ndarray) -> np.ndarray:
        """Return whether a gap lies between each kept sample and the next."""
        num_gaps = np.concatenate([[0], np.cumsum(np.diff(t) > GAP * self.step_s)])
        return np.diff(num_gaps[kept]) > 0
