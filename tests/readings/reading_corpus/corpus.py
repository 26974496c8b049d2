"""The whole corpus: every cause with the function that makes its files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache

from .binaries import hdf_files, other_files, parquet_files
from .case import Case
from .clocks import clocks, dates, epochs
from .headers import places, spellings, times
from .layouts import layouts
from .loggers import loggers
from .numbers_text import marks, writings
from .rows import ends, lost_rows, tables
from .scales import broken, scales
from .statements import comments, conflicts, unit_rows

SOURCES: tuple[Callable[[], Iterator[Case]], ...] = (
    loggers, layouts, places, spellings, unit_rows, comments, conflicts, clocks, dates, epochs,
    times, writings, marks, lost_rows, ends, tables, hdf_files, parquet_files, other_files, scales,
    broken,
)  # fmt: skip
"""What makes files; none of them uses chance that is not seeded."""


@cache
def causes() -> dict[str, tuple[Case, ...]]:
    """Return the files by cause, in the order of `SOURCES`."""
    groups: dict[str, list[Case]] = {}
    for source in SOURCES:
        for case in source():
            groups.setdefault(case.cause, []).append(case)
    return {cause: tuple(cases) for cause, cases in groups.items()}
