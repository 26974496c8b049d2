"""A motor file on the page: its text and line ends, the line of an error, the windows of its tests.

It is written where nothing is lost by it.
"""

import copy
import re
import tomllib
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.toml_text import LARGEST_BYTES, parse_toml, table_header
from heatrun.motor.file import parse_motor

from .gate import read_inside, replace_inside
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

    Raises:
        InputError: If it is no UTF-8 text.
    """
    try:
        return LINE_END.sub("\n", data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        parse_toml(data, where)  # says at which byte, and what to do
        raise


def file_of_text(text: str, before: bytes) -> bytes:
    """Return the bytes of a text, with mark and, most frequent, line ends as the file has them.

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
    """Return whether a file ends its lines in several ways."""
    return len(set(LINE_END.findall(data.decode("utf-8-sig")))) > 1


def line_of(text: str, error: InputError) -> int | None:
    """Return the line that an error of `parse_motor` is about, counted from 1; None for none.

    The parser names a line where the text is no TOML. Every other error names a section, and
    mostly a key of it, or puts the word in quotes that is at fault.
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
    """Return what is wrong with the text of a motor file, with the line where that is, as HTML."""
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


def read_motor_file(path: Path) -> bytes:
    """Return the content of a motor file.

    Raises:
        InputError: If it is no regular file any more, cannot be read or is too large.
    """
    return read_inside(path.parent.resolve(), path, LARGEST_BYTES)


def write_motor_file(root: Path, path: Path, before: bytes, after: bytes) -> None:
    """Put another content into a motor file in the folder that is shown, whole or not at all.

    With anything but what it held before in it, it stays.

    Raises:
        InputError: If it was sent to the page, or as `heatrun_view.gate.replace_inside`.
    """
    refuse_sent(root, path)
    if len(after) > LARGEST_BYTES:
        raise InputError(
            f"Expected a motor file of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=path.name,
            remedy="Check what was put in; it was not written.",
        )
    replace_inside(root, path, before, after)


def create_motor_file(root: Path, name: str, content: bytes) -> None:
    """Write a motor file that is not there yet.

    Raises:
        InputError: If there is a file of this name, it is no motor file or cannot be written.
    """
    parse_motor(content, name)
    try:
        with (root / name).open("xb") as file:  # follows no link
            file.write(content)
    except FileExistsError as error:
        raise InputError(
            "There is a file of this name already.", where=name, remedy="Choose another name."
        ) from error
    except OSError as error:
        raise InputError(
            f"The motor file cannot be written ({error.strerror}).",
            where=name,
            remedy="Make the folder writable.",
        ) from error


def refuse_sent(root: Path, path: Path) -> None:
    """Refuse to write a motor file that is none of the folder that is shown.

    Raises:
        InputError: If it lies elsewhere.
    """
    if not path.is_relative_to(root):
        raise InputError(
            "The motor file was sent to the page and ends with it.",
            where=path.name,
            remedy="Copy the text into your own motor file.",
        )


Window = tuple[float, float]

USE = "use"


def windows_of(data: bytes, name: str, where: str) -> list[Window]:
    """Return the windows that a motor file has for a test, [s]; none where all of it is used.

    Raises:
        InputError: If the file is no motor file, or says the parts of the test in rows.
    """
    parts = parse_motor(data, where).tests.get(name)
    use = parts.use if parts is not None else ()
    if any(stretch.in_rows for stretch in use):
        raise InputError(
            "The parts of the test that count are given in rows (use_rows), and the page shows "
            "times.",
            where=f"{where}, [tests.{name}]",
            remedy=f"Write them as times to change them here: {USE} = [[600, 5400]].",
        )
    return [(stretch.start, stretch.end) for stretch in use]


def with_window(windows: Sequence[Window], window: Window) -> list[Window]:
    """Return windows [s] with one more; those that touch become one."""
    merged: list[Window] = []
    for start, end in sorted([*windows, window]):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return merged


def without_window(windows: Sequence[Window], window: Window) -> list[Window]:
    """Return windows [s] without the times of one."""
    left_start, left_end = window
    pieces = [
        piece
        for start, end in sorted(windows)
        for piece in ((start, min(end, left_start)), (max(start, left_end), end))
    ]
    return [(start, end) for start, end in pieces if end > start]


def windows_text(name: str, windows: Sequence[Window]) -> str:
    """Return the lines of the motor file for the windows [s] of a test."""
    return f"{table_header('tests', name)}\n{USE} = {_value(windows)}\n"


def write_windows(data: bytes, name: str, windows: Sequence[Window], where: str) -> bytes:
    """Return a motor file with other windows [s], at least one, for a test.

    The rest of the file stays as it is, byte for byte: the text of the windows is put in, and what
    comes of it is parsed and held against what it should say.

    Raises:
        InputError: If the file is no motor file or would be none with them, or gives them in a form
            that cannot be changed without touching the rest.
    """
    before = parse_toml(data, where)
    wanted = _wanted(before, name, windows)
    text = data.decode("utf-8")
    for candidate in _candidates(text, name, windows):
        if _loaded(candidate.removeprefix("\ufeff")) == wanted:
            changed = candidate.encode("utf-8")
            parse_motor(changed, where)
            return changed
    raise InputError(
        f"The windows of '{name}' cannot be put into this motor file without touching the rest.",
        where=where,
        remedy="Put the lines that are shown into it by hand.",
    )


def _wanted(before: dict[str, Any], name: str, windows: Sequence[Window]) -> dict[str, Any]:
    wanted = copy.deepcopy(before)
    tests = wanted.setdefault("tests", {})
    if not isinstance(tests, dict) or not isinstance(tests.setdefault(name, {}), dict):
        return {}
    tests[name][USE] = tomllib.loads(f"{USE} = {_value(windows)}")[USE]
    return wanted


def _candidates(text: str, name: str, windows: Sequence[Window]) -> Iterator[str]:
    """Yield texts that may be the file with the windows: value replaced, key added, table added."""
    end = "\r\n" if "\r\n" in text else "\n"
    lines = text.splitlines(keepends=True)
    position = 0
    for number, line in enumerate(lines):
        position += len(line)
        header = line.removeprefix("\ufeff").strip()
        if not header.startswith("[") or _loaded(header) != {"tests": {name: {}}}:
            continue
        yield from _replaced(text, lines, number, position, windows)
        gap = "" if line.endswith(("\n", "\r")) else end
        yield f"{text[:position]}{gap}{USE} = {_value(windows)}{end}{text[position:]}"
    gap = "" if not text or text.endswith("\n") else end
    yield text + gap + end + windows_text(name, windows).replace("\n", end)


def _replaced(
    text: str, lines: Sequence[str], header: int, position: int, windows: Sequence[Window]
) -> Iterator[str]:
    """Yield the text with another value behind `use =`, if that stands below a header."""
    for line in lines[header + 1 :]:
        key, sign, _ = line.partition("=")
        if sign and key.strip().strip("\"'") == USE:
            start = position + len(key) + 1
            close = text.find("]", start)
            while close >= 0:
                if _loaded(f"{USE} ={text[start : close + 1]}") is not None:
                    yield f"{text[:start]} {_value(windows)}{text[close + 1 :]}"
                    return
                close = text.find("]", close + 1)
            return
        position += len(line)


def _loaded(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None


def _value(windows: Sequence[Window]) -> str:
    numbers = ([str(round(float(at), 3)).removesuffix(".0") for at in each] for each in windows)
    return f"[{', '.join(f'[{start}, {end}]' for start, end in numbers)}]"
