"""A bench file with its truth."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from .machine import MACHINES, Machine


class Truth(Enum):
    """What a reader must make of a file."""

    READ = "the file states it"
    PLAIN = "nothing is stated, the ordinary reading is right"
    ASK = "the file cannot settle it: right, a question or a warning that names it"
    OPEN = "a good file of another machine looks the same: the unit must be shown as assumed"
    CONFLICT = "two statements disagree: a question or a warning that names it"
    REFUSE = "no bench file"


@dataclass(frozen=True)
class Case:
    """One file of the corpus."""

    cause: str  # Group that it belongs to.
    name: str  # Unique in the group.
    truth: Truth  # What a reader must make of it.
    content: bytes | Callable[[Path], None]  # The bytes, or a function that writes the file.
    suffix: str = ".csv"  # Of the file, with the dot.
    # Canonical channel to true values, `time_s` among them; NaN where the file has no value. Empty
    # for `Truth.REFUSE`.
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    # By channel: what the writing rounds away.
    tolerance: dict[str, float] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)  # `[columns]` of the motor file.
    machine: Machine = MACHINES[0]  # Under test.
    subject: str = ""  # Regular expression; a warning or question that names the doubt matches it.
    at: str = ""  # What follows the path, such as `@10Hz`.
    # Ids of findings that say of the recording what is true, such as gaps.
    true_faults: frozenset[str] = frozenset()
    # The motor file gives the phase resistance, against which losses can be held.
    has_resistance: bool = True
    # True values of samples that the file half holds: they may be read, or be missing.
    held: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Cause and name."""
        return f"{self.cause}: {self.name}"

    def write(self, folder: Path, number: int) -> Path:
        """Write the file and return where it lies."""
        path = folder / f"test_{number}{self.suffix}"
        if isinstance(self.content, bytes):
            path.write_bytes(self.content)
        else:
            self.content(path)
        return path
