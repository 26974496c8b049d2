"""Errors before and after a discovery, as they stand in `discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass

from .values import Interval, NonNegative, Probability, Role


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """Errors over the calibration tests, with the base network and with the final model.

    Attributes:
        noise_floor_K: What noise alone would leave [K].
        rmse_before_K: Root mean square error before [K].
        max_before_K: Maximum absolute error before [K].
        coverage_95_before: Share of the readings inside the 95 % band before [1].
        rmse_after_K: Root mean square error after [K].
        max_after_K: Maximum absolute error after [K].
        coverage_95_after: Share of the readings inside the 95 % band after [1].
    """

    noise_floor_K: NonNegative
    rmse_before_K: NonNegative
    max_before_K: NonNegative
    coverage_95_before: Probability
    rmse_after_K: NonNegative
    max_after_K: NonNegative
    coverage_95_after: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutGap:
    """Errors over the held-out tests, and whether these decided about an effect.

    Attributes:
        noise_floor_K: As `Gap`.
        rmse_before_K: As `Gap`.
        max_before_K: As `Gap`.
        coverage_95_before: As `Gap`.
        rmse_after_K: As `Gap`.
        max_after_K: As `Gap`.
        coverage_95_after: As `Gap`.
        took_part_in_selection: Whether an effect was judged by its error on held-out tests.
        sentence: What this means.
    """

    noise_floor_K: NonNegative
    rmse_before_K: NonNegative
    max_before_K: NonNegative
    coverage_95_before: Probability
    rmse_after_K: NonNegative
    max_after_K: NonNegative
    coverage_95_after: Probability
    took_part_in_selection: bool
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsOnTest:
    """Errors on one test.

    Attributes:
        rmse_K: Root mean square error [K].
        max_K: Maximum absolute error [K].
        end_K: Mean error over the last blocks, measured minus predicted [K].
        coverage_95: Share of the readings inside the 95 % band [1].
    """

    rmse_K: NonNegative
    max_K: NonNegative
    end_K: float
    coverage_95: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsBeforeAfter:
    """A test before and after the discovery.

    Attributes:
        name: The test.
        role: Whether it was fitted or only predicted.
        before: With the base network.
        after: With the final model.
    """

    name: str
    role: Role
    before: ErrorsOnTest
    after: ErrorsOnTest


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueWithInterval:
    """A value with its interval.

    Attributes:
        value: Median of the posterior [unit].
        interval_95: 95 % interval [unit].
    """

    value: float
    interval_95: Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterBeforeAfter:
    """A parameter of the network before and after the discovery.

    Attributes:
        before: In the base network.
        after: In the final model.
        unit: Its unit.
        wrong_by: Value before over value after, minus 1 [1]; null if the latter is 0.
    """

    before: ValueWithInterval
    after: ValueWithInterval
    unit: str
    wrong_by: float | None
