"""Thermal Behaviour Analysis: temperatures, losses, equilibrium, and the network beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import has
from heatrun.runs.equilibrium import Equilibrium, equilibria

from ..report import NOT_OF_THE_MACHINE
from ..simulated import Simulated, simulate_run
from .drive import LossSplit, split_losses

if TYPE_CHECKING:
    from heatrun.runs.machine import SteadyNetwork


@dataclass(frozen=True)
class ThermalBehaviour:
    """What a test says of the machine's temperatures.

    Attributes:
        temperatures: Channels that were measured, in their canonical order.
        losses: Split of the losses, or None with a finding.
        settled: For each part of the machine, each stretch of constant load.
        simulated: After a run, or None.
        steady: Where the network of the run comes to rest under the load of the last stretch, if
            the winding did not get there; else None.
        findings: Doubts, and what could not be determined.
    """

    temperatures: tuple[str, ...]
    losses: LossSplit | None
    settled: tuple[Equilibrium, ...]
    simulated: Simulated | None
    findings: tuple[Finding, ...]
    steady: SteadyNetwork | None = None

    @property
    def allows_calibration(self) -> bool:
        """Whether no check forbids a fit."""
        return all(finding.severity != "error" for finding in self.findings)


def thermal_behaviour(record: Record, motor: Motor, run: Path | None = None) -> ThermalBehaviour:
    """Analyse the temperatures of a test.

    Args:
        record: Any record with a temperature of the machine.
        motor: The machine.
        run: Folder of a calibration whose network is set beside the measurement; None for none.

    Raises:
        InputError: If no temperature was measured, or a run was given and cannot be simulated.
    """
    temperatures = tuple(c for c in record.channels if c.endswith("_degC") and has(record, c))
    parts = [c for c in temperatures if c not in NOT_OF_THE_MACHINE]
    if not parts:
        raise InputError(
            "Expected a temperature of the machine, such as winding_degC; the channels are "
            f"{', '.join(record.channels)}.",
            where=record.name,
            remedy='Map it in the motor file: [columns] winding_degC = "T_winding [degC]".',
        )
    findings = list(check_record(record, motor))
    losses = None
    try:
        losses = split_losses(record, motor)
    except InputError as error:
        findings.append(
            Finding("no_loss_split", "warning", error.problem, error.where, error.remedy,
                    record.name)
        )  # fmt: skip
    simulated = None if run is None else simulate_run(run, record, motor)
    if simulated is not None and simulated.motor_name != motor.name:
        findings.append(
            Finding(
                "run_of_other_motor",
                "warning",
                f"The run was calibrated for {simulated.motor_name!r}, the motor file is of "
                f"{motor.name!r}.",
                str(run),
                "Pass a run of this motor, unless only the name has changed.",
                record.name,
            )
        )
    settled = tuple(each for c in parts for each in equilibria(record, motor, c))
    return ThermalBehaviour(
        temperatures=temperatures,
        losses=losses,
        settled=settled,
        simulated=simulated,
        findings=tuple(findings),
        steady=_steady(simulated, settled),
    )


def _steady(simulated: Simulated | None, settled: tuple[Equilibrium, ...]) -> SteadyNetwork | None:
    """The network at rest, where the winding was stopped before it on a load that was held."""
    of_winding = [each for each in settled if each.channel == "winding_degC"]
    if simulated is None or not of_winding:
        return None
    last = of_winding[-1]
    if last.is_reached is True or not last.is_held or last.stretch is None:
        return None
    from heatrun.runs.machine import steady_of_network

    return steady_of_network(simulated.prediction, last.stretch)
