"""Numbers of a text table by their decimal sign, and whether the file settles which it is."""

from __future__ import annotations

import re

NUMBER = {
    "." : r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?",
    "," : r"[+-]?(?:[0-9]+(?:,[0-9]+)?|,[0-9]+)(?:[eE][+-]?[0-9]+)?",
}  # fmt: skip
"""What a number looks like, by decimal sign."""

SIGN_APART = r"^([+-])\s+(?=[0-9.,])"
"""A sign and the blanks behind it, as loggers write that fill a number up to a fixed width."""

PLUS_APART = re.compile(r"(?<![^\s\"])\+ +(?=[0-9.])")
BETWEEN_BLANKS = re.compile(r"(?<![^\s\"])([+-]) +(?=[0-9.])")


def signs_joined(text: str) -> str:
    """Return a table of blanks with the signs next to their digits.

    A minus alone may also be the mark of no value; where a plus stands apart, it is a sign, too.

    Args:
        text: The whole text.
    """
    is_apart = "+ " in text and PLUS_APART.search(text) is not None
    return BETWEEN_BLANKS.sub(r"\1", text) if is_apart else text


GROUPED = {
    ".": r"[+-]?[0-9]{1,3}(?:,[0-9]{3})+(?:\.[0-9]+)?",
    ",": r"[+-]?[0-9]{1,3}(?:\.[0-9]{3})+(?:,[0-9]+)?",
}
"""Numbers with separators of thousands, by decimal sign: read as values only where the motor file
states the decimal sign, but they show the layout."""

SURELY_GROUPED = {
    ".": r"[+-]?[0-9]{1,3}(?:(?:,[0-9]{3})+\.[0-9]+|(?:,[0-9]{3}){2,})",
    ",": r"[+-]?[0-9]{1,3}(?:(?:\.[0-9]{3})+,[0-9]+|(?:\.[0-9]{3}){2,})",
}
"""Those of them in which the sign can do nothing else: beside the decimal sign, or twice."""

SPACED = {
    sign: rf"[+-]?[0-9]{{1,3}}(?:[ \u00a0\u2009\u202f'’_][0-9]{{3}})+(?:{sign_pattern}[0-9]+)?"
    for sign, sign_pattern in ((".", r"\."), (",", ","))
}
"""Numbers with separators of thousands that can be nothing else."""

SPACES = "[ \u00a0\u2009\u202f'’_]"

THOUSANDS_OR_DECIMALS = {
    ".": r"[+-]?[1-9][0-9]{0,2}\.[0-9]{3}",
    ",": r"[+-]?[1-9][0-9]{0,2},[0-9]{3}",
}
"""Numbers that are whole where the sign separates thousands, and are not where it is decimal."""

SURELY_DECIMAL = (
    r"[+-]?(?:0+{0}[0-9]*|[0-9]+{0}(?:[0-9]{{0,2}}|[0-9]{{4,}})|[0-9]{{4,}}{0}[0-9]+|{0}[0-9]+)"
    r"|[+-]?[0-9]*{0}[0-9]+[eE][+-]?[0-9]+"
)
"""Numbers in which the sign {0} separates no thousands."""


def start_of_line(text: str, index: int) -> int:
    r"""Return where a line begins.

    Args:
        text: With `\n` line ends.
        index: Of the line, from 0; the text has it.
    """
    offset = 0
    for _ in range(index):
        offset = text.find("\n", offset) + 1
    return offset


def is_unsettled(text: str, first_line: int, delimiter: str, decimal: str) -> bool:
    r"""Return whether the decimal sign shows itself only where it may separate thousands.

    Args:
        text: The whole text, with `\n` line ends.
        first_line: Index of the first line of data, from 0.
        delimiter: What stands between the cells.
        decimal: The sign that is taken as decimal.
    """
    edge = rf'\s"{re.escape(delimiter)}'
    cell = rf"(?:^|(?<=[{edge}]))(?:{{}})(?=[{edge}]|$)"
    if delimiter == decimal:  # within quotes alone
        cell = '(?<=")(?:{})(?=")'
    start = start_of_line(text, first_line)
    surely = re.compile(cell.format(SURELY_DECIMAL.format(re.escape(decimal))), re.MULTILINE)
    maybe = re.compile(cell.format(THOUSANDS_OR_DECIMALS[decimal]), re.MULTILINE)
    return surely.search(text, start) is None and maybe.search(text, start) is not None
