"""Files that nobody had seen when the readers were written: the check out of sample.

All of them, with their truth, were written without a look at the readers or at the other kinds.
"""

from __future__ import annotations

from collections.abc import Iterator

from .case import Case
from .unseen_binary import binary_files
from .unseen_doubts import doubtful_files
from .unseen_plain import plain_files
from .unseen_text import stated_files
from .unseen_times import number_files


def unseen() -> Iterator[Case]:
    """Make all of them."""
    for source in (plain_files, stated_files, number_files, doubtful_files, binary_files):
        yield from source()
