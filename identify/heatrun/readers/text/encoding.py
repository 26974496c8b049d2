"""From the bytes of a text file to its text."""

from __future__ import annotations

import codecs
import itertools
import re

from ...errors import InputError
from ...record.header import plain
from ...record.units import is_unit

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
    half = _utf16_without_mark(data)
    if half:
        return _strict(data, half, "UTF-16", where), "UTF-16"
    try:
        return data.decode("utf-8"), "UTF-8"
    except UnicodeDecodeError as error:
        if (
            error.start >= len(data) - LONGEST_UTF8_CHARACTER
            and error.start > 0
            and not data[: error.start].isascii()  # which makes UTF-8 certain
        ):
            return data[: error.start].decode("utf-8"), "UTF-8, cut inside the last character"
    for name in _likely(data):
        try:
            return data.decode(CODECS[name]), name
        except UnicodeDecodeError as error:
            if error.start >= len(data) - LONGEST_UTF8_CHARACTER:
                cut = data[: error.start].decode(CODECS[name])
                return cut, f"{name}, cut inside the last character"
    return data.decode("latin-1"), "Latin-1"


def _likely(data: bytes) -> list[str]:
    """Return the encodings that come into question, the likeliest first.

    It is the one in which most is understood: units and words of the bench before all, then the
    share of the characters that are ordinary in it.
    """
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
    return [name for *_, name in sorted(scored, key=lambda one: one[:2])]


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
    sample = data[:SAMPLE_BYTES]
    pairs = len(sample) // 2
    if pairs == 0:
        return None
    high_second, high_first = sample[1::2].count(0), sample[0::2].count(0)
    if high_second > 0.8 * pairs and high_first < 0.05 * pairs:
        return "utf-16-le"
    if high_first > 0.8 * pairs and high_second < 0.05 * pairs:
        return "utf-16-be"
    return None
