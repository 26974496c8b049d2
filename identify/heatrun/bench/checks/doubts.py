"""Warnings after which a record's numbers may be those of something else than they are called."""

from __future__ import annotations

from collections.abc import Sequence

from ..record import Finding

SIMULATED = "simulated_by_heatrun"

DOUBTS = {
    SIMULATED: "it was simulated by heatrun, not measured",
    "unit_suspected": "a column may be in another unit",
    "units_temperature": "a temperature may be in another unit",
    "losses_absurd": "its losses are beyond those of known machines",
    "losses_below_copper": "its losses are at times below the copper loss",
    "current_amplitude": "its current may be an amplitude",
    "current_maybe_amplitude": "its current may be an amplitude",
    "current_maybe_rms": "its d and q currents may be rms values",
    "columns_disagree": "two of its columns disagree",
    "column_used_twice": "one column stands for two channels",
    "ambient_implausible": "its sink temperature is unusual",
}
"""Id to what is in doubt, said of the record."""


def doubts(findings: Sequence[Finding]) -> dict[str, list[str]]:
    """Return what is in doubt about the inputs, with the ids that say so.

    Args:
        findings: About one record; only warnings count, since errors forbid a calibration.
    """
    ids = {one.id for one in findings if one.severity == "warning"}
    found: dict[str, list[str]] = {}
    for id, words in DOUBTS.items():
        if id in ids:
            found.setdefault(words, []).append(id)
    return found
