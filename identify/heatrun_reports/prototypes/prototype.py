"""A prototype of a comparison: its role, its record, and one network against each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from heatrun.errors import InputError, UsageError
from heatrun.readers.joined import parts_of, read_test
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import sink_channel

from ..analysis.drive import has
from ..analysis.validation import SignalComparison, Validation, validate
from ..simulated import Reference, Simulated, read_reference, reference_of_run, simulate_run


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


@dataclass(frozen=True)
class OnNetwork:
    """A prototype's temperatures against the network's prediction.

    Attributes:
        prototype: The measured one.
        driven_by: Role whose currents, losses and sink drove the network.
        is_seen: Whether the run was calibrated on the record that is judged.
        simulated: The prediction.
        validation: Measured less predicted, on the prototype's clock.
    """

    prototype: Prototype
    driven_by: str
    is_seen: bool
    simulated: Simulated
    validation: Validation

    @property
    def temperatures(self) -> tuple[SignalComparison, ...]:
        """The temperatures that are judged."""
        return self.validation.judged


def judge_network(
    run: Path,
    prototypes: Sequence[Prototype],
    shift_s: Mapping[str, float],
    motor: Motor,
    tolerances: Mapping[str, float] | None = None,
) -> tuple[tuple[OnNetwork, ...], tuple[Finding, ...]]:
    """Judge one network on every measured prototype.

    A record without current, losses or sink is judged by the network that the first record with
    them drives, shifted to its clock: both drove the same manoeuvre.

    Args:
        run: Folder of the calibration.
        prototypes: All of the comparison.
        shift_s: What is added to each clock to give the base's [s], by role.
        motor: The machine.
        tolerances: As `confront`.

    Returns:
        What was judged, and why the rest was not.

    Raises:
        InputError: If the run cannot be read, or a prediction leaves all temperatures.
    """
    measured = [p for p in prototypes if not p.is_simulated]
    drivers = [p for p in measured if drives(p.record, motor)]
    found, findings = [], []
    driven: dict[str, Simulated] = {}
    for prototype in measured:
        if not drivers or not has(prototype.record, "winding_degC"):
            load = "current, losses and sink, as do all the others"
            lacking = "winding_degC" if drivers else load
            findings.append(_not_judged(prototype, lacking))
            continue
        driver = prototype if prototype in drivers else drivers[0]
        if driver.role not in driven:
            driven[driver.role] = simulate_run(run, driver.record, motor)
        simulated = driven[driver.role]
        reference = replace(reference_of_run(simulated, run, motor), inputs=frozenset())
        offset_s = shift_s[driver.role] - shift_s[prototype.role]
        temperatures = [c for c in prototype.record.channels if c.endswith("_degC")]
        thermal = {c: prototype.record[c] for c in ("time_s", *temperatures)}
        validation = validate(
            replace(prototype.record, channels=thermal), reference, motor,
            tolerances=tolerances, offset_s=offset_s,
        )  # fmt: skip
        is_seen = simulated.is_seen and driver is prototype
        found.append(OnNetwork(prototype, driver.role, is_seen, simulated, validation))
    return tuple(found), tuple(findings)


def _not_judged(prototype: Prototype, lacking: str) -> Finding:
    return Finding(
        "network_not_judged",
        "warning",
        f"The network is not judged on {prototype.role}: it lacks {lacking}.",
        prototype.record.name,
        "Map the columns in the motor file, or record them.",
        prototype.record.name,
    )


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
