"""At standstill all losses are copper losses: a check of the scales of current and losses.

A machine that turns hides an error of the current's scale: the copper loss changes with its square,
and the other losses take up the difference. At standstill there are no others (direct current or a
few hertz), so that current, losses and phase resistance must agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...io.quantities import off_by, part_of
from ...motor import Motor
from ..channels.by_resistance import resistance_sd
from ..channels.derive import WITH_INVERTER, constants_of, dq_power, formulas
from ..record import Finding, Record
from .balance_errors import BLOCK_S, STANDSTILL_RPM
from .samples import block_means, is_loaded, place, runs, samples

LASTS_S = 180.0
"""Shortest stretch that counts [s]: the filters of power meters and the regulation have settled."""

CURRENT_SD = 0.005
"""Of the current [1]: transducer and analyser of class 0.5 together; the loss has twice that."""

POWER_SD = 0.01
"""Of power, and of a voltage over a current [1]: class 0.5 at the small power factor and the low
voltage that a machine at standstill needs."""

RANGE_SD = 0.0005
"""Of power, in parts of the largest power of the record [1]: offset of an analyser of class 0.05
that keeps the range which the loaded machine needs."""

SENSOR_SD_K, SENSOR_SD_SHARE = 1.0, 0.05
"""Winding sensor against the mean of the winding [K], and in parts of the rise over the lowest
reading [1]: a sensor in the end winding reads more, one in the slot less."""

DQ = "u_d·i_d"
"""In the formula of losses that are derived from voltages and currents in d and q."""

DECISIVE = 2.0
"""Standard deviations from one that make the finding a warning [1]."""

FAR = 10.0
"""Ratio from which a unit is wrong and not an instrument [1]."""


@dataclass(frozen=True)
class Agreement:
    """What current and resistance say of the power, over all stretches at standstill.

    Attributes:
        ratio: Measured over expected [1].
        sd: Its standard deviation, of the instruments and of scatter [1].
        from_s: Begin of the first stretch [s].
        to_s: End of the last one [s].
        lasts_s: Time of all stretches together [s].
        current_A: Root mean square of the current [A].
    """

    ratio: float
    sd: float
    from_s: float
    to_s: float
    lasts_s: float
    current_A: float

    @property
    def agrees(self) -> bool:
        """Whether the ratio is one within two standard deviations."""
        return abs(self.ratio - 1.0) <= DECISIVE * self.sd


def standstill_losses(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report how losses and current agree with the phase resistance while the machine stands still.

    Needs the speed, `phase_resistance_ohm`, and three minutes under current in one stretch. Losses
    from a map are no measurement, and those behind an inverter hold its own. Where the record has
    voltages and currents in d and q that the losses do not come from, their quotient is checked in
    the same way.
    """
    found = []
    losses = _of_losses(record, motor)
    if losses is not None:
        # in losses from d and q the same current stands once more
        power = 1.0 if DQ in _formula(record) else 2.0
        found.append(_finding(record, motor, losses, "losses_W", "the losses", power))
    quotient = _of_voltage(record, motor)
    if quotient is not None:
        what = "the powers of voltage and current in d and q"
        found.append(_finding(record, motor, quotient, "u_q_V", what, 1.0))
    return tuple(found)


def current_scale_unchecked(motor: Motor, records: Sequence[Record]) -> tuple[Finding, ...]:
    """Return the note that no test can show an error of the current's scale; empty if one can.

    Args:
        motor: The machine.
        records: All tests of a calibration.
    """
    has_copper_loss = motor.phase_resistance_ohm is not None or "Rs0" in motor.parameters
    if not has_copper_loss or any(standstill_losses(record, motor) for record in records):
        return ()
    return (
        Finding(
            "current_scale_unchecked",
            "note",
            "No test has three minutes at standstill under current, so that an error of the "
            "current's scale cannot be seen: 1 % of it changes the copper loss by 2 %, and the "
            "winding's Ceq_w and Req_w with it. The 95 % intervals allow for the class of the "
            "instrument that current_gain states, no more.",
            motor.path or motor.name,
            "A few minutes at standstill with a known direct current would show it, or the input "
            "power by a second instrument. Another class goes into [parameters.current_gain] sd.",
        ),
    )


def _of_losses(record: Record, motor: Motor) -> Agreement | None:
    """Losses over copper loss."""
    if motor.losses != "balance" or motor.phase_resistance_ohm is None:
        return None
    if WITH_INVERTER in _formula(record):
        return None
    columns = samples(record, "speed_rpm", "phase_current_A", "losses_W", "winding_degC")
    time_s, speed, current, losses, winding = columns
    expected = motor.copper_loss_W(current, winding)
    return _agreement(
        record, motor, time_s, speed, losses, expected, current, winding,
        np.hypot(POWER_SD, 2.0 * CURRENT_SD),
    )  # fmt: skip


def _of_voltage(record: Record, motor: Motor) -> Agreement | None:
    """Voltage over current, as the power that it stands for."""
    if motor.phase_resistance_ohm is None or DQ in _formula(record):
        return None
    names = ("speed_rpm", "winding_degC", "u_d_V", "u_q_V", "i_d_A", "i_q_A")
    time_s, speed, winding, *axes = samples(record, *names)
    if time_s.size == 0:
        return None
    channels: dict[str, np.ndarray] = dict(zip(names[2:], axes, strict=True))
    current = np.hypot(channels["i_d_A"], channels["i_q_A"]) / np.sqrt(2.0)
    expected = motor.copper_loss_W(current, winding)
    power = dq_power(channels, motor.phases)
    # one current stands in both powers: its error enters once
    return _agreement(
        record, motor, time_s, speed, power, expected, current, winding,
        np.hypot(POWER_SD, CURRENT_SD),
    )  # fmt: skip


def _formula(record: Record) -> str:
    """Return how the losses were derived, empty if they were measured."""
    read = {one.channel for one in record.mapping if one.unit_from != "derived"}
    given = read | constants_of(record.notes)
    return formulas(record.channels, given).get("losses_W", "")


def _agreement(
    record: Record,
    motor: Motor,
    time_s: np.ndarray,
    speed: np.ndarray,
    measured: np.ndarray,
    expected: np.ndarray,
    current: np.ndarray,
    winding: np.ndarray,
    instruments: float,
) -> Agreement | None:
    """Compare two powers over the stretches at standstill; None if there is none."""
    if time_s.size < 2:
        return None
    at, speed, power, copper, squared, temperature = block_means(
        time_s, BLOCK_S, np.abs(speed), measured, expected, current**2, winding
    )
    stands = (speed < STANDSTILL_RPM) & is_loaded(copper)
    kept = np.zeros(stands.size, dtype=bool)
    for first, past in zip(*runs(stands), strict=True):
        # the blocks at either end may hold a part of what came before or after
        if at[past - 1] - at[first] + BLOCK_S >= LASTS_S and past - first > 3:
            kept[first + 1 : past - 1] = True
    if not kept.any():
        return None
    total = float(np.sum(copper[kept]))
    ratio = float(np.sum(power[kept])) / total
    scatter = float(np.std(power[kept] - ratio * copper[kept])) * np.sqrt(kept.sum()) / total
    mean = total / float(kept.sum())
    largest = max(float(np.quantile(np.abs(_largest_power(record, measured)), 0.99)), mean)
    warm = temperature[kept].mean() - temperature.min()
    sensor_K = np.hypot(SENSOR_SD_K, SENSOR_SD_SHARE * warm)
    of_temperature = sensor_K / (motor.resistance_coefficient_degC + temperature[kept].mean())
    parts = (instruments, resistance_sd(motor), of_temperature, RANGE_SD * largest / mean, scatter)
    sd = float(np.sqrt(sum(part**2 for part in parts)))
    if not np.isfinite([ratio, sd]).all():
        return None
    where = np.flatnonzero(kept)
    return Agreement(
        ratio=ratio,
        sd=sd,
        from_s=float(at[where[0]]),
        to_s=float(at[where[-1]]),
        lasts_s=float(kept.sum()) * BLOCK_S,
        current_A=float(np.sqrt(np.mean(squared[kept]))),
    )


def _largest_power(record: Record, measured: np.ndarray) -> np.ndarray:
    """Return the largest power that the record holds, whose range the analyser may have kept."""
    for name in ("electrical_power_W", "mechanical_power_W"):
        values = samples(record, name)[1]
        if values.size:
            return values
    return measured


def _leads(ratio: float) -> str:
    """Return what leads would take of the power, empty where there is none to take."""
    if ratio <= 1.0:
        return ""
    return (
        " Leads and contacts between the power meter and the winding would explain it by taking "
        f"{100.0 * (1.0 - 1.0 / ratio):.0f} % of the power: they heat no node of the network. "
        'Where only the copper is loaded, write losses = "map" and [constants] losses_W = 0.'
    )


def _finding(
    record: Record, motor: Motor, seen: Agreement, channel: str, what: str, power: float
) -> Finding:
    expected = "phases·R(T)·I²"
    band = 100.0 * DECISIVE * seen.sd
    stretch = f"over {seen.lasts_s / 60.0:.0f} min at {seen.current_A:.4g} A"
    where = place(record, channel, seen.from_s, seen.to_s)
    values = {
        "ratio": seen.ratio,
        "ratio_sd": seen.sd,
        "current_A": seen.current_A,
        "from_s": seen.from_s,
        "to_s": seen.to_s,
    }
    if seen.agrees:
        return Finding(
            "standstill_losses",
            "note",
            f"At standstill, {stretch}, {what} are {seen.ratio:.3f} of {expected}; the instruments "
            f"allow {band:.1f} % (95 %). This test checks the scale of current, losses and phase "
            "resistance together to that.",
            where,
            values=values,
        )
    is_of_units = not 1.0 / FAR < seen.ratio < FAR
    they_are = part_of(seen.ratio, "it") if is_of_units else f"{seen.ratio:.3f} of it"
    first = (
        f"Check the units of {what} and phase_current_A: instruments are not off by so much."
        if is_of_units
        else "Compare phase_current_A with a second instrument (reading "
        f"{off_by(seen.ratio ** (-1.0 / power))} explains this: {power:.0f} % per 1 %)."
    )
    leads = "" if is_of_units else _leads(seen.ratio)
    # a rotor that is said to be locked says nothing of direct current
    is_said = "speed_rpm" in constants_of(record.notes) and motor.phases > 1
    may_alternate = is_said and seen.ratio > 1.0 and not is_of_units
    if may_alternate:
        first = (
            "Nothing need be done where the rotor is locked under alternating current: its bars "
            f"and the iron take the rest. Under direct current: {first[:1].lower()}{first[1:]}"
        )
    return Finding(
        "standstill_losses",
        "note" if may_alternate else "warning",
        f"Expected {what} equal to {expected} at standstill within {band:.1f} % (95 %, of the "
        f"instruments and Rs0); {stretch} they are {they_are}. The copper loss of the "
        "loaded tests, and with it Ceq_w and Req_w, is off by as much if the current or "
        "phase_resistance_ohm is the cause.",
        where,
        f"{first} Then compare {what} and phase_resistance_ohm with its temperature.{leads} "
        "With direct current the phases do not share it equally: phase_current_A must be the rms "
        "of the three.",
        values=values,
    )
