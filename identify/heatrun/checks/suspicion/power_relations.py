"""Relations between powers, and between speeds, that no machine breaks.

One relation of physics that a record breaks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...io.quantities import rounded
from ...record.derive import ELECTRICAL, SHAFT, shaft_power
from ...record.motor import Motor
from ...record.record import Record
from ...record.samples import block_means, samples
from ..losses import COPPER_TOLERANCE, copper_shares


@dataclass(frozen=True)
class Conflict:
    """A relation that a record breaks.

    Attributes:
        id: Short name.
        sentence: What was expected and what came.
        channels: The channels between which it holds.
        is_odd: It may be so in a rare machine or test; it counts only where one reading repairs it.
        is_mild: Something else than a unit would explain it too, such as another kind of cooling.
        values: Figures behind it by name with unit suffix.
        otherwise: What to do if no unit is wrong, a sentence.
    """

    id: str
    sentence: str
    channels: tuple[str, ...]
    is_odd: bool
    values: Mapping[str, float]
    is_mild: bool = False
    otherwise: str = ""


LOW_EFFICIENCY = 0.12
"""Best efficiency [1] at which an error of 2 pi/60 in the shaft's power may hide: 1.15/9.55."""

USUAL_EFFICIENCY = 0.5
LOSSES_AGREE = 3.0
"""Factor [1] between losses and the difference of powers; what bearings, the inverter or a
factory calibration leave out is less."""

LEAST_DIFFERENCE = 0.03
"""Below this share of the power [1] the difference of two powers is one of their errors."""

LOST_BEHIND_DC = 0.5
"""Share of the DC power [1] that neither the shaft nor the machine's losses take, above which an
inverter is a poor one; at standstill it may be."""

USUAL_BEHIND_DC = 0.3
"""And below which it must fall where another reading is to repair it; small drives reach it."""

LEAST_LOSSES = 0.003
"""Losses over shaft power [1]: the largest generators reach an efficiency of 99 %, no machine
99.7."""

USUAL_LOSSES = 0.01
"""And what another reading that is to repair it must reach."""

TURNS = 0.95
"""Share of the loaded time [1] in which the shaft must turn the same way: at standstill its power
is the noise of two instruments, whatever the unit."""

FAST_OVER_RATED = 4.0
"""Speed over rated speed [1]; field weakening ends at three to four."""

KINEMATIC = 0.5
"""Relative difference [1] between the shaft's speed and the wheel's times the gear; a slipping
wheel or a worn tyre makes less."""


def power_conflicts(record: Record, motor: Motor, is_strict: bool) -> list[Conflict]:
    """Return what is broken between electrical power, the shaft's, and the losses."""
    rods = ("mechanical_power_W",) if "mechanical_power_W" in record else SHAFT
    if not all(rod in record for rod in rods):
        return []
    shaft = record[rods[0]] if len(rods) == 1 else shaft_power(record.channels)
    powers = {"time_s": record.time_s, "shaft": np.asarray(shaft, dtype=float)}
    # losses that were derived from the powers agree with them
    is_read = not record.mapping or any(one.channel == "losses_W" for one in record.mapping)
    if motor.losses == "balance" and "losses_W" in record and is_read:
        powers["losses"] = record["losses_W"]
    lossless = _lossless(powers, rods, is_strict)
    way = next((one for one in ELECTRICAL if one.is_open(record.channels)), None)
    if way is None:
        return lossless
    powers["electrical"] = np.asarray(way.compute(record.channels, motor.phases), dtype=float)
    is_dc, channels = way.channel == "dc_power_W", (*way.needs, *rods)
    found = _efficiency(record, motor, powers, channels, is_strict)
    found += _difference(powers, channels, is_dc)
    found += _behind_dc(powers, channels, is_strict) if is_dc else []
    # What says that power comes from nothing says this too.
    return found if any(c.id == "power_from_nothing" for c in found) else [*found, *lossless]


def _blocks(powers: Mapping[str, np.ndarray], *names: str) -> tuple[np.ndarray, ...]:
    """Block means of powers where all of them are known; empty of fewer than three samples."""
    time_s, *columns = samples(Record("", powers), *names)
    if time_s.size < 3:
        return (np.empty(0),) * len(names)
    return block_means(time_s, max(10.0, float(np.ptp(time_s)) / 200.0), *columns)[1:]


def _is_high(power: np.ndarray) -> np.ndarray:
    """Where a power is no small part of its largest, so that its ratios mean something."""
    return power > 0.3 * float(np.max(power, initial=0.0))


def _efficiency(
    record: Record,
    motor: Motor,
    powers: Mapping[str, np.ndarray],
    channels: tuple[str, ...],
    is_strict: bool,
) -> list[Conflict]:
    """Power of the shaft against electrical power."""
    electrical, shaft = _blocks(powers, "electrical", "shaft")
    # As a generator the roles are exchanged.
    given = np.where(electrical + shaft > 0.0, electrical, -shaft)
    taken = np.where(electrical + shaft > 0.0, shaft, -electrical)
    loaded = _is_high(given)
    if not loaded.any():
        return []
    ratio = taken[loaded] / given[loaded]
    typical, best = float(np.median(ratio)), float(np.quantile(ratio, 0.9))
    values = {"efficiency": best}
    if typical > 1.0 + COPPER_TOLERANCE:
        sentence = f"Expected an efficiency below 1; it is {rounded(typical)}."
        return [Conflict("power_from_nothing", sentence, channels, False, values)]
    if not 1e-6 < best < (USUAL_EFFICIENCY if is_strict else LOW_EFFICIENCY):
        return []
    _, copper = copper_shares(record, motor)
    if copper.size >= 3 and float(np.median(copper)) >= 0.3:
        return []  # it is the copper that takes the power
    sentence = f"The highest efficiency is only {rounded(best, 2)}."
    return [Conflict("little_efficiency", sentence, channels, True, values)]


def _lossless(
    powers: Mapping[str, np.ndarray], rods: tuple[str, ...], is_strict: bool
) -> list[Conflict]:
    """Losses that were recorded against the power of the shaft."""
    shaft, losses = _blocks({**powers, "shaft": np.abs(powers["shaft"])}, "shaft", "losses")
    driven = _is_high(shaft)
    loaded = driven & (losses > 0.0)
    if np.sum(loaded) < max(3, 0.5 * np.sum(driven)):
        return []
    share = float(np.median(losses[loaded] / shaft[loaded]))
    least = USUAL_LOSSES if is_strict else LEAST_LOSSES
    if share >= least:
        return []
    sentence = (
        f"Expected losses above {100.0 * least:.1f} % of the shaft's power of "
        f"{rounded(float(np.median(shaft[loaded])))} W; they are {100.0 * share:.2f} % of it."
    )
    values = {"losses_over_shaft": share}
    return [Conflict("too_efficient", sentence, ("losses_W", *rods), False, values)]


def _behind_dc(
    powers: Mapping[str, np.ndarray], channels: tuple[str, ...], is_strict: bool
) -> list[Conflict]:
    """DC power against what the shaft and the recorded losses take of it."""
    electrical, shaft, losses = _blocks(powers, "electrical", "shaft", "losses")
    loaded = _is_high(electrical)
    if np.sum(loaded) < 3 or np.mean(shaft[loaded] > 0.0) < TURNS:
        return []
    share = float(np.median((1.0 - (shaft + losses) / electrical)[loaded]))
    if share <= (USUAL_BEHIND_DC if is_strict else LOST_BEHIND_DC):
        return []
    sentence = (
        f"Shaft power and losses_W account for {100.0 * (1.0 - share):.0f} % of the DC power only."
    )
    values = {"share_to_inverter": share}
    return [Conflict("lost_behind_dc", sentence, ("losses_W", *channels), True, values)]


def _difference(
    powers: Mapping[str, np.ndarray], channels: tuple[str, ...], is_dc: bool
) -> list[Conflict]:
    """Losses that were recorded against the difference of recorded powers."""
    electrical, shaft, losses = _blocks(powers, "electrical", "shaft", "losses")
    difference = electrical - shaft
    larger = np.maximum(np.abs(electrical), np.abs(shaft))
    is_known = (losses > 0.0) & (difference > LEAST_DIFFERENCE * larger) & _is_high(larger)
    if np.sum(is_known) < 3:
        return []
    ratio = float(np.median(losses[is_known] / difference[is_known]))
    # Behind an inverter the difference also holds the inverter's losses: it may be the larger one.
    if (0.0 if is_dc else 1.0 / LOSSES_AGREE) <= ratio <= LOSSES_AGREE:
        return []
    sentence = (
        f"Expected losses_W = electrical power - shaft power; it is {rounded(ratio)} times that."
    )
    values = {"losses_over_difference": ratio}
    return [Conflict("losses_disagree", sentence, ("losses_W", *channels), False, values)]


def speed_conflicts(record: Record, motor: Motor) -> Iterator[Conflict]:
    """Return what is broken between the speed, the rated speed and the vehicle's."""
    speed = samples(record, "speed_rpm")[1]
    if speed.size and motor.rated_speed_rpm:
        ratio = float(np.quantile(np.abs(speed), 0.99)) / motor.rated_speed_rpm
        if ratio > FAST_OVER_RATED:
            sentence = f"The speed reaches {rounded(ratio)} times rated_speed_rpm."
            values = {"speed_over_rated": ratio}
            yield Conflict("too_quick", sentence, ("speed_rpm",), True, values)
    if motor.gear_ratio and motor.wheel_radius_m:
        _, speed, vehicle = samples(record, "speed_rpm", "vehicle_speed_km_per_h")
        wheel = vehicle / 3.6 / motor.wheel_radius_m * 30.0 / math.pi * motor.gear_ratio
        moving = np.abs(wheel) > 0.3 * float(np.max(np.abs(wheel), initial=0.0))
        if moving.any():
            ratio = float(np.median(np.abs(speed[moving] / wheel[moving])))
            if not 1.0 - KINEMATIC <= ratio <= 1.0 + KINEMATIC:
                sentence = (
                    f"The shaft turns at {rounded(ratio)} times wheel speed times gear ratio."
                )
                values = {"speed_over_wheel": ratio}
                channels = ("speed_rpm", "vehicle_speed_km_per_h")
                yield Conflict("wheel_disagrees", sentence, channels, False, values)
