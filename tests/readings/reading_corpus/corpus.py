"""The whole corpus: every kind with the function that makes its files."""

from collections.abc import Callable, Iterator
from itertools import chain
from types import ModuleType

from . import (
    benches_containers,
    benches_text,
    unseen_binary,
    unseen_doubts,
    unseen_plain,
    unseen_text,
    unseen_times,
)
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
from .variants import variants

UNSEEN = (unseen_plain, unseen_text, unseen_times, unseen_doubts, unseen_binary)
"""Files that nobody had seen when the readers were written, the check out of sample: they, with
their truth, were written without a look at the readers or at the other kinds."""


def all_of(*modules: ModuleType) -> Callable[[], Iterator[Case]]:
    """Return what makes the files of modules."""
    return lambda: chain.from_iterable(source() for one in modules for source in one.SOURCES)


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
    "unseen": all_of(*UNSEEN),
    "containers of benches": all_of(benches_containers),
    "text of benches": all_of(benches_text),
}
"""What makes the files of a kind; nothing uses chance that is not seeded."""


def corpus() -> Iterator[Case]:
    """Make every file."""
    for source in SOURCES.values():
        yield from source()
