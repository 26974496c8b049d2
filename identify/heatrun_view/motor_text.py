"""A motor file as text on the page: its line ends, and the line that an error is about."""

from __future__ import annotations

import re
import tomllib
from html import escape

from heatrun.errors import InputError
from heatrun.io.toml_text import parse_toml

from .words import error_message

BOM = b"\xef\xbb\xbf"
"""What editors on Windows put before UTF-8 text."""

LINE_END = re.compile(r"\r\n|\r|\n")

LINE = re.compile(r"\b(?:at|in) line (\d+)\b")
"""How an error names a line, where the file is no TOML."""

QUOTED = re.compile(r"'([^']+)'")

WORD = re.compile(r"\w+")

NUM_AROUND = 1
"""Lines that are shown before and behind the one that an error is about."""

WIDEST = 160
"""Letters of a line that are shown of it."""


def text_of_file(data: bytes, where: str) -> str:
    """Return the text of a file as a browser has it: without a mark in front, lines ended by LF.

    Args:
        data: The bytes of the file; it need not be TOML.
        where: The file, for messages.

    Raises:
        InputError: If it is no UTF-8 text.
    """
    try:
        return LINE_END.sub("\n", data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        parse_toml(data, where)  # says at which byte, and what to do
        raise


def file_of_text(text: str, before: bytes) -> bytes:
    """Return the bytes of a text, with mark and line ends as the file has them.

    Args:
        text: As the browser has it.
        before: The file; where it has several kinds of line ends, the most frequent one counts.

    Raises:
        InputError: If it is no Unicode text.
    """
    ends = LINE_END.findall(before.decode("utf-8-sig"))
    end = max(("\n", "\r\n", "\r"), key=ends.count) if ends else "\n"
    mark = BOM if before.startswith(BOM) else b""
    try:
        return mark + LINE_END.sub("\n", text).replace("\n", end).encode()
    except UnicodeEncodeError as error:
        raise InputError(
            f"Expected text, got half of a character at position {error.start}.",
            remedy="Remove it.",
        ) from error


def has_mixed_ends(data: bytes) -> bool:
    """Return whether a file ends its lines in several ways.

    Args:
        data: UTF-8 text.
    """
    return len(set(LINE_END.findall(data.decode("utf-8-sig")))) > 1


def line_of(text: str, error: InputError) -> int | None:
    """Return the line that an error is about, counted from 1; None where it cannot be told.

    The parser names a line where the text is no TOML. Every other error names a section, and
    mostly a key of it, or puts the word in quotes that is at fault.

    Args:
        text: Of the motor file.
        error: As `heatrun.motorfile.parse_motor` has raised it.
    """
    lines = text.split("\n")
    headers = [(number, path) for number, line in enumerate(lines) if (path := _header(line))]
    held = [
        (number, path)
        for number, path in headers
        if f"[{path}]" in error.where or error.where.endswith(f", {path}")
    ]
    if not held:
        told = LINE.search(error.problem)
        if told is not None:
            return int(told[1])
        quoted = QUOTED.findall(error.problem)
        found = (n for word in quoted for n, line in enumerate(lines) if word in line)
        return next((n + 1 for n in found), None)
    first = held[0][0]
    last = next((number for number, _ in headers if number > first), len(lines))
    keys = {_key(lines[n]): n for n in reversed(range(first + 1, last))}
    behind = error.where.rpartition("]")[2]
    named = WORD.findall(f"{behind} {error.problem}")
    return 1 + next((keys[word] for word in named if word in keys), first)


def fault_html(text: str, error: InputError) -> str:
    """Return what is wrong with a text, with the line where that is, as HTML.

    Args:
        text: Of the motor file.
        error: As `line_of`.
    """
    number = line_of(text, error)
    lines = text.split("\n")
    if number is None or number > len(lines):
        return error_message(error)
    shown = range(max(number - NUM_AROUND, 1), min(number + NUM_AROUND, len(lines)) + 1)
    excerpt = "\n".join(
        f"{'→' if each == number else ' '} {each:4d}  {lines[each - 1][:WIDEST]}" for each in shown
    )
    said = f"<p><b>Line {number}</b></p><pre>{escape(excerpt)}</pre>"
    return error_message(error) + said


def _header(line: str) -> str:
    """Return the dotted path of a line `[section.part]`, empty where it is none."""
    if not line.lstrip().startswith("["):
        return ""
    try:
        found = tomllib.loads(line)
    except (ValueError, RecursionError):
        return ""
    path = []
    while isinstance(found, dict) and len(found) == 1:
        ((name, found),) = found.items()
        path.append(name)
        found = found[0] if isinstance(found, list) and found else found
    return ".".join(path)


def _key(line: str) -> str:
    """Return the key of a line `key = value`, empty where it is none."""
    key, sign, _ = line.partition("=")
    return key.strip().strip("\"'") if sign else ""
