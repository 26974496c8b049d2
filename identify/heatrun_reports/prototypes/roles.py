"""Which record is which prototype: `ROLE=FILE` on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from heatrun.errors import UsageError

LONGEST_ROLE = 24
"""Characters of a role: it heads a column."""

FORM = "virtual=FILE semi-real=FILE real=FILE"


def parse_roles(texts: Sequence[str]) -> tuple[tuple[str, Path], ...]:
    """Return role and file of each prototype, in the order given.

    Args:
        texts: Each `ROLE=FILE`; the role is any short word, the file may be the folder of a run.

    Raises:
        UsageError: If a text is no such pair, a role stands twice, or there are fewer than two.
    """
    found: dict[str, Path] = {}
    for text in texts:
        role, sign, file = text.partition("=")
        role = role.strip()
        if not (sign and file and role.isprintable() and 0 < len(role) <= LONGEST_ROLE):
            raise UsageError(
                f"{text!r}: a prototypes report expects ROLE=FILE, such as {FORM}, with a role of "
                f"at most {LONGEST_ROLE} characters."
            )
        if role in found:
            raise UsageError(f"the role {role!r} stands twice; call a repeat {role}-2.")
        found[role] = Path(file)
    if len(found) < 2:
        raise UsageError(f"a prototypes report compares two or more: {FORM}.")
    return tuple(found.items())
