"""The chosen tests on their way to the page: read in the background, and followed as they grow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ..background import in_background
from ..reading import Reader, Reading, Refused
from ..store import Opened

MAX_READERS = 4
"""Readings at a time; one that takes long does not keep the page from the tests chosen since."""


class Tests:
    """The tests of a tab as they were read last.

    Attributes:
        opened: By the names of the page.
    """

    def __init__(self, reader: Reader, changed: Callable[[Reading, bool], None]) -> None:
        """Take who reads, and whom to tell what came of it, and whether it only grew."""
        self.opened: Mapping[str, Opened] = {}
        self._refused: Mapping[str, Refused] = {}
        self._reader = reader
        self._changed = changed
        self._generation = 0
        self._num_reading = 0
        self._waiting: tuple[list[str], str | None] | None = None

    @property
    def is_idle(self) -> bool:
        """Whether nothing is being read."""
        return self._num_reading == 0

    def outdated(self) -> list[str]:
        """Return the names of tests whose file is not the one that was read."""
        return [name for name, each in self.opened.items() if not each.is_current()]

    @property
    def has_news(self) -> bool:
        """Whether a look at the files may bring anything."""
        return bool(self.outdated() or self._refused)

    def open(self, names: Sequence[str], motor_name: str | None) -> None:
        """Read tests in the background, in place of those of before.

        Args:
            names: As the page lists them.
            motor_name: The motor file, or None.
        """
        self._generation += 1
        if self._num_reading >= MAX_READERS:
            self._waiting = (list(names), motor_name)
            return
        self._waiting = None
        generation, wanted = self._generation, list(names)
        self._num_reading += 1

        in_background(
            lambda: self._reader.read(wanted, motor_name),
            lambda reading: self._take(reading, generation, is_growth=False),
        )

    def follow(self, motor_name: str | None) -> None:
        """Read what has been written to the tests since, and those that could not be read yet.

        Args:
            motor_name: As `open`.
        """
        if not self.is_idle:
            return
        before: dict[str, Opened | Refused] = {**self.opened, **self._refused}
        self._num_reading += 1
        generation = self._generation
        in_background(
            lambda: self._reader.follow(before, motor_name),
            lambda reading: self._take(reading, generation, is_growth=True),
        )

    def _take(self, reading: Reading, generation: int, *, is_growth: bool) -> None:
        self._num_reading -= 1
        if generation == self._generation:
            self.opened, self._refused = reading.opened, reading.refused
            self._changed(reading, is_growth)
        elif self._waiting is not None:
            self.open(*self._waiting)
