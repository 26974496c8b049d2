"""What a network misses, where and when, as it stands in `discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from .values import Count, Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingSpan:
    """A stretch of time in which something is missing.

    Attributes:
        test: Name of the test.
        from_s: Its begin [s].
        to_s: Its end [s].
        node: Node, or `"sensor"`.
        missing_W: Mean missing heat [W]; unset for the sensor.
        missing_K: Mean error of the reading [K]; unset for a node.
        interval_95: 95 % interval of the one that is set [W or K].
    """

    test: str
    from_s: float
    to_s: float
    node: str
    missing_W: float | UnsetType = UNSET
    missing_K: float | UnsetType = UNSET
    interval_95: Interval

    def __post_init__(self) -> None:
        if (self.missing_W is UNSET) == (self.missing_K is UNSET):
            raise ValueError("expected one of missing_W and missing_K")

    @property
    def missing(self) -> tuple[float, Literal["W", "K"]]:
        """What is missing, and its unit."""
        if self.missing_K is not UNSET:
            return self.missing_K, "K"
        assert self.missing_W is not UNSET
        return self.missing_W, "W"


Missing = Annotated[
    MissingSpan,
    Meta(extra_json_schema={"oneOf": [{"required": ["missing_W"]}, {"required": ["missing_K"]}]}),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingCourse:
    """What is missing at one node over one test.

    Attributes:
        test: Index of the calibration test, from 0.
        node: Node, or `"sensor"`.
        unit: W, or K for the sensor.
        time_s: Times of the knots [s].
        mean: What is missing at each knot [unit].
        sd: Its standard deviation [unit].
    """

    test: Count
    node: str
    unit: str
    time_s: tuple[float, ...]
    mean: tuple[float, ...]
    sd: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalisedMisfit:
    """Where a model lacks heat or reads wrongly.

    Attributes:
        nodes: Nodes that the evidence puts it at; empty if nothing is missing.
        log_evidence: Of each set of nodes, relative to none [nat].
        dependence: Correlation of what is missing with what drives it, by node and driver [1].
        courses: By test and node.
    """

    nodes: tuple[str, ...]
    log_evidence: dict[str, float | None]
    dependence: dict[str, dict[str, float | None]]
    courses: tuple[MissingCourse, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Localisation:
    """Where something is missing, before and after.

    Attributes:
        before: With the base network.
        after: With the final model.
    """

    before: LocalisedMisfit
    after: LocalisedMisfit
