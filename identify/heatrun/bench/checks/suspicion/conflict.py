"""One relation of physics that a record breaks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Conflict:
    """A relation that a record breaks.

    Attributes:
        id: Short name.
        sentence: What was expected and what came.
        channels: The channels between which it holds.
        is_odd: It may be so in a rare machine or test; it counts only where one reading repairs it.
        is_mild: Something else than a unit would explain it too, such as another kind of cooling.
        values: Figures behind it by name with unit suffix.
        otherwise: What to do if no unit is wrong, a sentence.
    """

    id: str
    sentence: str
    channels: tuple[str, ...]
    is_odd: bool
    values: Mapping[str, float]
    is_mild: bool = False
    otherwise: str = ""
