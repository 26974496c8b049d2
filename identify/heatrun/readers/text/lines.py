"""The lines of data of a text table, counted on its bytes.

A million lines take a fraction of a second that way; the table parser would fill up short lines
without a word.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.quantities import printable
from ...io.toml_text import table_header
from ...record.record import Finding
from .layout import Layout, first_word
from .values import start_of_line

RAGGED_LIMIT = 0.1
"""Share of lines with another number of cells beyond which the layout was not understood."""

PIECE_BYTES = 2**24

LEAST_SPACED = 3
"""Lines from which on a blank line behind each is a way of writing and no missing sample."""

MOST_TEXTS, LONGEST_TEXT = 100, 200
"""So many ragged lines are looked into, and so many letters of each."""

MOST_FOOTERS = 10  # lines of words below a table; more of them are a first column that failed

MOST_RESTARTS = 8  # parts of more of them are not written out

NUM_NAMED = 5  # so many line numbers stand in a message


@dataclass(frozen=True)
class DataLines:
    """The lines that have the right number of cells.

    Attributes:
        text: These lines, in UTF-8.
        numbers: Line number in the file of each, from 1.
        ragged: Line numbers of those left out.
        sample_numbers: As `heatrun.record.table.Table`.
        ragged_texts: The first of these lines themselves.
        is_double_spaced: A blank line stands behind each line.
        restarts: Which of them, from 0, come first behind a line of names that stands there again.
    """

    text: bytes
    numbers: np.ndarray
    ragged: np.ndarray
    sample_numbers: np.ndarray | None = None
    is_double_spaced: bool = False
    ragged_texts: tuple[str, ...] = ()
    restarts: tuple[int, ...] = ()


def data_lines(text: str, layout: Layout, where: str) -> DataLines:
    """Return the lines of data; blank ones and lines of delimiters alone are no data.

    Between the data they are samples that are missing, like lines with another number of cells,
    and the numbers of the samples count them. Behind the data they are nothing: spreadsheets end
    in lines of delimiters alone.

    Raises:
        InputError: If there is no line of data, or too many have another number of cells.
    """
    body = text[start_of_line(text, layout.first_line) :].encode() + b"\n"
    ends, num_cells, is_empty, is_blank = _count_by_pieces(body, layout.delimiter)
    repeated = _header_again(body, ends, is_blank, layout)
    least = layout.width - layout.num_optional
    good = (num_cells <= layout.width) & (num_cells >= least) & ~is_empty & ~repeated
    footer = _footer(good, _first_cells(body, ends, layout))
    good[footer] = False
    ragged = ~good & ~is_empty & ~repeated
    numbers = np.arange(ends.size) + layout.first_line + 1
    num_odd = int(ragged.sum()) - len(footer)
    if not good.any() or num_odd > max(1, RAGGED_LIMIT * good.sum()):
        first = f", the first in line {numbers[ragged][0]}" if ragged.any() else ""
        raise InputError(
            f"Expected {layout.width} cells in each line of data; {ragged.sum()} of "
            f"{(good | ragged).sum()} lines have another number{first}.",
            where=where,
            remedy="Export with one delimiter and the same number of cells in every line.",
        )
    if good.all():
        return DataLines(body, numbers, numbers[ragged])
    texts = _texts(body, ends, ragged)
    body = _joined(body, ends, good)
    held = np.flatnonzero(~is_blank)
    is_double_spaced = held.size >= LEAST_SPACED and bool(np.all(np.diff(held) == 2))
    counted = ~repeated & (~is_blank if is_double_spaced else np.ones_like(good))
    sample = (np.cumsum(counted) - 1)[good]
    sample -= sample[0]
    is_gapless = sample[-1] == sample.size - 1
    before = np.cumsum(good)[np.flatnonzero(repeated)]  # rows above each repeated line
    restarts = tuple(int(row) for row in np.unique(before) if 0 < row < good.sum())
    return DataLines(
        body, numbers[good], numbers[ragged], None if is_gapless else sample, is_double_spaced,
        texts, restarts,
    )  # fmt: skip


def _footer(good: np.ndarray, word: Callable[[int], str]) -> list[int]:
    """Return the lines at the end of a table that begin with a word, as "Maximum;81.2;40.0"."""
    rows = np.flatnonzero(good)
    if rows.size == 0 or word(rows[0]):
        return []
    words = list(itertools.takewhile(word, rows[: -MOST_FOOTERS - 2 : -1]))
    return words if len(words) <= MOST_FOOTERS else []


def _header_again(
    body: bytes, ends: np.ndarray, is_blank: np.ndarray, layout: Layout
) -> np.ndarray:
    """Return which lines among the data are the header again, shape (line,).

    They are the line of names, word for word, and the lines around it that are blank or begin as
    a line above the table does: a logger writes them when it starts again. The units are the same
    then.
    """
    found = np.zeros(ends.size, dtype=bool)
    first = _first_cells(body, ends, layout)
    names = layout.header.encode()
    starts = np.concatenate(([0], ends[:-1] + 1))
    position = body.find(names) if names else -1
    while position >= 0:
        line = int(np.searchsorted(ends, position))
        found[line] = body[starts[line] : ends[line]].rstrip() == names
        position = body.find(names, int(ends[line]))
    for line in np.flatnonzero(found):
        for step in (-1, 1):
            near = line + step
            while 0 <= near < ends.size and (is_blank[near] or first(int(near)) in layout.above):
                found[near] = True
                near += step
    return found


def _first_cells(body: bytes, ends: np.ndarray, layout: Layout) -> Callable[[int], str]:
    """Return what gives the word that a line begins with, empty for a number."""

    def word(line: int) -> str:
        start = int(ends[line - 1]) + 1 if line else 0
        text = body[start : min(int(ends[line]), start + LONGEST_TEXT)].decode("utf-8", "replace")
        return first_word(text, layout.delimiter)

    return word


def restarted(lines: DataLines, where: str) -> list[Finding]:
    """Return the finding about a header that stands among the data again, if any."""
    if not lines.restarts:
        return []
    ends = (*lines.restarts, lines.numbers.size)
    first = ", ".join(str(row) for row in lines.restarts[:NUM_NAMED])
    more = " and more" if len(lines.restarts) > NUM_NAMED else ""
    rows = ", ".join(f"[{a + 1}, {b}]" for a, b in itertools.pairwise((0, *ends)))
    section = table_header("tests", Path(where.removesuffix(".gz")).stem)
    if len(lines.restarts) > MOST_RESTARTS:
        rows = "[FIRST, LAST], …"
    return [
        Finding(
            id="logger_restarted",
            severity="warning",
            message=f"The header stands there again, word for word, behind sample {first}{more}: "
            "the logger was started again. Nothing says how long it was off.",
            where=where,
            remedy="Where the times go on, nothing need be done. If it was off for long, read the "
            f"parts as tests of their own, in the motor file: {section} use_rows = [{rows}].",
            values={"count": len(lines.restarts), "first_sample": lines.restarts[0]},
        )
    ]


def ragged_lines(lines: DataLines, layout: Layout, where: str) -> list[Finding]:
    """Return the finding about lines that were left out, if any."""
    count = lines.ragged.size
    if count == 0:
        return []
    first = ", ".join(str(number) for number in lines.ragged[:NUM_NAMED])
    more = " and more" if count > NUM_NAMED else ""
    return [
        Finding(
            id="ragged_rows",
            severity="warning",
            message=f"Lines without exactly {layout.width} cells, or of words below the table, "
            f"hold no sample ({count}): line {first}{more}; the first is "
            f"'{printable(lines.ragged_texts[0][:60])}'.",
            where=where,
            remedy="Export again if these samples matter.",
            values={"count": count, "first_line": int(lines.ragged[0])},
        )
    ]


def _texts(body: bytes, ends: np.ndarray, ragged: np.ndarray) -> tuple[str, ...]:
    """Return the first ragged lines."""
    first = np.flatnonzero(ragged)[:MOST_TEXTS]
    starts = np.concatenate(([0], ends[:-1] + 1))
    return tuple(body[starts[line] : ends[line]].decode()[:LONGEST_TEXT] for line in first)


def _joined(body: bytes, ends: np.ndarray, good: np.ndarray) -> bytes:
    """Return the good lines, copied by runs of them."""
    starts = np.concatenate(([0], ends[:-1] + 1))
    change = np.flatnonzero(np.diff(good.astype(np.int8), prepend=0, append=0))
    runs = change.reshape(-1, 2)  # first line of each run, first line behind it
    return b"".join([body[starts[first] : ends[last - 1] + 1] for first, last in runs])


def _count_by_pieces(body: bytes, delimiter: str) -> tuple[np.ndarray, ...]:
    """Return the end of each line, its number of cells, if all are empty, if it is blank.

    By pieces, since counting takes a dozen bytes for each one of the text.
    """
    raw = np.frombuffer(body, dtype=np.uint8)
    found = []
    position = 0
    while position < len(body):
        end = body.rfind(b"\n", position, position + PIECE_BYTES) + 1
        if end == 0:
            end = body.find(b"\n", position) + 1
        piece = raw[position:end]
        ends = np.flatnonzero(piece == ord("\n"))
        found.append((ends + position, *_count_cells(piece, ends, delimiter)))
        position = end
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def _count_cells(
    raw: np.ndarray, ends: np.ndarray, delimiter: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each line its number of cells (0 if a quote stays open), if all are empty, and
    if nothing at all stands in it.
    """
    starts = np.concatenate(([0], ends[:-1] + 1))
    gap = (raw == ord(" ")) | (raw == ord("\t")) | (raw == ord("\n"))
    solid = np.concatenate(([0], np.cumsum(~gap & (raw != ord(delimiter)), dtype=np.int64)))
    is_empty = solid[ends] == solid[starts]
    is_blank = is_empty
    if delimiter != " ":
        marked = np.concatenate(([0], np.cumsum(raw == ord(delimiter), dtype=np.int64)))
        is_blank = is_empty & (marked[ends] == marked[starts])
    if delimiter == " ":
        marks = np.flatnonzero(~gap & np.concatenate(([True], gap[:-1])))
    else:
        marks = np.flatnonzero(raw == ord(delimiter))
    quotes = np.flatnonzero(raw == ord('"'))
    quotes_before = np.searchsorted(quotes, starts)
    is_open = (np.searchsorted(quotes, ends) - quotes_before) % 2 == 1
    if quotes.size:
        line_of_mark = np.searchsorted(ends, marks)
        within = (np.searchsorted(quotes, marks) - quotes_before[line_of_mark]) % 2 == 1
        marks = marks[~within]
    num_marks = np.searchsorted(marks, ends) - np.searchsorted(marks, starts)
    num_cells = num_marks if delimiter == " " else num_marks + 1
    return np.where(is_open, 0, num_cells), is_empty, is_blank
