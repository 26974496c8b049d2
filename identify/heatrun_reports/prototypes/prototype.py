"""A prototype of a comparison: its role, and the record that stands for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from heatrun.bench.checks.samples import sink_channel
from heatrun.bench.joined import parts_of, read_test
from heatrun.bench.record import Record
from heatrun.errors import InputError, UsageError
from heatrun.motor import Motor

from ..analysis.drive import has
from ..reference import Reference, read_reference, reference_of_run
from ..simulated import Simulated, simulate_run


@dataclass(frozen=True)
class Prototype:
    """One prototype.

    Attributes:
        role: As given on the command line, such as `"semi-real"`.
        reference: Its record with bands, and what is known of how it came about.
        simulated: The prediction, where a run stands for it.
        driven_by: Role of the record that drove that run; empty for a file.
    """

    role: str
    reference: Reference
    simulated: Simulated | None = None
    driven_by: str = ""

    @property
    def record(self) -> Record:
        """The record on its own clock."""
        return self.reference.record

    @property
    def is_simulated(self) -> bool:
        """Whether it is a simulation, by heatrun or, as its role says, by another program."""
        return self.reference.is_simulated


def read_prototypes(roles: Sequence[tuple[str, Path]], motor: Motor) -> tuple[Prototype, ...]:
    """Read the record of each prototype; a run is driven by the first measured one that can.

    Args:
        roles: Role and file of each; the folder of a run stands for a virtual prototype.
        motor: The machine.

    Returns:
        In the order given.

    Raises:
        InputError: If a file or run cannot be read.
        UsageError: If there is a run and no measured record to drive it.
    """
    records = {
        role: Prototype(role, replace(_read(path, motor), is_model=is_virtual(role)))
        for role, path in roles
        if not path.is_dir()
    }
    measured = [p for p in records.values() if not p.is_simulated]
    driver = next((p for p in measured if drives(p.record, motor)), next(iter(measured), None))
    found = []
    for role, path in roles:
        if role in records:
            found.append(records[role])
            continue
        if driver is None:
            raise UsageError(f"{role}: a run needs a measured record among the others to drive it.")
        simulated = simulate_run(path, driver.record, motor)
        reference = reference_of_run(simulated, path, motor)
        found.append(Prototype(role, reference, simulated, driver.role))
    return tuple(found)


def is_virtual(role: str) -> bool:
    """Return whether a role is that of a model."""
    return role.lower().startswith("virtual")


def drives(record: Record, motor: Motor) -> bool:
    """Return whether a record holds what drives a network: current, losses and sink."""
    return has(record, "phase_current_A", "losses_W", sink_channel(motor))


def _read(path: Path, motor: Motor) -> Reference:
    """A file that is there is read with its bands; any other word is a test of several files."""
    if not path.exists():
        return Reference(read_test(path, motor))
    reference = read_reference(path, motor)
    first, *others = parts_of(reference.record, motor)
    if others:
        raise InputError(
            f"The motor file uses {1 + len(others)} stretches of this test: "
            f"{', '.join(part.stretch for part in (first, *others))}.",
            where=str(path),
            remedy=f"Name the one that is meant, such as {path}@{first.stretch}.",
        )
    # a band is on the axis of the whole file
    return reference if reference.bands else replace(reference, record=first)
