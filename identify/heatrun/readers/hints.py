"""What the motor file says about reading a file, for the readers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..record.channels import Claim, Columns, parse_claims

Decimal = Literal[".", ","]


@dataclass(frozen=True)
class Hints:
    """What the motor file says about reading a file.

    Attributes:
        claims: What the lines of `[columns]` say of each column that they name.
        decimal: Decimal sign of the text tables, or None to find it.
        sheet: Sheet of a workbook that the test names, or None to choose it.
    """

    claims: tuple[Claim, ...] = ()
    decimal: Decimal | None = None
    sheet: str | None = None

    def unit_of(self, name: str, label: str) -> str | None:
        """Return the unit text that `[columns]` states for a column of this name and label, if any.

        A right-hand side that is the name as it stands in the file states nothing of its own.
        """
        for claim in self.claims:
            if claim.base == name:
                return claim.bracket
            if claim.text != name and claim.unit is not None and claim.label in (name, label):
                return claim.unit
        return None


def hints_of(
    columns: Columns | None,
    decimal: Decimal | None = None,
    *,
    where: str,
    sheet: str | None = None,
) -> Hints:
    """Return what the `[columns]` and `decimal` of a motor file say about reading.

    Raises:
        InputError: If `[columns]` names a channel that is not known.
    """
    claims = parse_claims(columns or {}, where)
    each = (one for claim in claims for one in (claim.parts or (claim,)))
    return Hints(tuple(each), decimal, sheet)


NO_HINTS = Hints()
