"""`[tests.NAME]` of the motor file: which parts of a test count, and its own `[columns]`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, get_args

from .bench.channels.claims import parse_claims
from .bench.stretch import Stretch, in_order, parse_time
from .errors import InputError
from .io.toml_text import check_keys
from .io.toml_values import text_of
from .motor import GapLoad, PartsOfTest

PARTS_KEYS = ("use", "use_rows", "mask", "bridge", "gap", "columns")

MOST_CHOICES = 20
"""Right-hand sides of one channel."""

MOST_PARTS = 200
"""Of one test; each stretch becomes a test with temperatures of its own at the start."""


def parse_parts(section: Mapping[str, Any], where: str) -> dict[str, PartsOfTest]:
    """Return what `[tests.NAME]` says, by name of the test.

    Args:
        section: The parsed `[tests]`.
        where: The motor file, for messages.

    Raises:
        InputError: If a key is not known, or a window is no pair of times or rows in order.
    """
    parts = {}
    for name, keys in section.items():
        at = f"{where}, [tests.{name}]"
        if not isinstance(keys, dict):
            raise InputError(
                "Expected a section with use, use_rows, mask, bridge, gap or columns.",
                where=at,
                remedy=f"Write [tests.{name}] and below it use = [[600, 5400]], for example.",
            )
        check_keys(keys, PARTS_KEYS, at, "key")
        if "use" in keys and "use_rows" in keys:
            raise InputError(
                "Both use and use_rows are given.", where=at, remedy="Keep one of them."
            )
        use = _stretches(keys, "use", at) + _stretches(keys, "use_rows", at)
        mask, bridge = (
            tuple((part.start, part.end) for part in _stretches(keys, key, at))
            for key in ("mask", "bridge")
        )
        if any(math.isinf(end) for _, end in (*mask, *bridge)):
            raise InputError("mask and bridge need both ends of a window.", where=at)
        columns = parse_columns(keys.get("columns", {}), at)
        parts[name] = PartsOfTest(use, mask, bridge, _gap_load(keys, at), columns)
    return parts


def _gap_load(keys: Mapping[str, Any], where: str) -> GapLoad | None:
    """Return the load in gaps."""
    section = keys.get("gap")
    load = section.get("load") if isinstance(section, dict) else section
    if section is None or (load in get_args(GapLoad) and section == {"load": load}):
        return load
    raise InputError(
        f"Expected the load in the gaps of the logger, got {str(section)[:80]}.",
        where=f"{where}, gap",
        remedy='Write gap.load = "held", "zero" or "unknown".',
    )


def parse_columns(section: Any, where: str) -> dict[str, str | tuple[str, ...]]:
    """Return `[columns]`, or that of a test.

    Args:
        section: As parsed.
        where: The motor file and what the section is under, for messages.

    Raises:
        InputError: If a channel is not known, or what stands behind it is no text and no list.
    """
    at = f"{where}, [columns]"
    if not isinstance(section, dict):
        raise InputError("Expected a section with lines such as winding_degC = …", where=at)
    columns: dict[str, str | tuple[str, ...]] = {}
    for key, said in section.items():
        if not isinstance(said, list):
            columns[key] = text_of(section, key, at)
            continue
        if not 0 < len(said) <= MOST_CHOICES:
            raise InputError(
                f"Expected 1 to {MOST_CHOICES} columns for {key}, got {len(said)}.", where=at
            )
        columns[key] = tuple(text_of({key: text}, key, at) for text in said)
    parse_claims(columns, where)
    return columns


def _stretches(keys: Mapping[str, Any], key: str, where: str) -> tuple[Stretch, ...]:
    if key not in keys:
        return ()
    listed = keys[key]
    pairs = isinstance(listed, list) and all(
        isinstance(pair, list) and len(pair) == 2 for pair in listed
    )
    if not pairs or not listed or len(listed) > MOST_PARTS:
        raise InputError(
            f"Expected a list of 1 to {MOST_PARTS} pairs for {key}, got {str(listed)[:80]}.",
            where=where,
            remedy=f"Write {key} = [[600, 5400], [7200, 9000]]: first and last "
            f"{'row' if key == 'use_rows' else 'second'} of each.",
        )
    at = f"{where}, {key}"
    return tuple(
        in_order(Stretch(_end(first, key, at), _end(last, key, at), key == "use_rows"), at)
        for first, last in listed
    )


def _end(value: Any, key: str, where: str) -> float:
    """Return one end of a window, a time [s] or a row."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if key == "use_rows":
        kind = "a whole number from 1"
        if is_number and isinstance(value, int) and 1 <= value < 10**15:
            return float(value)
    else:
        kind = "seconds from 0, or a text such as '90 min'"
        if is_number and 0 <= value <= 1e12:
            return float(value)
        if isinstance(value, str) and value.strip():
            return parse_time(
                value, where, "Rows stand under use_rows, as numbers: use_rows = [[1, 5000]]."
            )
    raise InputError(
        f"Expected {kind} for an end of {key}, got {str(value)[:80]!r}.",
        where=where,
        remedy="Times are counted from the first sample of the file.",
    )
