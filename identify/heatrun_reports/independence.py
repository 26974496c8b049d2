"""What makes a comparison weaker than it looks: said on the first line of a report."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from heatrun.record.record import Record
from heatrun.runs.run import open_run

SIMULATED = ("copper_loss_W", "other_loss_W")
"""Columns that `heatrun simulate` writes, no bench measures and no channel claims."""


def is_simulated(record: Record) -> bool:
    """Return whether a record is a file that heatrun simulated."""
    return all(name in record.unused for name in SIMULATED)


def simulated_as(role: str, record: Record) -> str:
    """Return the sentence on a simulation in the place of a measured prototype; else nothing.

    Args:
        role: What it is given as.
        record: As read.
    """
    if not is_simulated(record):
        return ""
    return f"{record.name}, given as {role}, is a simulation by heatrun and no measured prototype."


def fitted_by(run: Path, record: Record) -> str:
    """Return the sentence on a record that a run was calibrated on; else nothing.

    Args:
        run: Its folder.
        record: The record that its network is held against.
    """
    test = open_run(run).fitted_as(record)
    if test is None:
        return ""
    return (
        f"{record.name} is the calibration test {test} of the run {run.name} (same SHA-256): its "
        "agreement with the network is no validation."
    )


def same_file(first: Record, second: Record) -> str:
    """Return the sentence on two records of the same bytes; else nothing."""
    digests = [{source.sha256 for source in record.sources} for record in (first, second)]
    if not digests[0] or digests[0] != digests[1]:
        return ""
    return f"{first.name} and {second.name} are the same file (same SHA-256)."


def before(sentences: Iterable[str], summary: str) -> str:
    """Return a summary with what must be said first before it, each sentence once."""
    return " ".join([*dict.fromkeys(s for s in sentences if s), summary])
