"""One thermal network against the winding of each prototype: on the bench and on the road."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from heatrun.bench.record import Finding
from heatrun.motor import Motor

from ..analysis.compare_signals import SignalComparison
from ..analysis.drive import has
from ..analysis.validation import Validation, validate
from ..reference import reference_of_run
from ..simulated import Simulated, simulate_run
from .prototype import Prototype, drives


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
