"""Reading `[certificate]`: every key is known, every value checked."""

import datetime
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.open_file import read_start
from ..io.quantities import JOINERS
from ..io.texts import LANGUAGES
from ..io.toml_text import (
    LARGEST_BYTES,
    check_keys,
    choice_of,
    parse_toml,
    section_of,
    shown,
    text_of,
)
from ..record.motor import INSTRUMENT_KEYS, PLACES, Certificate, Instrument
from .keys import KEYS

NAME, LINES, PARAGRAPH = 120, 200, 500
"""Most letters of a name, of an address and of remarks: what page 1 has room for."""

OF_LINES = ("laboratory_address", "customer_address", "condition", "bench")
LONGER: dict[str, int] = {**dict.fromkeys(OF_LINES, LINES), "remarks": PARAGRAPH}
"""Texts of more letters than a name has."""

DATES = ("received", "test_from", "test_until", "issue_date")
"""Keys that hold a day."""

OTHERS = ("performed_at", "country", "language", "instruments")
"""Keys that hold neither a day nor a text."""

MOST_INSTRUMENTS = 30


def parse_certificate(section: Mapping[str, Any], where: str) -> Certificate:
    """Return what `[certificate]` of a motor file says.

    Raises:
        InputError: If a key is not known, or a value is of another type, too long, no day, or holds
            a character that cannot be printed.
    """
    at = f"{where}, [certificate]"
    check_keys(section, KEYS["certificate"], at, "key")
    section = _given(section)
    given = {
        key: _day(section, key, at)
        if key in DATES
        else _clean(section, key, at, LONGER.get(key, NAME))
        for key in KEYS["certificate"]
        if key not in OTHERS
    }
    first, last = given["test_from"], given["test_until"]
    if first and last and last < first:
        raise InputError(
            f"test_until ({last}) lies before test_from ({first}).",
            where=at,
            remedy="Give the first and the last day of the test.",
        )
    return Certificate(
        **given,
        performed_at=choice_of(section, "performed_at", PLACES, at) or "",
        country=_country(section, at),
        language=choice_of(section, "language", LANGUAGES, at) or "",
        instruments=_instruments(section, where),
    )


def load_meta(path: str | Path) -> Certificate:
    """Read a file that holds the keys of `[certificate]`, under that heading or under none.

    Raises:
        InputError: As `parse_certificate`, or if the file cannot be read.
    """
    return parse_meta(read_start(path, LARGEST_BYTES), str(path))


def stated_in_all(
    stated: Certificate, meta: str | Path | None = None, language: str = ""
) -> Certificate:
    """Return what a motor file states beneath a file of `--meta` and the language asked for."""
    if meta is not None:
        stated = stated.beneath(load_meta(meta))
    return stated.beneath(Certificate(language=language))


def parse_meta(data: bytes, where: str) -> Certificate:
    """Return what the file of `--meta` says; errors as `load_meta`."""
    content = parse_toml(data, where, "file of the certificate")
    if "certificate" in content:
        check_keys(content, ("certificate",), where, "section")
        content = section_of(content, "certificate", where)
    return parse_certificate(content, where)


def _given(section: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys whose text is not blank: `customer = ""` is a line to fill in by hand."""
    return {k: v for k, v in section.items() if not (isinstance(v, str) and not v.strip())}


def _clean(section: Mapping[str, Any], key: str, where: str, longest: int) -> str:
    """Return a text on one line; empty where it is not given."""
    if key not in section:
        return ""
    text = " ".join(text_of(section, key, where, longest).split())
    odd = next((c for c in text if not (c.isprintable() or c in JOINERS)), None)
    if odd is not None:
        raise InputError(
            f"Expected characters that can be printed for {key}, got U+{ord(odd):04X}.",
            where=where,
            remedy="Type the text anew; marks of the writing direction are not needed.",
        )
    return text


def _day(section: Mapping[str, Any], key: str, where: str) -> str:
    """Return a day as ISO 8601; empty where it is not given."""
    value = section.get(key, "")
    if key not in section:
        return ""
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        return value.isoformat()
    if isinstance(value, str) and re.fullmatch(r"[0-9]{4}-[0-9]{2}-[0-9]{2}", value.strip()):
        try:
            return datetime.date.fromisoformat(value.strip()).isoformat()
        except ValueError:
            pass
    raise InputError(
        f"Expected a day for {key}, got {shown(value)}.",
        where=where,
        remedy=f"Write year, month and day: {key} = 2026-03-04.",
    )


def _country(section: Mapping[str, Any], where: str) -> str:
    value = section.get("country", "")
    if not (isinstance(value, str) and re.fullmatch("(?:[A-Za-z]{2})?", value.strip())):
        raise InputError(
            f"Expected the two letters of a country for country, got {shown(value)}.",
            where=where,
            remedy='Write the code of ISO 3166-1, such as country = "IT".',
        )
    return value.strip().upper()


def _instruments(section: Mapping[str, Any], where: str) -> tuple[Instrument, ...]:
    at = f"{where}, [[certificate.instruments]]"
    tables = section.get("instruments", [])
    if isinstance(tables, dict):  # a single one, with one pair of brackets
        tables = [tables]
    if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        raise InputError(
            f"Expected a table for each instrument, got {shown(tables)}.",
            where=at,
            remedy="Write [[certificate.instruments]] on a line of its own and the keys below it.",
        )
    if len(tables) > MOST_INSTRUMENTS:
        raise InputError(
            f"Expected at most {MOST_INSTRUMENTS} instruments, got {len(tables)}.", where=at
        )
    found = (_instrument(one, at) for one in tables)
    return tuple(one for one in found if one != Instrument())


def _instrument(table: Mapping[str, Any], where: str) -> Instrument:
    check_keys(table, INSTRUMENT_KEYS, where, "key")
    table = _given(table)
    quantity, name, kind, calibration = (
        _clean(table, key, where, NAME) for key in INSTRUMENT_KEYS[:-1]
    )
    return Instrument(quantity, name, kind, calibration, _day(table, "valid_until", where))
