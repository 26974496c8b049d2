"""Values of a TOML file as messages show them, and texts of bounded length."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import InputError

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

    Args:
        section: What the section holds.
        key: Which of it.
        where: The section, for messages.
        longest: Most letters that it may have.

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
