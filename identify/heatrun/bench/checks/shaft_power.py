"""Torque and electrical power against each other: errors of a balance that the inputs show."""

from __future__ import annotations

from ...motor import Motor
from ..record import Finding, Record
from .balance_errors import Told, prior_of, told_by_inputs
from .samples import place

UNITS = {"shaft_power_gain": "", "shaft_power_offset": " W", "torque_offset": " N m"}


def shaft_power_disagrees(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report errors of torque and powers that contradict their priors, and what is done about them.

    Needs losses from a balance, current, speed, torque or mechanical power, and a load in both
    directions, rotation in both directions, or a standstill without current.
    """
    return tuple(_finding(record, motor, told) for told in told_by_inputs(record, motor))


def _finding(record: Record, motor: Motor, told: Told) -> Finding:
    prior = prior_of(motor, told.name, 0.0)
    key, unit = f"[parameters.{told.name}]", UNITS[told.name]
    if prior.is_fixed:
        taken = f" The motor file holds {told.name} at {prior.centre:.3g}{unit} all the same."
        remedy = f"Without fixed in {key}, this test would take it from its inputs."
    else:
        taken = (
            f" This test takes {told.name} = {told.mean:.3g} ± {told.sd:.1g}{unit} from its inputs,"
            " for itself alone; no temperature is used."
        )
        remedy = (
            f"To take the signals as they are, write fixed = 0 into {key}; for one value of all "
            f"tests, from their temperatures, sd = {abs(told.mean):.1g}."
        )
    return Finding(
        "shaft_power_disagrees",
        "warning",
        told.seen + taken,
        place(record, "losses_W", *map(float, record.time_s[[0, -1]])),
        f"Check gain and zero of the torque transducer and of the power meter. {remedy}",
        values={told.name: told.mean, "sd": told.sd, **told.values},
    )
