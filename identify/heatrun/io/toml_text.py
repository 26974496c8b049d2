"""TOML from outside, bounded before it is parsed, and its values as messages show them.

The parser of the standard library calls itself for each level of nesting, and for a key of n dots
it does work and holds memory by n squared: 100 kB of dots took 3.4 GB. So levels and dots are
counted first, in one pass over the text that knows strings and comments and nothing more.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from ..errors import InputError, did_you_mean

W = TypeVar("W", bound=str)

LONGEST_TEXT = 500
"""Letters of a name or a right-hand side; the names of columns in use have fewer than 100."""

KINDS: dict[type, str] = {
    str: "the text",
    bool: "the truth value",
    int: "the number",
    float: "the number",
}


def shown(value: Any) -> str:
    """Return a value as a message shows it: its kind and its first letters."""
    kind = KINDS.get(type(value), type(value).__name__)
    try:
        return f"{kind} {value!r:.60}"
    except ValueError:  # Python writes no integer of more than 4300 digits
        return f"{kind} of more than 4300 digits"


def text_of(section: Mapping[str, Any], key: str, where: str, longest: int = LONGEST_TEXT) -> str:
    """Return the text of a key without blanks around it.

    Raises:
        InputError: If it is no text, a blank one or too long.
    """
    value = section[key]
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"Expected a text for {key}, got {shown(value)}.", where=where)
    if len(value) > longest:
        raise InputError(
            f"Expected at most {longest} letters for {key}, got {len(value)}.", where=where
        )
    return value.strip()


LARGEST_BYTES = 2**20
"""Largest TOML file; those in use have a few kilobytes."""

MOST_LEVELS = 16
"""Brackets within brackets; a motor file needs two."""

MOST_DOTS = 16
"""Dots in one key; a motor file needs one."""

TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+"""'
    r"|'''(?:[^']|'(?!''))*+'''"
    r'|"(?:[^"\\\n]|\\.)*+"'
    r"|'[^'\n]*+'"
    r"|\#[^\n]*+"
    r"|[\[\]{}.=,\n\"']",
    re.DOTALL,
)


def parse_toml(data: bytes, where: str, what: str = "motor file") -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        InputError: If it is no UTF-8 text or no TOML, larger than `LARGEST_BYTES`, or nested
            deeper or with more dots in a key than anybody writes.
    """
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"Expected a {what} of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=where,
            remedy="Check that this is the right file.",
        )
    try:
        text = data.decode("utf-8-sig")  # editors on Windows add a mark in front
    except UnicodeDecodeError as error:
        raise InputError(
            f"Expected UTF-8 text, got another byte at position {error.start}.",
            where=where,
            remedy=f"Save the {what} as UTF-8.",
        ) from error
    _require_bounded(text, where, what)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # also an integer of 5000 digits
        raise InputError(
            f"The {what} is no valid TOML: {str(error)[:300]}.",
            where=where,
            remedy='Write lines such as name = "…" below a [section].',
        ) from error


def table_header(*keys: str) -> str:
    """Return the line that begins a table, by its keys: `[tests.drive]`, `[tests."a b"]`."""
    import tomli_w

    content: dict[str, Any] = {}
    for key in reversed(keys):
        content = {key: content}
    return tomli_w.dumps(content).strip("\n")


def check_keys(content: Mapping[str, Any], known: Sequence[str], where: str, kind: str) -> None:
    """Refuse a key or section, as `kind` says, that is not known.

    Raises:
        InputError: With the known ones, the nearest named.
    """
    for key in content:
        if key not in known:
            raise InputError(
                f"The {kind} '{key[:60]}' is not known. {did_you_mean(key[:60], known)}".strip(),
                where=where,
                remedy=f"Known are: {', '.join(known)}.",
            )


def section_of(content: Mapping[str, Any], name: str, where: str) -> Mapping[str, Any]:
    """Return a section; an empty one where it is not given.

    Raises:
        InputError: If it is none.
    """
    section = content.get(name, {})
    if not isinstance(section, dict):
        raise InputError(
            f"Expected a section, got {shown(section)}.",
            where=f"{where}, {name}",
            remedy=f"Write [{name}] on a line of its own.",
        )
    return section


def choice_of(section: Mapping[str, Any], key: str, choices: Sequence[W], where: str) -> W | None:
    """Return one of some words; None where the key is not given.

    Raises:
        InputError: If it is another.
    """
    if key not in section:
        return None
    value = section[key]
    if value not in choices:
        near = did_you_mean(value, choices) if isinstance(value, str) else ""
        raise InputError(
            f"Expected one of {', '.join(choices)} for {key}, got {shown(value)}. {near}".strip(),
            where=where,
            remedy=f'Write {key} = "{choices[0]}", for example.',
        )
    return value


def _require_bounded(text: str, where: str, what: str) -> None:
    """Raise where brackets lie too deep or a key has too many dots."""
    levels = dots = 0
    for found in TOKEN.finditer(text):
        token = found[0]
        if token in ("[", "{"):
            levels, dots = levels + 1, 0
        elif token in ("]", "}"):
            levels = max(levels - 1, 0)
        elif token == ".":
            dots += 1
        elif token in ("\n", "=", ","):
            dots = 0
        elif token in ('"', "'"):
            return  # a string that is never closed: the parser comes no further either
        if levels > MOST_LEVELS or dots > MOST_DOTS:
            line = text.count("\n", 0, found.start()) + 1
            problem = (
                f"Brackets are nested more than {MOST_LEVELS} deep"
                if levels > MOST_LEVELS
                else f"A key has more than {MOST_DOTS} dots"
            )
            raise InputError(
                f"{problem} in line {line}; the {what} needs no such thing.",
                where=where,
                remedy='Write lines such as name = "…" below a [section].',
            )
