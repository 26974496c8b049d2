"""A small heat run under any names, and what `heatrun init` drafts of it."""

import re
from pathlib import Path

import numpy as np

from heatrun.init.draft import draft
from heatrun.init.survey import survey
from heatrun.motor.file import parse_motor

TIME_S = np.arange(0.0, 3600.0, 10.0)
_random = np.random.default_rng(7)
LOAD = TIME_S % 1200.0 < 800.0
CURRENT = 100.0 * LOAD + np.abs(_random.normal(0.0, 0.2, TIME_S.size))
LOSSES = 6.0 * CURRENT
WINDING = 22.0 + 70.0 * (1.0 - np.exp(-TIME_S / 900.0))
HOUSING = 22.0 + 30.0 * (1.0 - np.exp(-TIME_S / 2500.0))
BEARING = 22.0 + 3.0 * (1.0 - np.exp(-TIME_S / 2500.0))
ROOM = 21.0 + _random.normal(0.0, 0.2, TIME_S.size)
ZERO = np.zeros(TIME_S.size)


def named(folder: Path, columns: dict, name: str = "test.csv", head: str = "") -> Path:
    """Write columns of any name as text, NaN as an empty cell."""
    rows = (
        [f"{v:.6g}" if v == v else "" for v in row] for row in zip(*columns.values(), strict=True)
    )
    lines = [";".join(columns), *(";".join(row) for row in rows)]
    path = folder / name
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def text_of(*paths: Path) -> str:
    """Return the motor file that is drafted for tests; it loads."""
    text = draft("m", [survey(path) for path in paths])
    parse_motor(text.encode(), "motor.toml")
    return text


def offered(text: str, channel: str, section: str = "columns") -> list[str]:
    """Return the right-hand sides of the lines of a channel, in their order."""
    part = text.split(f"\n[{section}]\n")[1].split("\n\n")[0]
    return re.findall(rf'^# {channel} = "?(.*?)"?  #', part, re.MULTILINE)


def note_on(text: str, name: str) -> str:
    """Return the first line of the draft that names a column."""
    part = text.split("\n[columns]\n")[1]
    return next(line for line in part.split("\n") if name in line)
