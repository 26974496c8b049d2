"""Two prototypes signal by signal: bias, spread, correlation, energy, verdict."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from heatrun.bench.channels.schema import CHANNELS

from ..card import NOT_OF_THE_MACHINE
from .general_information import J_PER_KWH
from .integrate import bridged_steps, integrate
from .pair import Pair
from .tolerances import Tolerance

Verdict = Literal["agrees", "biased", "differs", "input", "not comparable"]

ORDER = {channel.name: number for number, channel in enumerate(CHANNELS)}

INSIDE = 0.95
"""Share of the time that must lie inside the tolerance [1]: what a 95 % band would hold."""

VERDICTS: dict[Verdict, str] = {
    "agrees": "at least 95 % of the time inside the tolerance",
    "biased": "outside, and inside at least 95 % of the time once the bias is taken off",
    "differs": "outside also without the bias",
    "input": "drove the simulation, so that its agreement is no evidence",
    "not comparable": "no common sample",
}
"""What each verdict means."""


@dataclass(frozen=True)
class SignalComparison:
    """One signal of two prototypes; differences are test minus reference.

    Attributes:
        channel: The signal.
        compared_s: Time over which both are known [s].
        bias: Mean difference, weighted by time [unit of the channel, K for temperatures].
        rmse: Root mean square of the difference [the same].
        largest: Largest difference by magnitude, with its sign [the same].
        largest_at_s: When, on the test's clock [s].
        correlation: Of the two courses [1]; None where either is constant.
        tolerance: What counts as agreement.
        share_inside: Share of the time inside the tolerance [1].
        share_in_band: Share of the time that the test lies in the reference's 95 % band [1]; None
            without a band.
        energy_kWh: Energy of test and reference over the compared time [kWh]; None for a signal
            that is no power.
        energy_difference_percent: Of the reference's energy [%]; None where that is none or 0.
        verdict: One of `VERDICTS`.
    """

    channel: str
    compared_s: float
    bias: float
    rmse: float
    largest: float
    largest_at_s: float
    correlation: float | None
    tolerance: Tolerance
    share_inside: float
    share_in_band: float | None
    energy_kWh: tuple[float, float] | None
    energy_difference_percent: float | None
    verdict: Verdict


def compare_signals(
    pair: Pair,
    tolerances: Mapping[str, Tolerance],
    bands: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
    inputs: Container[str] = (),
) -> tuple[SignalComparison, ...]:
    """Compare two prototypes signal by signal.

    Args:
        pair: Both on one axis.
        tolerances: By channel.
        bands: Lower and upper 95 % limit of the reference by channel, shape (common,) each.
        inputs: Channels of the test that drove the reference.

    Returns:
        One comparison for each shared signal, in the order of `place`.
    """
    limits = bands or {}
    return tuple(
        replace(row, verdict="input") if row.channel in inputs else row
        for row in (
            _compare(pair, name, tolerances[name], limits.get(name))
            for name in sorted(pair.ours, key=place)
        )
    )


def place(channel: str) -> tuple[int, int]:
    """Return where a signal stands: temperatures of the machine first, of what is about it last.

    Args:
        channel: Name of the channel.
    """
    number = ORDER.get(channel, len(ORDER))
    if channel in NOT_OF_THE_MACHINE:
        return 2, number
    return int(not channel.endswith("_degC")), number


def _compare(
    pair: Pair,
    channel: str,
    tolerance: Tolerance,
    band: tuple[np.ndarray, np.ndarray] | None,
) -> SignalComparison:
    ours, theirs = pair.ours[channel], pair.theirs[channel]
    known = np.isfinite(ours) & np.isfinite(theirs)
    if np.sum(known) < 2:
        nan = float("nan")
        return SignalComparison(channel, 0.0, nan, nan, nan, nan, None, tolerance, nan, None,
                                None, None, "not comparable")  # fmt: skip
    time_s, a, b = pair.time_s[known], ours[known], theirs[known]
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    weight = weight / np.sum(weight)
    difference = a - b
    bias = float(weight @ difference)
    share = float(weight @ (np.abs(difference) <= tolerance.value))
    unbiased = float(weight @ (np.abs(difference - bias) <= tolerance.value))
    worst = int(np.argmax(np.abs(difference)))
    in_band = None
    if band is not None:
        low, high = (limit[known] for limit in band)
        with_band = np.isfinite(low) & np.isfinite(high)
        if weight @ with_band > 0.0:
            in_band = float(weight @ ((a >= low) & (a <= high) & with_band) / (weight @ with_band))
    energy = change = None
    if channel.endswith("_W"):
        drawn, theirs = (integrate(time_s, values).net / J_PER_KWH for values in (a, b))
        energy = (drawn, theirs)
        change = 100.0 * (energy[0] - energy[1]) / abs(energy[1]) if energy[1] != 0.0 else None
    return SignalComparison(
        channel=channel,
        compared_s=float(np.sum(steps)),
        bias=bias,
        rmse=float(np.sqrt(weight @ difference**2)),
        largest=float(difference[worst]),
        largest_at_s=float(time_s[worst]),
        correlation=_correlation(a, b, weight),
        tolerance=tolerance,
        share_inside=share,
        share_in_band=in_band,
        energy_kWh=energy,
        energy_difference_percent=change,
        verdict="agrees" if share >= INSIDE else "biased" if unbiased >= INSIDE else "differs",
    )


def _correlation(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> float | None:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return None
    a, b = a - weight @ a, b - weight @ b
    return float(weight @ (a * b) / np.sqrt((weight @ a**2) * (weight @ b**2)))
