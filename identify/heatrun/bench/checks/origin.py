"""Whether a record was measured at all."""

from __future__ import annotations

from ...motor import Motor
from ..own_files import is_simulated
from ..record import Finding, Record


def simulated_by_heatrun(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report a virtual record of heatrun's: its temperatures are a model's, and have no noise."""
    columns = (*record.unused, *(reading.column for reading in record.mapping))
    if not is_simulated(columns):
        return ()
    return (
        Finding(
            id="simulated_by_heatrun",
            severity="warning",
            message="Expected a measurement; the columns copper_loss_W, other_loss_W and flow_… "
            "are those of a virtual record that heatrun simulated. A calibration on it gives back "
            "the parameters that it was made with, and its intervals say nothing of a machine.",
            where=record.name,
            remedy="Name the bench file that the simulation was made from.",
        ),
    )
