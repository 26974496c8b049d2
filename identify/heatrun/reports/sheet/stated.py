"""Channels that nobody measured: numbers of the motor file."""

from __future__ import annotations

from collections.abc import Sequence

from ...bench.joined import BY_CONSTANTS
from ...results.tested import DescribedTest


def num_stated(tests: Sequence[DescribedTest], channel: str) -> int:
    """Return in how many tests a channel is a constant of the motor file."""
    return sum(
        any(note.startswith(f"{channel} = ") and note.endswith(BY_CONSTANTS) for note in test.notes)
        for test in tests
    )
