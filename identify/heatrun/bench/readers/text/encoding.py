"""From the bytes of a text file to its text."""

from __future__ import annotations

import codecs
import re

from ....errors import InputError

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


def decode(data: bytes, where: str) -> tuple[str, str]:
    r"""Return the text with `\n` line ends, and the name of the encoding found.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Raises:
        InputError: If the bytes are no text in UTF-8, UTF-16, UTF-32, Windows-1252 or Latin-1.
    """
    text, encoding = _decode(data, where)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    # A Ctrl-Z ends the file on old loggers, which pad the rest of the last block behind it. With
    # anything else behind it, it stands in a cell, which then is no number.
    before, found, behind = text.partition("\x1a")
    if found and not behind.strip("\x1a\0 \t\n"):
        text = before
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
    half = _utf16_without_mark(data)
    if half:
        return _strict(data, half, "UTF-16", where), "UTF-16"
    try:
        return data.decode("utf-8"), "UTF-8"
    except UnicodeDecodeError as error:
        if (
            error.start >= len(data) - LONGEST_UTF8_CHARACTER
            and error.start > 0
            and _is_multibyte(data[: error.start])
        ):
            return data[: error.start].decode("utf-8"), "UTF-8, cut inside the last character"
    try:
        return data.decode("cp1252"), "Windows-1252"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "Latin-1"


def _is_multibyte(data: bytes) -> bool:
    """Return whether there is any character beyond ASCII, which makes UTF-8 certain."""
    return not data.isascii()


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
