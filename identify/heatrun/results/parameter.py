"""A parameter of a fitted network, as it stands in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, UnsetType

from .values import Interval, NonNegative

Identifiability = Literal["identified", "weak", "not identifiable", "fixed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """What the tests say of a parameter.

    Attributes:
        value: Median of the posterior [unit].
        unit: Its unit.
        sd: Standard uncertainty [unit].
        sd_type_a: What remains of it with exact instruments [unit].
        sd_type_b: What the stated uncertainties of the instruments add [unit].
        interval_95: 95 % interval [unit].
        relative_sd: Standard uncertainty over the value [1]; null where the value is 0.
        prior_95: 95 % interval of the prior [unit].
        prior_basis: Where the prior comes from.
        meaning: What the parameter is.
        fixed: Whether it was held at its value.
        identifiability: How well the tests determine it; unset for nuisance parameters.
        why: What this rests on; unset likewise.
    """

    value: float
    unit: str
    sd: NonNegative
    sd_type_a: NonNegative | None
    sd_type_b: NonNegative | None
    interval_95: Interval
    relative_sd: NonNegative | None
    prior_95: Interval
    prior_basis: str
    meaning: str
    fixed: bool
    identifiability: Identifiability | UnsetType = UNSET
    why: str | UnsetType = UNSET
