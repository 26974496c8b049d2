"""Which column became which channel, in which unit, and how that is known: as data and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..record import Record
from .derive import formulas
from .schema import CHANNEL

KNOWN_BY = {
    "stated": "stated",
    "name": "the name",
    "assumed": "ASSUMED",
    "derived": "derived",
}
"""How a unit is known, in words."""

HEAD = ("channel", "column", "unit", "unit known by", "column known by")
LONGEST = 36
KEPT = 17
"""Letters of a name that a line of the terminal or the sheet has room for, and from its start."""


def describe_mapping(record: Record) -> list[dict[str, str]]:
    """Return how each channel of a record came about, as plain data.

    Args:
        record: Any record; one that was made in memory has no columns.

    Returns:
        By channel: `channel`, `column`, `unit`, `unit_from` (`"stated"`, `"name"`, `"assumed"` or
        `"derived"`), `found_by` (who says that it is this channel, or the formula) and `file`.
    """
    if not record.mapping:
        return []
    rows = [
        {
            "channel": one.channel,
            "column": one.column,
            "unit": one.unit,
            "unit_from": one.unit_from,
            "found_by": one.found_by,
            "file": one.file,
        }
        for one in record.mapping
    ]
    read = {one.channel for one in record.mapping}
    derived = formulas(record.channels, read)
    if "time_s" not in read:
        derived = {"time_s": "sampling rate", **derived}
    rows += [
        {
            "channel": name,
            "column": "",
            "unit": CHANNEL[name].unit,
            "unit_from": "derived",
            "found_by": formula,
            "file": "",
        }
        for name, formula in derived.items()
    ]
    return sorted(rows, key=lambda row: _position(row["channel"]))


def describe_columns(record: Record) -> dict[str, Any]:
    """Return `name` and `mapping` of a record, as `mapping_text` takes them."""
    return {"name": record.name, "mapping": describe_mapping(record)}


def mapping_rows(mapping: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """Return the rows of a table under `HEAD`; names too long for it are cut.

    Args:
        mapping: From `describe_mapping`.
    """
    return [
        [
            row["channel"],
            _cut(row["column"]) or "–",
            row["unit"],
            KNOWN_BY.get(row["unit_from"], row["unit_from"]),
            _cut(row["found_by"]) if row["column"] else row["found_by"],
        ]
        for row in mapping
    ]


def mapping_text(tests: Sequence[Mapping[str, Any]]) -> str:
    """Return aligned tables of columns and channels; tests that were read alike share one.

    Args:
        tests: Each with `name` and `mapping`, such as the tests of `fit.json`.
    """
    blocks = []
    for names, rows in grouped(tests):
        widths = [max(len(line[i]) for line in (HEAD, *rows)) for i in range(len(HEAD) - 1)]
        lines = [f"Columns of {names}"]
        for line in (HEAD, *rows):
            cells = [cell.ljust(width) for cell, width in zip(line, (*widths, 0), strict=True)]
            lines.append("  " + "  ".join(cells).rstrip())
        assumed = [row[0] for row in rows if row[3] == KNOWN_BY["assumed"]]
        if assumed:
            lines.append(f"  {assumption(assumed)}")
        blocks.append("\n".join(lines))
    return "\n".join(blocks)


def grouped(tests: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[list[str]]]]:
    """Return names of tests that were read alike, with the rows of their table.

    Args:
        tests: As `mapping_text`; those without a mapping are left out.
    """
    alike: dict[str, tuple[list[str], list[list[str]]]] = {}
    for test in tests:
        rows = mapping_rows(test.get("mapping") or [])
        if rows:
            alike.setdefault(repr(rows), ([], rows))[0].append(str(test["name"]))
    return [(", ".join(names), rows) for names, rows in alike.values()]


def assumption(channels: Sequence[str]) -> str:
    """Return the sentence on units that nothing said."""
    return (
        f"Unit assumed for {', '.join(channels)}: no file and no name gives it. State it in "
        "[columns] if you know it."
    )


def _position(channel: str) -> int:
    return list(CHANNEL).index(channel) if channel in CHANNEL else len(CHANNEL)


def _cut(text: str) -> str:
    clean = "".join(c if c.isprintable() else "?" for c in text)
    # Names of one system begin alike and often end alike: the middle goes.
    return clean if len(clean) <= LONGEST else f"{clean[:KEPT]}…{clean[KEPT + 1 - LONGEST :]}"
