"""Channels that nobody measured: numbers of the motor file."""

from __future__ import annotations

from collections.abc import Sequence

from ...bench.channels.derive import constants_of
from ...results.tested import DescribedTest


def num_stated(tests: Sequence[DescribedTest], channel: str) -> int:
    """Return in how many tests a channel is a constant of the motor file."""
    return sum(channel in constants_of(test.notes) for test in tests)
