"""The whole corpus: every kind with the function that makes its files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

from .benches_containers import container_files
from .benches_text import text_files
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
from .unseen_binary import binary_files
from .unseen_doubts import doubtful_files
from .unseen_plain import plain_files
from .unseen_text import stated_files
from .unseen_times import number_files
from .variants import variants

UNSEEN = (plain_files, stated_files, number_files, doubtful_files, binary_files)
"""Files that nobody had seen when the readers were written, the check out of sample: they, with
their truth, were written without a look at the readers or at the other kinds."""

SOURCES: dict[str, Callable[[], Iterator[Case]]] = {
    "loggers": loggers,
    "layouts": layouts,
    "places": places,
    "spellings": spellings,
    "unit rows": unit_rows,
    "comments": comments,
    "conflicts": conflicts,
    "clocks": clocks,
    "dates": dates,
    "epochs": epochs,
    "times": times,
    "writings": writings,
    "marks": marks,
    "lost rows": lost_rows,
    "ends": ends,
    "tables": tables,
    "HDF5": hdf_files,
    "Parquet": parquet_files,
    "other formats": other_files,
    "scales": scales,
    "broken": broken,
    "variants": variants,
    "unseen": lambda: chain.from_iterable(source() for source in UNSEEN),
    "containers of benches": container_files,
    "text of benches": text_files,
}
"""What makes the files of a kind; nothing uses chance that is not seeded."""


def corpus() -> Iterator[Case]:
    """Make every file."""
    for source in SOURCES.values():
        yield from source()
