"""The windows of a test in the motor file, `[tests.NAME] use`: read, shown and written.

The rest of the file stays as it is, byte for byte: the text of the windows is put in, and what
comes of it is parsed and held against what it should say.
"""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator, Sequence
from typing import Any

from heatrun.errors import InputError
from heatrun.io.toml_text import parse_toml, table_header
from heatrun.motorfile import parse_motor

Window = tuple[float, float]

USE = "use"


def windows_of(data: bytes, name: str, where: str) -> list[Window]:
    """Return the windows that a motor file has for a test, [s]; none where all of it is used.

    Args:
        data: Content of the motor file.
        name: The test.
        where: The file, for messages.

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
    """Return windows with one more; those that touch become one.

    Args:
        windows: In any order [s].
        window: Begin and end [s].
    """
    merged: list[Window] = []
    for start, end in sorted([*windows, window]):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return merged


def without_window(windows: Sequence[Window], window: Window) -> list[Window]:
    """Return windows without the times of one.

    Args:
        windows: In any order [s].
        window: Begin and end [s] of what is left out.
    """
    left_start, left_end = window
    pieces = [
        piece
        for start, end in sorted(windows)
        for piece in ((start, min(end, left_start)), (max(start, left_end), end))
    ]
    return [(start, end) for start, end in pieces if end > start]


def windows_text(name: str, windows: Sequence[Window]) -> str:
    """Return the lines of the motor file for the windows of a test.

    Args:
        name: The test.
        windows: Begin and end of each [s].
    """
    return f"{table_header('tests', name)}\n{USE} = {_value(windows)}\n"


def write_windows(data: bytes, name: str, windows: Sequence[Window], where: str) -> bytes:
    """Return a motor file with other windows for a test.

    Args:
        data: Its content.
        name: The test.
        windows: Begin and end of each [s]; at least one.
        where: The file, for messages.

    Raises:
        InputError: If the file is no motor file or would be none with them, or gives them in a form
            that cannot be changed without touching the rest.
    """
    before = parse_toml(data, where)
    wanted = _wanted(before, name, windows)
    text = data.decode("utf-8")
    for candidate in _candidates(text, name, windows):
        try:
            found = tomllib.loads(candidate.removeprefix("\ufeff"))
        except tomllib.TOMLDecodeError:
            continue
        if found == wanted:
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
        if not _is_header(line, name):
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
                if _is_value(text[start : close + 1]):
                    yield f"{text[:start]} {_value(windows)}{text[close + 1 :]}"
                    return
                close = text.find("]", close + 1)
            return
        position += len(line)


def _is_header(line: str, name: str) -> bool:
    if not line.lstrip("\ufeff \t").startswith("["):
        return False
    try:
        return tomllib.loads(line.removeprefix("\ufeff").strip()) == {"tests": {name: {}}}
    except tomllib.TOMLDecodeError:
        return False


def _is_value(text: str) -> bool:
    try:
        tomllib.loads(f"{USE} ={text}")
    except tomllib.TOMLDecodeError:
        return False
    return True


def _value(windows: Sequence[Window]) -> str:
    return "[" + ", ".join(f"[{_number(start)}, {_number(end)}]" for start, end in windows) + "]"


def _number(value: float) -> str:
    return str(round(float(value), 3)).removesuffix(".0")
