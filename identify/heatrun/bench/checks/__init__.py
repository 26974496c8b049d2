"""Quality checks of bench records: one file for each family, one tuple that names them all.

A check takes a record and the motor and returns findings; it changes nothing and raises nothing,
whatever the record holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...motor import Motor
from ..record import Finding, Record
from .absurd import losses_absurd
from .course import ambient_moving, cut_while_warm, no_heating, start_not_in_equilibrium
from .excitation import single_step, too_short
from .heat import losses_absent, losses_of_dc_link
from .losses import current_amplitude, losses_below_copper, losses_negative
from .origin import simulated_by_heatrun
from .presence import missing_channel, nan_block, too_few_samples
from .resolution import resolution, truncation
from .same_quantity import columns_disagree
from .sensor import sensor_detached, temperature_jump
from .shaft_power import shaft_power_disagrees
from .standstill import current_scale_unchecked, standstill_losses
from .stillness import saturation, sensor_stuck
from .suspicion import referred, unit_suspected
from .time_axis import (
    is_sorted_otherwise,
    sampling,
    time_backwards,
    time_duplicate,
    time_gap,
    time_jitter,
)
from .units import ambient_implausible, unit_assumed, units_temperature

Check = Callable[[Record, Motor], tuple[Finding, ...]]

CHECKS: tuple[Check, ...] = (
    missing_channel,
    simulated_by_heatrun,
    too_few_samples,
    time_backwards,
    time_duplicate,
    time_gap,
    time_jitter,
    sampling,
    nan_block,
    units_temperature,
    unit_suspected,
    unit_assumed,
    ambient_implausible,
    sensor_stuck,
    sensor_detached,
    temperature_jump,
    saturation,
    resolution,
    truncation,
    losses_absurd,
    losses_negative,
    losses_below_copper,
    columns_disagree,
    current_amplitude,
    standstill_losses,
    losses_absent,
    losses_of_dc_link,
    shaft_power_disagrees,
    no_heating,
    start_not_in_equilibrium,
    cut_while_warm,
    ambient_moving,
    single_step,
    too_short,
)
"""Every check, named as the id of its findings, in the order in which they are reported."""


def check_record(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Return what is to be said about a record before anything is fitted to it.

    Args:
        record: Any record; it may lack channels, be empty, or be full of NaN.
        motor: The machine under test; says which channels are needed and what the losses are.

    Returns:
        The readers' own findings, then those of each check in the order of `CHECKS`, each carrying
        the name of the record. One of severity `"error"` forbids a fit.
    """
    shapes = {np.shape(column) for column in record.channels.values()}
    # Without a clock, or with columns of different length, no other check has anything to stand on.
    checks = CHECKS if "time_s" in record and len(shapes) == 1 else (missing_channel,)
    if checks is CHECKS and is_sorted_otherwise(record):
        checks = (missing_channel, time_backwards)  # all others follow from it
    # Overflow of absurd values yields inf or NaN, and comparisons with those say no.
    with np.errstate(all="ignore"):
        own = [finding for check in checks for finding in check(record, motor)]
    return tuple(
        finding if finding.test else replace(finding, test=record.name)
        for finding in (*record.findings, *referred(own))
    )


__all__ = ["CHECKS", "Check", "check_record", "current_scale_unchecked"]
