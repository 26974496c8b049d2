"""A figure that follows from the parameters, or why there is none, as it stands in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import UNSET, Meta, UnsetType

from .values import NonNegative, known, number

LOADED, AT_REST = "_loaded", "_at_rest"
"""What the name of a resistance ends with at the load of the tests, and at standstill."""

NEEDED = ("value", "unit", "sd", "interval_95", "condition")


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivedFigure:
    """A figure with its interval and the condition it holds under; or only why it is refused.

    Attributes:
        value: Median [unit]; null where it is not finite.
        unit: Its unit.
        sd: Standard deviation [unit]; null where too many draws are not finite.
        interval_95: 95 % interval [unit]; null for a limit that is not finite.
        condition: What it holds under.
        refused: Why there is no figure; all other fields are unset then.
    """

    value: float | UnsetType | None = UNSET
    unit: str | UnsetType = UNSET
    sd: NonNegative | UnsetType | None = UNSET
    interval_95: tuple[float | None, float | None] | UnsetType = UNSET
    condition: str | UnsetType = UNSET
    refused: str | UnsetType = UNSET

    def __post_init__(self) -> None:
        is_there = [getattr(self, name) is not UNSET for name in NEEDED]
        if not (all(is_there) if self.refused is UNSET else not any(is_there)):
            raise ValueError(f"expected {', '.join(NEEDED)}, or `refused` alone")

    @property
    def median(self) -> float:
        """The value [unit]; NaN where it is refused or not finite."""
        return number(known(self.value))

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends of the 95 % interval; NaN where it is refused or not finite."""
        low, high = known(self.interval_95) or (None, None)
        return number(low), number(high)


Derived = Annotated[
    DerivedFigure,
    Meta(extra_json_schema={"oneOf": [{"required": [*NEEDED]}, {"required": ["refused"]}]}),
]
