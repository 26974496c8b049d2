"""The `[columns]` of a motor file: which column of a bench file is which channel."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from ...errors import InputError, did_you_mean
from .combined import COMBINED, refuse_combination, split_parts
from .header import split_name
from .schema import CHANNEL

NOT_RECORDED = "none"
"""Right-hand side of `[columns]` by which no column becomes the channel."""

BRACKET_AT_END = re.compile(r"(?P<base>.*\S)\s*\[(?P<unit>[^\[\]]+)\]", re.DOTALL)
RATE = re.compile(r"^rate\s+(?P<rate>[0-9.eE+-]+)\s*Hz$", re.IGNORECASE)


@dataclass(frozen=True)
class Claim:
    """What one line of `[columns]` says.

    Attributes:
        channel: Canonical name.
        text: The right-hand side as written.
        label: Its column name without the unit.
        unit: Its unit text, or None.
        base: What stands before square brackets at its end, whatever it is; empty without them.
        bracket: What stands in them.
        rate_Hz: Sampling rate that stands for a time column [Hz], or None.
        how: `"mean"` or `"hottest"` of several columns; empty for one.
        parts: What it says of each of them.
        is_choice: It is one of several that hold in the files that have them.
    """

    channel: str
    text: str
    label: str
    unit: str | None
    base: str = ""
    bracket: str = ""
    rate_Hz: float | None = None
    how: str = ""
    parts: tuple[Claim, ...] = ()
    is_choice: bool = False


Columns = Mapping[str, str | tuple[str, ...]]
"""`[columns]`: canonical channel to a right-hand side, or to several of which the first counts
whose column a file has."""


def lines_of(columns: Columns | None) -> Iterator[tuple[str, str]]:
    """Yield each channel with each of its right-hand sides."""
    for channel, said in (columns or {}).items():
        for text in (said,) if isinstance(said, str) else said:
            yield channel, text


def parse_claims(columns: Columns, where: str) -> tuple[Claim, ...]:
    """Return what `[columns]` says, in its order; one claim for each of several right-hand sides.

    Args:
        columns: Canonical channel to `"column in the file [unit]"`; `"none"` leaves the channel
            out, and `time_s` may also be `"rate 10 Hz"`.
        where: The motor file, for messages.

    Raises:
        InputError: If a channel is not known or a rate is not positive. Units are checked where
            a column is converted, since brackets may be part of its name.
    """
    claims = []
    for channel, text in lines_of(columns):
        if channel not in CHANNEL:
            raise InputError(
                f"[columns] names the channel '{channel}', which is not known. "
                f"{did_you_mean(channel, CHANNEL)}".strip(),
                where=where,
                remedy=f"Channels are: {', '.join(CHANNEL)}.",
            )
        rate = RATE.match(text.strip())
        if rate and channel == "time_s":
            claim = Claim(channel, text, text, None, rate_Hz=_rate(rate["rate"], where))
        else:
            claim = _claim(channel, text, f"{where}, [columns] {channel}")
        claims.append(replace(claim, is_choice=not isinstance(columns[channel], str)))
    return tuple(claims)


def _claim(channel: str, text: str, where: str) -> Claim:
    several = COMBINED.fullmatch(text.strip())
    if several is not None:
        named = split_parts(several["parts"])
        refuse_combination(channel, several["how"], len(named), where)
        unit = f" [{several['unit']}]" if several["unit"] else ""
        parts = tuple(
            _claim(channel, part if BRACKET_AT_END.fullmatch(part) else f"{part}{unit}", where)
            for part in named
        )
        name = text.strip()
        return Claim(channel, name, name, None, how=several["how"], parts=parts)
    label, unit = split_name(text, where)
    base = BRACKET_AT_END.fullmatch(text.strip())
    pair = (base["base"], base["unit"].strip()) if base else ("", "")
    return Claim(channel, text.strip(), label, unit, *pair)


def _rate(text: str, where: str) -> float:
    try:
        return positive_rate(float(text), f"{where}, [columns] time_s")
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"Expected a rate such as 'rate 10 Hz', got 'rate {text} Hz'.",
            where=f"{where}, [columns] time_s",
        ) from error


def positive_rate(rate_Hz: float, where: str) -> float:
    """Return a sampling rate [Hz] if it is one.

    Args:
        rate_Hz: Sampling rate [Hz].
        where: Where it was given, for the message.

    Raises:
        InputError: If the rate is not a positive number.
    """
    if not (math.isfinite(rate_Hz) and rate_Hz > 0):
        raise InputError(
            f"Expected a sampling rate above 0 Hz, got {rate_Hz:g} Hz.",
            where=where,
            remedy="Give the samples per second, such as 10.",
        )
    return rate_Hz
