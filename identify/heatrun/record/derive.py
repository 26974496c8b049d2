"""Channels that follow from measured or stated ones: losses from powers, current from d and q."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial, reduce
from types import MappingProxyType
from typing import Literal

import numpy as np

RAD_PER_S_PER_RPM = math.pi / 30.0

Channels = Mapping[str, np.ndarray]


def _always(channels: Channels) -> bool:
    return True


@dataclass(frozen=True)
class Derivation:
    """One way to a channel that was not measured."""

    channel: str  # What follows.
    needs: tuple[str, ...]  # From which channels.
    # From these channels and the number of phases to the values, shape (time,).
    compute: Callable[[Channels, int], np.ndarray]
    formula: str  # For the note on the record.
    # Whether it is open with the values of these channels.
    holds: Callable[[Channels], bool] = _always

    @property
    def is_general(self) -> bool:
        """Whether it is open whatever values its channels have."""
        return self.holds is _always

    def is_open(self, channels: Channels) -> bool:
        """Return whether these channels hold what it needs."""
        return all(name in channels for name in self.needs) and self.holds(channels)


def dq_power(channels: Channels, phases: int) -> np.ndarray:
    r"""Return the electrical power at the terminals [W] by `DQ`, shape (time,).

    $$ P = \tfrac{m}{2} (u_d i_d + u_q i_q) $$

    Valid for: the amplitude-invariant transform; harmonics of the inverter are not in it.
    """
    active = channels["u_d_V"] * channels["i_d_A"] + channels["u_q_V"] * channels["i_q_A"]
    return phases / 2.0 * active


def shaft_power(channels: Channels) -> np.ndarray:
    """Return the mechanical power [W] by torque and speed, positive as a motor, shape (time,)."""
    return channels["torque_Nm"] * channels["speed_rpm"] * RAD_PER_S_PER_RPM


def recorded_shaft_power(channels: Channels) -> np.ndarray | None:
    """Return the mechanical power [W], shape (time,), None where no channel tells it.

    A shaft that stands, or that gives no torque, throughout needs no second channel.
    """
    power = channels.get("mechanical_power_W")
    if power is None and all(name in channels for name in SHAFT):
        power = shaft_power(channels)
    if power is None:
        power = next((channels[name] for name in SHAFT if _is_zero(channels, name)), None)
    return power if power is not None and np.any(np.isfinite(power)) else None


def _is_zero(channels: Channels, name: str) -> bool:
    return name in channels and bool(np.all(channels[name] == 0.0))


SHAFT = ("torque_Nm", "speed_rpm")
DQ = ("u_d_V", "u_q_V", "i_d_A", "i_q_A")
WITH_INVERTER = "; the losses of the inverter are in it"
AMPLITUDE_INVARIANT = ", amplitude-invariant"


def _product(channel: str, *factors: str) -> Derivation:
    """Return the way to a power as the product of other channels, or as it is."""

    def compute(channels: Channels, phases: int) -> np.ndarray:
        return reduce(np.multiply, (channels[name] for name in factors))

    return Derivation(channel, factors, compute, "·".join(factors))


ELECTRICAL: tuple[Derivation, ...] = (
    _product("electrical_power_W", "electrical_power_W"),
    Derivation("electrical_power_W", DQ, dq_power, "phases/2·(u_d·i_d + u_q·i_q)"),
    _product("electrical_power_W", "winding_voltage_V", "dc_current_A"),
    _product("electrical_power_W", "winding_voltage_V", "phase_current_A"),
    _product("dc_power_W", "dc_power_W"),
    _product("dc_power_W", "dc_voltage_V", "dc_current_A"),
)
"""Ways to the power that goes in, in order of preference: that nearest to the machine first."""

SIDES: tuple[tuple[tuple[str, ...], str, Callable[[Channels], bool]], ...] = (
    (("mechanical_power_W",), " - mechanical_power_W", _always),
    (SHAFT, " - torque·omega", _always),
    (("efficiency",), "·(1 - efficiency)", _always),
    (("speed_rpm",), " (no shaft power: speed_rpm is 0)", partial(_is_zero, name="speed_rpm")),
    (("torque_Nm",), " (no shaft power: torque_Nm is 0)", partial(_is_zero, name="torque_Nm")),
)
"""What tells the power at the shaft, how it stands in a formula, and when it holds."""


def _balance(
    power: Derivation, needs: tuple[str, ...], less: str, holds: Callable[[Channels], bool]
) -> Derivation:
    """Return the way to the losses as a power less that of the shaft."""

    def compute(channels: Channels, phases: int) -> np.ndarray:
        goes_in = power.compute(channels, phases)
        if needs == ("efficiency",):  # an analyser writes none where no power flows
            return goes_in * (1.0 - np.nan_to_num(channels["efficiency"]))
        return goes_in - (shaft_power(channels) if needs == SHAFT else channels[needs[0]])

    more = AMPLITUDE_INVARIANT if power.needs == DQ else ""
    more += WITH_INVERTER if power.channel == "dc_power_W" else ""
    return Derivation(
        "losses_W", (*power.needs, *needs), compute, f"{power.formula}{less}{more}", holds
    )


DERIVATIONS: tuple[Derivation, ...] = (
    Derivation(
        "phase_current_A",
        ("i_d_A", "i_q_A"),
        lambda channels, _: np.hypot(channels["i_d_A"], channels["i_q_A"]) / math.sqrt(2.0),
        f"sqrt(i_d² + i_q²)/sqrt(2){AMPLITUDE_INVARIANT}",
    ),
    *(_balance(power, *side) for power in ELECTRICAL for side in SIDES),
)
"""In order of preference; the losses nearest to the machine come first."""

BY_CONSTANTS = "throughout: [constants] of the motor file"
"""End of the note on a channel that was not measured."""


def derive(
    channels: Channels,
    *,
    phases: int = 3,
    losses: Literal["balance", "map"] = "balance",
    constants: Mapping[str, float] = MappingProxyType({}),
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the channels with constants and those that follow, and a note on each of these.

    A channel, shape (time,), that is there, or follows from measured ones, is never replaced by a
    constant in its unit. Losses from a `"map"` are no balance of powers: nothing is derived for
    them.
    """
    found = dict(channels)
    notes = list(_add_derived(found, phases, losses))
    told = {"mechanical_power_W"} if recorded_shaft_power(found) is not None else set()
    size = max((values.size for values in found.values()), default=0)
    for name, value in constants.items():
        if name not in found and name not in told:
            found[name] = np.full(size, value)
            notes.append(f"{name} = {value:g} {BY_CONSTANTS}")
    return found, (*notes, *_add_derived(found, phases, losses))


def _add_derived(found: dict[str, np.ndarray], phases: int, losses: str) -> Iterator[str]:
    """Add what follows from channels to them, and yield a note on each."""
    for way in DERIVATIONS:
        is_balance = way.channel == "losses_W" and losses == "map"
        if way.channel in found or is_balance or not way.is_open(found):
            continue
        found[way.channel] = way.compute(found, phases)
        yield f"{way.channel} is derived: {way.formula}."


def constants_of(notes: Iterable[str]) -> frozenset[str]:
    """Return the channels that are constants of the motor file, by the notes on a record."""
    return frozenset(note.partition(" = ")[0] for note in notes if note.endswith(BY_CONSTANTS))


def formulas(channels: Channels, given: Collection[str]) -> dict[str, str]:
    """Return the formula of each channel that was derived, in the order of preference.

    Given are those that were columns of a file, or constants.
    """
    found: dict[str, str] = {}
    have = {name: channels[name] for name in given if name in channels}
    for way in DERIVATIONS:
        is_derived = way.channel in channels and way.channel not in given
        if is_derived and way.channel not in found and way.is_open(have):
            found[way.channel] = way.formula
    return found
