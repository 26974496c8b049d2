"""Dates that are written without signs between their numbers or with the month in letters."""

from __future__ import annotations

import re

import pandas as pd

MONTHS = (
    "jan january januar janvier gen gennaio jän jänner janv",
    "feb february februar février févr fév febbraio",
    "mar march mär märz mrz mars marzo",
    "apr april avril avr aprile",
    "may mai maggio mag",
    "jun june juni juin giu giugno",
    "jul july juli juil juillet lug luglio",
    "aug august août aou aoû ago agosto",
    "sep sept september septembre set settembre",
    "oct october okt oktober octobre ott ottobre",
    "nov november novembre",
    "dec december dez dezember déc décembre dic dicembre",
)
"""Names and abbreviations in English, German, French and Italian."""

NUMBER_OF = {word: number for number, words in enumerate(MONTHS, 1) for word in words.split()}

CLOCK = (
    r"(?P<clock>[0-9]{1,2}:[0-5][0-9](?::[0-5]?[0-9](?:[.,][0-9]*)?)?\s*(?:[AaPp][Mm])?"
    r"\s*(?:Z|[+-][0-9]{2}:?[0-9]{2})?)"
)
WORD = r"(?P<month>[A-Za-zäéû]{3,9})\.?"
DAY_FIRST = rf"(?P<day>[0-9]{{1,2}})\.?[- /]{WORD}[- /](?P<year>[0-9]{{4}}),?[T _]\s*{CLOCK}"
MONTH_FIRST = rf"{WORD}[- ](?P<day>[0-9]{{1,2}}),?[- ](?P<year>[0-9]{{4}}),?[T _]\s*{CLOCK}"
COMPACT = (
    r"(?P<year>(?:19|20)[0-9]{2})(?P<month>[01][0-9])(?P<day>[0-3][0-9])[T_]"
    r"(?P<hour>[0-2][0-9])(?P<minute>[0-5][0-9])(?P<second>[0-5][0-9](?:[.,][0-9]*)?)?"
    r"(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?"
)
FORMS = {
    "the month stands in letters": (DAY_FIRST, MONTH_FIRST),
    "the year comes first": (COMPACT,),
}
CELLS = tuple(re.compile(form) for forms in FORMS.values() for form in forms)


def is_worded_date(cell: str) -> bool:
    """Return whether a cell is a date with a time as this module reads it."""
    for pattern in CELLS:
        found = pattern.fullmatch(cell)
        if found is not None:
            return found["month"].isdigit() or found["month"].casefold() in NUMBER_OF
    return False


def numbered_dates(cells: pd.Series) -> tuple[pd.Series, str]:
    """Return such dates as year-month-day and clock, and why their order is known.

    Args:
        cells: Texts without blanks around them, shape (time,); others stay as they are.

    Returns:
        The cells, and the reason, empty if no cell is such a date.
    """
    for reason, forms in FORMS.items():
        for form in forms:
            parts = cells.str.extract(f"^{form}$")
            if parts["year"].isna().all():
                continue
            named = parts["month"].str.casefold().map(NUMBER_OF)
            month = named.astype("Int64").astype("string").fillna(parts["month"]).astype(object)
            if "clock" not in parts:
                second = parts["second"].fillna("00")
                clock = parts["hour"] + ":" + parts["minute"] + ":" + second
                parts["clock"] = clock + parts["zone"].fillna("")
            day = parts["year"] + "-" + month + "-" + parts["day"]
            is_date = parts["year"].notna() & month.str.fullmatch("[0-9]{1,2}").eq(True)
            if is_date.any():
                return cells.where(~is_date, day + " " + parts["clock"]), reason
    return cells, ""
