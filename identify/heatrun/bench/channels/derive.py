"""Channels that follow from measured ones: losses from powers, phase current from d and q."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

RAD_PER_S_PER_RPM = math.pi / 30.0

Channels = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Derivation:
    """One way to a channel that was not measured.

    Attributes:
        channel: What follows.
        needs: From which channels.
        compute: From these channels and the number of phases to the values, shape (time,).
        formula: For the note on the record.
    """

    channel: str
    needs: tuple[str, ...]
    compute: Callable[[Channels, int], np.ndarray]
    formula: str


def dq_power(channels: Channels, phases: int) -> np.ndarray:
    r"""Return the electrical power at the terminals [W], shape (time,).

    $$ P = \tfrac{m}{2} (u_d i_d + u_q i_q) $$

    Args:
        channels: With `u_d_V, u_q_V, i_d_A, i_q_A`.
        phases: Number of phases m [1].

    Valid for: the amplitude-invariant transform; harmonics of the inverter are not in it.
    """
    active = channels["u_d_V"] * channels["i_d_A"] + channels["u_q_V"] * channels["i_q_A"]
    return phases / 2.0 * active


def shaft_power(channels: Channels) -> np.ndarray:
    """Return the mechanical power [W], positive as a motor, shape (time,).

    Args:
        channels: With `torque_Nm` and `speed_rpm`.
    """
    return channels["torque_Nm"] * channels["speed_rpm"] * RAD_PER_S_PER_RPM


def recorded_shaft_power(channels: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the mechanical power [W], shape (time,), None where no channel tells it.

    Args:
        channels: Of a record; NaN marks a sample that it does not have.
    """
    power = channels.get("mechanical_power_W")
    if power is None and all(name in channels for name in SHAFT):
        power = shaft_power(channels)
    return power if power is not None and np.any(np.isfinite(power)) else None


def _rms_current(channels: Channels, phases: int) -> np.ndarray:
    return np.hypot(channels["i_d_A"], channels["i_q_A"]) / math.sqrt(2.0)


SHAFT = ("torque_Nm", "speed_rpm")
DQ = ("u_d_V", "u_q_V", "i_d_A", "i_q_A")
WITH_INVERTER = "; the losses of the inverter are in it"
AMPLITUDE_INVARIANT = ", amplitude-invariant"

DERIVATIONS: tuple[Derivation, ...] = (
    Derivation(
        "phase_current_A",
        ("i_d_A", "i_q_A"),
        _rms_current,
        f"sqrt(i_d² + i_q²)/sqrt(2){AMPLITUDE_INVARIANT}",
    ),
    Derivation(
        "losses_W",
        ("electrical_power_W", "mechanical_power_W"),
        lambda channels, _: channels["electrical_power_W"] - channels["mechanical_power_W"],
        "electrical_power_W - mechanical_power_W",
    ),
    Derivation(
        "losses_W",
        ("electrical_power_W", *SHAFT),
        lambda channels, _: channels["electrical_power_W"] - shaft_power(channels),
        "electrical_power_W - torque·omega",
    ),
    Derivation(
        "losses_W",
        (*DQ, *SHAFT),
        lambda channels, phases: dq_power(channels, phases) - shaft_power(channels),
        f"phases/2·(u_d·i_d + u_q·i_q) - torque·omega{AMPLITUDE_INVARIANT}",
    ),
    Derivation(
        "losses_W",
        ("dc_power_W", *SHAFT),
        lambda channels, _: channels["dc_power_W"] - shaft_power(channels),
        f"dc_power_W - torque·omega{WITH_INVERTER}",
    ),
    Derivation(
        "losses_W",
        ("dc_voltage_V", "dc_current_A", *SHAFT),
        lambda channels, _: (
            channels["dc_voltage_V"] * channels["dc_current_A"] - shaft_power(channels)
        ),
        f"dc_voltage_V·dc_current_A - torque·omega{WITH_INVERTER}",
    ),
)
"""In order of preference; the losses nearest to the machine come first."""


def derive(
    channels: Channels, *, phases: int = 3, losses: Literal["balance", "map"] = "balance"
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the channels with those that follow from them, and a note on each of these.

    A channel that is there is never replaced.

    Args:
        channels: Canonical channels, shape (time,) each.
        phases: Number of phases [1].
        losses: Meaning of `losses_W`, as in `heatrun.motor.Motor`. A `"map"` is no balance of
            powers, so nothing is derived for it.
    """
    derived = dict(channels)
    notes = []
    for way in DERIVATIONS:
        if way.channel in derived or not all(name in channels for name in way.needs):
            continue
        if way.channel == "losses_W" and losses == "map":
            continue
        derived[way.channel] = way.compute(channels, phases)
        notes.append(f"{way.channel} is derived: {way.formula}.")
    return derived, tuple(notes)


def formulas(channels: Collection[str], read: Collection[str]) -> dict[str, str]:
    """Return the formula of each channel that was derived, in the order of preference.

    Args:
        channels: Canonical names that a record has.
        read: Those of them that were columns of a file.
    """
    found: dict[str, str] = {}
    for way in DERIVATIONS:
        is_derived = way.channel in channels and way.channel not in read
        if is_derived and way.channel not in found and all(name in read for name in way.needs):
            found[way.channel] = way.formula
    return found
