"""Parts of a result: one Parquet file per batch under a name that says what it was made of.

A part is there whole or not at all. Its name is the SHA-256 of inputs, settings and versions, so it
is found again by whoever asks for the same. A part with a machine that workers died on is kept
under another ending, for what it holds, and is worked out again by the next run.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heatrun.io.whole_files import write_whole
from heatrun.results.json_text import to_json

from .arrow_schema import arrow
from .rows import Row, schema

FOLDER = "parts"
ROW_GROUP = 512
"""Rows of a group of the joined file; it does not depend on the size of the batches."""


@dataclass(frozen=True)
class Parts:
    """The folder of the parts.

    Attributes:
        folder: Where they lie.
    """

    folder: Path

    def path(self, name: str) -> Path:
        """Return where the part of a batch is once it is whole."""
        return self.folder / f"{name}.parquet"

    def lost_path(self, name: str) -> Path:
        """Return where the part of a batch is in which a machine was lost."""
        return self.folder / f"{name}.lost.parquet"

    def timing_path(self, name: str) -> Path:
        """Return where the times of a batch stand."""
        return self.folder / f"{name}.json"

    def write(self, name: str, part: bytes, timing: dict[str, Any], *, is_lost: bool) -> None:
        """Write a part, whole or not at all; the times first, so that each part has them.

        Raises:
            OSError: If it cannot be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self.timing_path(name), (to_json(timing) + "\n").encode())
        write_whole(self.lost_path(name) if is_lost else self.path(name), part)
        if not is_lost:
            self.lost_path(name).unlink(missing_ok=True)

    def holds(self, name: str, machines: Sequence[str]) -> bool:
        """Whether the part of a batch is there, undamaged, with just these machines."""
        path = self.path(name)
        if not path.is_file():
            return False
        try:
            found = read_part(path).column("machine").to_pylist()
        except (OSError, ValueError, KeyError):  # pyarrow's errors are kinds of these
            return False
        return found == list(machines)

    def sweep(self, names: Iterable[str]) -> None:
        """Remove the parts of other batches than these, and pieces of killed processes."""
        kept = {p.name for n in names for p in (self.path(n), self.lost_path(n),
                                               self.timing_path(n))}  # fmt: skip
        for path in list(self.folder.iterdir()):
            if path.name not in kept and path.is_file():
                path.unlink()


def part_bytes(rows: Sequence[Row]) -> bytes:
    """Return rows as a Parquet file: the same bytes for the same rows."""
    return table_bytes([arrow().Table.from_pylist(list(rows), schema=schema())])


def table_bytes(tables: Sequence[Any]) -> bytes:
    """Return tables of rows, in order, as one Parquet file."""
    whole = arrow().concat_tables(tables).combine_chunks()
    held = io.BytesIO()
    with _writer(held) as writer:
        writer.write_table(whole, row_group_size=ROW_GROUP)
    return held.getvalue()


def read_part(source: Path | bytes) -> Any:
    """Return the table of a part.

    Raises:
        OSError: If it is damaged.
    """
    from pyarrow.parquet import ParquetFile

    opened = io.BytesIO(source) if isinstance(source, bytes) else source
    with ParquetFile(opened, page_checksum_verification=True) as file:
        table = file.read()
    if table.schema != schema():
        raise ValueError("the part has other columns")
    return table


def join(paths: Iterable[Path], target: Path) -> None:
    """Write the rows of parts, in order, into one file; memory holds two groups at most.

    Args:
        paths: The parts.
        target: The file, written in place.
    """
    pa = arrow()
    waiting: list[Any] = []
    num = 0
    with _writer(target) as writer:
        for path in paths:
            waiting.append(read_part(path))
            num += waiting[-1].num_rows
            while num >= ROW_GROUP:
                whole = pa.concat_tables(waiting)
                writer.write_table(whole.slice(0, ROW_GROUP).combine_chunks(),
                                   row_group_size=ROW_GROUP)  # fmt: skip
                waiting, num = [whole.slice(ROW_GROUP)], num - ROW_GROUP
        if num:
            writer.write_table(pa.concat_tables(waiting).combine_chunks(), row_group_size=ROW_GROUP)


def _writer(target: Any) -> Any:
    from pyarrow.parquet import ParquetWriter

    return ParquetWriter(target, schema(), compression="zstd", write_page_checksum=True)
