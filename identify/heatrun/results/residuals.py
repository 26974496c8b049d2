"""Errors of a network on one test, as they stand in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec import UNSET, UnsetType

from .values import NonNegative, Probability, Role


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualRow:
    """Error figures of one prediction, over the block means that were measured.

    Attributes:
        test: Name of the test.
        role: Whether it was fitted or only predicted.
        rmse_K: Root mean square error [K].
        mae_K: Mean absolute error [K].
        max_K: Maximum absolute error [K].
        end_K: Mean error over the last blocks, measured minus predicted [K].
        whiteness_p: Probability of such residuals if they were white [1], by Ljung and Box.
        coverage_95: Share of the readings inside the 95 % band [1].
        log_score: Mean log predictive density of a block [nat].
        log_score_se: Its standard error, which allows for neighbouring blocks that err alike
            [nat]; null for less than ten blocks, unset in files of earlier versions.
    """

    test: str
    role: Role
    rmse_K: NonNegative
    mae_K: NonNegative
    max_K: NonNegative
    end_K: float
    whiteness_p: Probability | None
    coverage_95: Probability
    log_score: float | None
    log_score_se: NonNegative | UnsetType | None = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyRow:
    """Error figures of one measured body beside the winding in one test.

    Attributes:
        test: Name of the test.
        role: Whether the test was fitted or only predicted.
        body: Channel of the body.
        node: The node that it is compared with.
        fitted: Whether the readings of this body took part in the fit, with the errors of their
            sensor; if not, they are held against the node's temperature.
        rmse_K: Root mean square error [K].
        mean_K: Mean error, measured minus predicted [K].
        max_K: Maximum absolute error [K].
        coverage_95: Share of the readings inside the 95 % band [1].
    """

    test: str
    role: Role
    body: str
    node: str
    fitted: bool
    rmse_K: NonNegative
    mean_K: float
    max_K: NonNegative
    coverage_95: Probability
