"""`[tests.NAME]` of the motor file for a test that was not given: nothing of it is used."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from ...io.toml_text import table_header
from ...motor import Motor
from ..record import Finding

NEAR = 0.8
"""Likeness from which a name is one letter or two away from another."""


def other_tests(motor: Motor, names: Iterable[str]) -> tuple[Finding, ...]:
    """Return a finding for each `[tests.NAME]` that is for none of the tests.

    A motor file serves many tests of a machine, so that this is a note; a name that is nearly that
    of a test is a warning, for then a part or a mask is not used that was meant to be.

    Args:
        motor: The machine.
        names: Of the records; parts of a test end in `_1`, `_2` and so on.
    """
    given = tuple(dict.fromkeys(names))
    whole = {re.sub(r"_[0-9]+$", "", name) for name in given} | set(given)
    free = [name for name in given if name not in motor.tests]
    found = []
    for name in motor.tests:
        if name in whole:
            continue
        header = table_header("tests", name)
        meant = next((one for one in free if _is_nearly(name, one)), None)
        message = f"{header} of the motor file is for none of the tests that were given ("
        message += f"{', '.join(given)}): what it says of use and mask changes nothing here."
        found.append(
            Finding(
                "other_test",
                "warning" if meant else "note",
                message,
                remedy=f"Did you mean {table_header('tests', meant)}? The name is that of the file "
                "without its ending."
                if meant
                else "Nothing need be done if it is for another test.",
            )
        )
    return tuple(found)


def _is_nearly(written: str, name: str) -> bool:
    """Return whether a name was mistyped; names that differ in a number are different tests."""
    if written.startswith(f"{name}."):
        return True  # with the ending of the file
    one, other = written.casefold(), name.casefold()
    is_like = difflib.SequenceMatcher(None, one, other).ratio() >= NEAR
    return is_like and re.findall("[0-9]+", one) == re.findall("[0-9]+", other)
