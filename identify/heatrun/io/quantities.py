"""Quantities as they are printed for people, and texts from files made harmless for print."""

import re
from collections.abc import Iterable, Sequence


def printable(text: str) -> str:
    """Escape control characters, so that a file name cannot steer the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def as_printed(text: str) -> str:
    """Return a text with a question mark for each control character, which would act."""
    return "".join(c if c.isprintable() else "?" for c in text)


JOINERS = "\u200c\u200d"
"""Signs without a picture that names in Persian and in Indian scripts are written with."""

LONGEST = 600
"""Letters of a cell or sentence that a sheet has room for."""


def clean(text: str) -> str:
    """Return a text without control characters, of bounded length, for print."""
    return "".join(c if c.isprintable() or c in JOINERS else " " for c in text)[:LONGEST]


def aligned(rows: Iterable[Sequence[str]], indent: str = "") -> list[str]:
    """Return rows of as many cells each as lines, the columns below each other."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [indent + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


LONG_WORD = re.compile(r"\S{20,}")
BREAK = "\u200b"  # a place where a line may break, without a sign


def with_breaks(text: str, every: int) -> str:
    """Return a text whose long words may break, behind signs or after so many letters."""
    places = re.compile(rf"([_\-./\\,;:=+@]|.{{{every}}})(?=.)")
    return LONG_WORD.sub(lambda word: places.sub(rf"\1{BREAK}", word[0]), text)


PRINTED = {"1": "", "degC": "°C", "ohm": "Ω", "N m": "N·m"}
"""Units that are printed otherwise than they are written in files and code."""

LEAST_PLAIN, MOST_PLAIN = -7, 9
"""Powers of ten between which a number is read more easily without an exponent."""


def printed_unit(unit: str) -> str:
    """Return a unit as it is printed; empty for a pure number.

    Example:
        >>> printed_unit("ohm"), printed_unit("K/W"), printed_unit("1")
        ('Ω', 'K/W', '')
    """
    return PRINTED.get(unit, unit)


def quantity(number: str, unit: str) -> str:
    """Return a number with its unit behind it, if it has one.

    Example:
        >>> quantity("0.62", "1"), quantity("22.8", "degC")
        ('0.62', '22.8 °C')
    """
    return f"{number} {printed_unit(unit)}".rstrip()


def rounded(value: float, digits: int = 3) -> str:
    """Return a number to so many significant digits, without an exponent where it is readable.

    Example:
        >>> rounded(4711.0), rounded(0.01593, 4), rounded(10481.3, 4), rounded(2.4e-7)
        ('4710', '0.01593', '10480', '2.4e-07')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e7 else text


def plain(value: float, digits: int) -> str:
    """Return a number to so many significant digits without an exponent, unless it needs dozens.

    Example:
        >>> plain(-0.00081642, 3), plain(1234567.0, 3), plain(3.2e-6, 2), plain(1e-12, 2)
        ('-0.000816', '1230000', '0.0000032', '1.0e-12')
    """
    text = f"{value:.{digits - 1}e}"
    power = int(text.partition("e")[2])
    if not LEAST_PLAIN <= power <= MOST_PLAIN:
        return text
    shown = f"{float(text):.{max(0, digits - 1 - power)}f}"
    return shown.rstrip("0").rstrip(".") if "." in shown else shown


def off_by(ratio: float) -> str:
    """Return how far a reading is off, of its ratio to the true value: in per cent, or as a factor.

    Example:
        >>> off_by(1.03), off_by(0.97), off_by(1000.0)
        ('3.0 % too high', '3.0 % too low', 'too high by a factor of 1000')
    """
    side = "high" if ratio > 1.0 else "low"
    if 0.5 < ratio < 2.0:
        return f"{100.0 * abs(ratio - 1.0):.1f} % too {side}"
    return f"too {side} by a factor of {rounded(max(ratio, 1.0 / ratio))}"


def part_of(share: float, whole: str) -> str:
    """Return a share of something in per cent, or as a factor where per cent are hard to read.

    Example:
        >>> part_of(0.87, "it"), part_of(1234.0, "the losses"), part_of(0.001, "it")
        ('87 % of it', '1230 times the losses', '1/1000 of it')
        >>> part_of(1e-8, "it"), part_of(3e9, "it")
        ('less than 1/10000 of it', 'more than 10000 times it')
    """
    if 0.01 <= share <= 10.0 or share <= 0.0:
        return f"{100.0 * share:.0f} % of {whole}"
    if not 1e-4 <= share <= 1e4:
        return f"{'more than 10000 times' if share > 1.0 else 'less than 1/10000 of'} {whole}"
    if share > 1.0:
        return f"{rounded(share)} times {whole}"
    return f"1/{rounded(1.0 / share)} of {whole}"


def enumerated(words: Iterable[str]) -> str:
    """Return words as a sentence lists them: "a, b and c"; empty without any."""
    *others, last = [*words] or [""]
    return f"{', '.join(others)} and {last}" if others else last


def effects_in_words(named: Iterable[str], allowed: Iterable[str]) -> str:
    """Return the effects in a model, those that are named and those that it allows for."""
    beside = enumerated(allowed)
    return enumerated(named) + (f", allowing for {beside}" if beside else "")


def percent(probability: float) -> str:
    """Return a probability in per cent; some thousand draws tell none below 0.1 % from 0.

    Example:
        >>> percent(0.843), percent(0.9975), percent(0.0004), percent(1.0)
        ('84 %', '99.8 %', 'below 0.1 %', 'above 99.9 %')
    """
    if not 0.001 <= probability <= 0.999:
        return "below 0.1 %" if probability < 0.5 else "above 99.9 %"
    return f"{100.0 * probability:.{0 if 0.01 <= probability <= 0.99 else 1}f} %"
