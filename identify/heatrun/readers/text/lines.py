"""From the bytes of a text file to its text, and to the lines of data of its table.

Lines are counted on the bytes: a million of them take a fraction of a second that way, and the
table parser would fill up short lines without a word.
"""

import codecs
import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.quantities import printable
from ...io.toml_text import table_header
from ...record.header import plain
from ...record.record import Finding
from ...record.stretch import runs
from ...record.units import is_unit
from .layout import Layout, first_word
from .values import start_of_line

BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "UTF-8 with byte-order mark", "utf-8"),
    (codecs.BOM_UTF32_LE, "UTF-32", "utf-32-le"),  # begins like UTF-16 LE, so it comes first
    (codecs.BOM_UTF32_BE, "UTF-32", "utf-32-be"),
    (codecs.BOM_UTF16_LE, "UTF-16", "utf-16-le"),
    (codecs.BOM_UTF16_BE, "UTF-16", "utf-16-be"),
)
CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")
LONGEST_UTF8_CHARACTER = 4
SAMPLE_BYTES = 65536
MOST_LINES = 200
ISO_2022_JP = re.compile(rb"\x1b\$[@B(]|\x1b\(I")
"""Where it switches to its characters of two bytes, or to half-width ones."""

LATIN = re.compile(
    r"(?<![^\x00-\x7f])[\u00c0-\u00ff]{1,3}(?![^\x00-\x7f])|[\u00b0-\u00b5\u00b7\u00d7\u2013\u2019]"
)
JAPANESE = re.compile(r"[\u3041-\u30fe]|[\uff66-\uff9f]{2,}")
SIGNS = re.compile(r"[\u2103\u00b0\u03a9\u03bc\u00b5\u3001-\u3011\uff01-\uff5e\uff9f\u30fb]")
CENTRAL = re.compile(
    r"(?<![^\x00-\x7f])[ąćęłńóśźżčďěňřšťůžáéíýúäöüőűâăîđß]{1,3}(?![^\x00-\x7f])|[°µ·×]",
    re.IGNORECASE,
)
CYRILLIC = re.compile(r"[\u0410-\u044f]{2,}|\u00b0")
ENCODINGS: tuple[tuple[str, str, re.Pattern[str], bytes], ...] = (
    ("Windows-1252", "cp1252", LATIN, b""),
    ("Windows-1250", "cp1250", CENTRAL, b""),
    ("Shift-JIS", "cp932", JAPANESE, rb"[\x88-\x97][\x40-\xfc]"),
    ("EUC-KR", "cp949", SIGNS, rb"[\xb0-\xc8][\xa1-\xfe]"),
    ("GB18030", "gb18030", SIGNS, rb"[\xb0-\xd7][\xa1-\xfe]"),
    ("Big5", "big5", SIGNS, rb"[\xa4-\xc6][\x40-\xfe]"),
    ("EUC-JP", "euc_jp", JAPANESE, rb"[\xb0-\xcf][\xa1-\xfe]"),
    ("Windows-1251", "cp1251", CYRILLIC, b""),
    ("CP850", "cp850", LATIN, b""),
    ("Mac-Roman", "mac_roman", LATIN, b""),
)
"""Encodings in which benches write where it is not UTF-8: name, codec, which characters are
ordinary in it, and the bytes of those that its standard puts first by use. Of two that fit alike,
the one that stands first here."""

CODECS = {name: codec for name, codec, _, _ in ENCODINGS} | {"UTF-8": "utf-8", "Latin-1": "latin-1"}
"""Encodings in which a line end is one byte, so that a file can be cut there."""

BENCH_WORDS = frozenset(
    ("温度", "环境", "室温", "绕组", "电流", "电压", "功率", "损耗", "转速", "转矩", "扭矩",
     "时间", "日期", "溫度", "環境", "繞組", "電流", "電壓", "轉速", "轉矩", "時間", "周囲",
     "外気", "巻線", "電圧", "電力", "損失", "回転数", "時刻", "日時", "日付", "온도", "주위",
     "권선", "전류", "전압", "전력", "손실", "속도", "회전수", "토크", "시간", "날짜", "время",
     "температура", "ток", "мощность", "обмотка", "среда", "потери", "скорость", "дата",
     "čas", "napětí", "idő", "prąd", "napięcie", "prędkość", "otáčky", "příkon", "výkon",
     "vinutí", "okolí", "sebesség", "hőmérséklet", "áram")
)  # fmt: skip
"""Words that stand over columns."""

PIECES = re.compile(r"[\s,;|\"'()\[\]{}<>/:=_.-]+")


def decode(data: bytes, where: str) -> tuple[str, str]:
    r"""Return the text with `\n` line ends, and the name of the encoding found.

    Raises:
        InputError: If the bytes are no text in UTF-8, UTF-16, UTF-32 or one of `ENCODINGS`.
    """
    text, encoding = _decode(data, where)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    # A Ctrl-Z ends the file on old loggers, which pad the rest of the last block behind it. With
    # anything else behind it, it stands in a cell, which then is no number.
    before, found, behind = text.partition("\x1a")
    if found and not behind.strip("\x1a\0 \t\n"):
        text = before
    if "\uff0c" in text and not re.search("[,;\t|]", text):
        text = text.replace("\uff0c", ",")  # the full-width comma between the cells
    if CONTROL.search(text):
        raise InputError(
            "Expected a table as text, got bytes that are no text.",
            where=where,
            remedy="Export the recording as CSV, MAT or Parquet.",
        )
    return text, encoding


def _decode(data: bytes, where: str) -> tuple[str, str]:
    for mark, name, codec in BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return _strict(data[len(mark) :], codec, name, where), name
    if ISO_2022_JP.search(data, 0, SAMPLE_BYTES):
        return _strict(data, "iso2022_jp_ext", "ISO-2022-JP", where), "ISO-2022-JP"
    if half := _utf16_without_mark(data):
        return _strict(data, half, "UTF-16", where), "UTF-16"
    for name in _likely(data):
        try:
            return data.decode(CODECS[name]), name
        except UnicodeDecodeError as error:
            head = data[: error.start]
            is_cut = error.start >= len(data) - LONGEST_UTF8_CHARACTER
            # letters of more than one byte make UTF-8 certain
            if is_cut and (name != "UTF-8" or not head.isascii()):
                return head.decode(CODECS[name]), f"{name}, cut inside the last character"
    return data.decode("latin-1"), "Latin-1"


def _likely(data: bytes) -> Iterator[str]:
    """Yield the encodings that come into question: UTF-8, and the others by how likely they are.

    That is the one in which most is understood: units and words of the bench before all, then the
    share of the characters that are ordinary in it.
    """
    yield "UTF-8"
    found = re.finditer(rb"[^\r\n]*[\x80-\xff][^\r\n]*", data)
    lines = b"\n".join(dict.fromkeys(line[0] for line in itertools.islice(found, MOST_LINES)))
    scored = []
    for name, codec, ordinary, common in ENCODINGS:
        text = lines.decode(codec, "ignore" if codec == "cp1252" else "replace")
        foreign = sum(not character.isascii() for character in text)
        pieces = {piece for piece in PIECES.split(text) if not piece.isascii()}
        known = sum(
            is_unit(piece) or piece.casefold() in BENCH_WORDS for piece in map(plain, pieces)
        )
        count = sum(len(one[0]) for one in ordinary.finditer(text))
        count += _num_common(text, codec, common) if common else 0
        if known or 2 * count > foreign or codec == "cp1252":
            scored.append((-known, -count / max(foreign, 1), name))
    yield from (name for *_, name in sorted(scored, key=lambda one: one[:2]))


def _num_common(text: str, codec: str, common: bytes) -> int:
    """Return how many characters of two bytes are among those that a standard puts first.

    One behind a small letter is none: there it is a letter of a word in another encoding.
    """
    return sum(
        re.fullmatch(common, character.encode(codec, "ignore")) is not None
        for run in re.findall(r"(?<![a-z])[^\x00-\x7f]+", text)
        for character in run
    )


def _strict(data: bytes, codec: str, name: str, where: str) -> str:
    try:
        return data.decode(codec)
    except UnicodeDecodeError as error:
        raise InputError(
            f"Expected {name} text, got a byte that is none at position {error.start}.",
            where=where,
            remedy="The file looks cut or damaged: copy it again from the bench.",
        ) from error


def _utf16_without_mark(data: bytes) -> str | None:
    """Return the codec if every other byte is mostly zero, as in UTF-16 text of numbers."""
    first, second = data[:SAMPLE_BYTES:2], data[1:SAMPLE_BYTES:2]
    for codec, high, low in (("utf-16-le", second, first), ("utf-16-be", first, second)):
        if high.count(0) > 0.8 * len(high) and low.count(0) < 0.05 * len(high):
            return codec
    return None


RAGGED_LIMIT = 0.1
"""Share of lines with another number of cells beyond which the layout was not understood."""

PIECE_BYTES = 2**20

LEAST_SPACED = 3
"""Lines from which on a blank line behind each is a way of writing and no missing sample."""

MOST_TEXTS, LONGEST_TEXT = 100, 200
"""So many ragged lines are looked into, and so many letters of each."""

MOST_FOOTERS = 10  # lines of words below a table; more of them are a first column that failed

MOST_RESTARTS = 8  # parts of more of them are not written out

NUM_NAMED = 5  # so many line numbers or spans of time stand in a message


@dataclass(frozen=True)
class DataLines:
    """The lines that have the right number of cells."""

    text: bytes  # These lines, in UTF-8.
    numbers: np.ndarray  # Line number in the file of each, from 1.
    ragged: np.ndarray  # Line numbers of those left out.
    sample_numbers: np.ndarray | None = None  # As `heatrun.record.table.Table`.
    is_double_spaced: bool = False  # A blank line stands behind each line.
    ragged_texts: tuple[str, ...] = ()  # The first of these lines themselves.
    # Which of them, from 0, come first behind a line of names that stands there again.
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

    They are the line of names, word for word, and the lines around it that are blank, a line of
    units that is the same, or begin as another line above the table does: a logger writes them when
    it starts again.
    """
    found = np.zeros(ends.size, dtype=bool)
    first = _first_cells(body, ends, layout)
    names, starts = layout.header.encode(), _starts(ends)
    position = body.find(names) if names else -1
    while position >= 0:
        line = int(np.searchsorted(ends, position))
        found[line] = body[starts[line] : ends[line]].rstrip() == names
        position = body.find(names, int(ends[line]))
    for line in np.flatnonzero(found):
        for step in (-1, 1):
            near = line + step
            while 0 <= near < ends.size and (
                is_blank[near]
                or first(int(near)) in layout.above
                or body[starts[near] : ends[near]].decode("utf-8", "replace").rstrip()
                in layout.above
            ):
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


def restarted(lines: DataLines, where: str) -> Iterator[Finding]:
    """Yield the finding about a header that stands among the data again, if any."""
    if not lines.restarts:
        return
    ends = (*lines.restarts, lines.numbers.size)
    first = ", ".join(str(row) for row in lines.restarts[:NUM_NAMED])
    more = " and more" if len(lines.restarts) > NUM_NAMED else ""
    rows = ", ".join(f"[{a + 1}, {b}]" for a, b in itertools.pairwise((0, *ends)))
    section = table_header("tests", Path(where.removesuffix(".gz")).stem)
    if len(lines.restarts) > MOST_RESTARTS:
        rows = "[FIRST, LAST], …"
    yield Finding(
        "logger_restarted",
        "warning",
        f"The header stands there again, word for word, behind sample {first}{more}: "
        "the logger was started again. Nothing says how long it was off.",
        where,
        "Where the times go on, nothing need be done. If it was off for long, read the "
        f"parts as tests of their own, in the motor file: {section} use_rows = [{rows}].",
        values={"count": len(lines.restarts), "first_sample": lines.restarts[0]},
    )


def ragged_lines(lines: DataLines, layout: Layout, where: str) -> Iterator[Finding]:
    """Yield the finding about lines that were left out, if any."""
    count = lines.ragged.size
    if count == 0:
        return
    first = ", ".join(str(number) for number in lines.ragged[:NUM_NAMED])
    more = " and more" if count > NUM_NAMED else ""
    yield Finding(
        "ragged_rows",
        "warning",
        f"Lines without exactly {layout.width} cells, or of words below the table, "
        f"hold no sample ({count}): line {first}{more}; the first is "
        f"'{printable(lines.ragged_texts[0][:60])}'.",
        where,
        "Export again if these samples matter.",
        values={"count": count, "first_line": int(lines.ragged[0])},
    )


def _texts(body: bytes, ends: np.ndarray, ragged: np.ndarray) -> tuple[str, ...]:
    """Return the first ragged lines."""
    first, starts = np.flatnonzero(ragged)[:MOST_TEXTS], _starts(ends)
    return tuple(body[starts[line] : ends[line]].decode()[:LONGEST_TEXT] for line in first)


def _starts(ends: np.ndarray) -> np.ndarray:
    """Return where lines begin, by where they end."""
    return np.concatenate(([0], ends[:-1] + 1))


def _joined(body: bytes, ends: np.ndarray, good: np.ndarray) -> bytes:
    """Return the good lines, copied by runs of them."""
    starts = _starts(ends)
    return b"".join(body[starts[a] : ends[b - 1] + 1] for a, b in zip(*runs(good), strict=True))


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
    """Return of each line its number of cells (0 with an open quote), if all or it are empty."""
    starts = _starts(ends)
    gap = (raw == ord(" ")) | (raw == ord("\t")) | (raw == ord("\n"))
    solid = np.concatenate(([0], np.cumsum(~gap & (raw != ord(delimiter)), dtype=np.int64)))
    is_empty = is_blank = solid[ends] == solid[starts]
    if delimiter == " ":
        marks = np.flatnonzero(~gap & np.concatenate(([True], gap[:-1])))
    else:
        marks = np.flatnonzero(raw == ord(delimiter))
        is_blank = is_empty & (np.searchsorted(marks, ends) == np.searchsorted(marks, starts))
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
