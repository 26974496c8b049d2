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
        is_mild: Another kind of cooling than the motor file names would explain it too.
        values: Figures behind it by name with unit suffix.
    """

    id: str
    sentence: str
    channels: tuple[str, ...]
    is_odd: bool
    values: Mapping[str, float]
    is_mild: bool = False
