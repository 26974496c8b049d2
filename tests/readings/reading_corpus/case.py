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
    """One file of the corpus.

    Attributes:
        cause: Group that it belongs to.
        name: Unique in the group.
        truth: What a reader must make of it.
        content: The bytes, or a function that writes the file.
        suffix: Of the file, with the dot.
        channels: Canonical channel to true values, `time_s` among them; NaN where the file has
            no value. Empty for `Truth.REFUSE`.
        tolerance: By channel: what the writing rounds away.
        columns: `[columns]` of the motor file.
        machine: Under test.
        subject: Regular expression; a warning or question that names the doubt matches it.
        at: What follows the path, such as `@10Hz`.
        true_faults: Ids of findings that say of the recording what is true, such as gaps.
        held: True values of samples that the file half holds: they may be read, or be missing.
        has_resistance: The motor file gives the phase resistance, against which losses can be held.
    """

    cause: str
    name: str
    truth: Truth
    content: bytes | Callable[[Path], None]
    suffix: str = ".csv"
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    tolerance: dict[str, float] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)
    machine: Machine = MACHINES[0]
    subject: str = ""
    at: str = ""
    true_faults: frozenset[str] = frozenset()
    has_resistance: bool = True
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
