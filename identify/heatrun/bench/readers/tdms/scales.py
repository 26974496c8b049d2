"""The scalings of a TDMS channel, checked before a library builds them.

A scaling is numbers only: polynomials, tables, laws of sensors. Yet their count is a property of
the file and allocated as it stands, sums refer to each other without limit, and of a kind that is
not known the library returns the raw values without a word.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

KINDS = ("Polynomial", "Linear", "RTD", "Strain", "Table", "Thermistor", "Thermocouple",
         "AdvancedAPI")  # fmt: skip
"""Scalings of one input that the library computes."""

SUMS = ("Add", "Subtract")
MOST_SUMS = 4
"""Each may double the work, since its two inputs are computed anew."""

MOST_SCALES = 32
"""A measuring card writes up to about five in a row."""

SCALE = re.compile(r"NI_Scale\[(\d+)\]_Scale_Type")


def scaling_refusal(properties: Sequence[Mapping[str, object]]) -> tuple[str, str] | None:
    """Return why the scaling of a channel cannot be trusted and what to do, None if it can.

    Args:
        properties: Of the channel, its group and the file; the first with scalings counts.
    """
    for held in properties:
        found = {int(match[1]): str(kind) for name, kind in held.items()
                 if (match := SCALE.match(name))}  # fmt: skip
        stated = held.get("NI_Number_Of_Scales", max(found, default=-1) + 1)
        if not isinstance(stated, int) or not 0 <= stated <= MOST_SCALES:
            return (
                f"The channel states {stated} scalings, expected 0 to {MOST_SCALES}.",
                "Copy the file again from the bench; it may be damaged.",
            )
        if stated == 0 or held.get("NI_Scaling_Status") == "scaled":
            continue
        unknown = [kind for kind in found.values() if kind not in (*KINDS, *SUMS)]
        if unknown or sum(kind in SUMS for kind in found.values()) > MOST_SUMS:
            return (
                f"The scaling {', '.join(unknown or SUMS)} is not read.",
                "Export the channel with its physical values.",
            )
        return None
    return None
