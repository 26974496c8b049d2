"""The scale of a machine, read off its tests: what default priors of a network are centred on.

A drone's motor and a ship's differ by six powers of ten in every capacity and resistance. How fast
the winding warms and how far says the scale of both; the priors around it stay wide. Masses in the
motor file (`Masses`) say more of the capacities, whose priors are then narrower. A prior that the
user states is left as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ..io.quantities import rounded
from ..record.blocks import Blocks
from .network_form import CAPACITANCE, RESISTANCE, NetworkForm, SpeedLossForm
from .network_text import SD_SPEED_LOSS, SPEED_LOSS
from .parameters import Parameter

COPPER, ALUMINIUM = 385.0, 897.0
"""Specific heat of the conductor [J/(kg K)] (Incropera, Fundamentals of Heat and Mass Transfer)."""

BODY = 460.0
"""Of laminations, shaft, magnets and housing together [J/(kg K)]: steel, between 440 and 480."""

BELOW_degC = 230.0
"""The coefficient B of R(T) is 234.5 °C for copper and 225 °C for aluminium: the conductor is the
latter below this."""

INSULATION = 1.15
"""Insulation and resin warm with the conductor: its capacity times this [1]."""

TAKING_PART = 0.85
"""Share of the body's capacity that follows the winding's test [1]: rotor, shields and feet lag."""

SD_WINDING, SD_BODY, SD_OF_SEVERAL = 0.2, 0.35, 0.9
"""Prior standard deviations of the logarithm: of the winding, of one body, and of each of several,
whose sum alone is known."""

Capacity = tuple[float, float, str]
"""Centre [J/K], standard deviation of the logarithm, basis in words."""


@dataclass(frozen=True)
class Masses:
    """What a motor file says of the masses of a machine."""

    whole: float | None = None  # Mass of the machine [kg], or None if not known.
    conductor: float | None = None  # Mass of the conductor [kg], or None.
    coefficient: float = 234.5  # B of its R(T) [degC].

    def capacities(self, copper: str, others: Sequence[str]) -> dict[str, Capacity]:
        """Return what is known of the capacities of a network's nodes.

        One node alone stands for no mass: how much of the machine follows depends on the test.
        """
        known: dict[str, Capacity] = {}
        if not others:
            return known
        specific = ALUMINIUM if self.coefficient < BELOW_degC else COPPER
        if self.conductor is not None:
            words = f"{rounded(self.conductor)} kg of conductor at {specific:g} J/(kg K), insulated"
            known[copper] = (INSULATION * specific * self.conductor, SD_WINDING, words)
        if self.whole is not None:
            body = self.whole - (self.conductor or 0.0)
            centre = TAKING_PART * BODY * body / len(others)
            sd = SD_BODY if len(others) == 1 else SD_OF_SEVERAL
            words = f"{rounded(body)} kg at {BODY:g} J/(kg K), of which most follows the winding"
            known |= dict.fromkeys(others, (centre, sd, words))
        return known


WINDOW_S = 60.0
"""Time over which the fastest warming is taken [s]: less than most windings take, and long enough
for the noise of a thermocouple."""

OF_TEST = 0.05
"""The same as a share of the test [1], whichever is shorter."""

IN_WINDING = 0.5
"""Share of the losses that warms the winding in that time [1]: copper against iron and friction."""

BODY_OVER_WINDING = 20.0
"""Capacity of all other nodes over that of the winding [1]."""

SD_CAPACITANCE, SD_RESISTANCE = 1.3, 1.8
"""Prior standard deviations of the logarithm around the scale: factors of 13 and 34 at 95 %. A
short test tells little of how hot the machine would become."""

OF_LOSS = 0.1
"""Iron or friction loss at the largest speed over the mean loss [1], for each of its terms."""

NUM_STRETCHES, FEWEST_STRETCHES = (30, 15), 8
"""Stretches of a test whose heat is balanced, short and long, and the fewest that say something."""

GONE = 0.5
"""Share of the loss that is left where a load goes, at most [1]: a smaller change is beside what
else changes the temperature."""

LEAST_RISE_K = 1.0
"""Rise below which a test has no scale [K]."""


@dataclass(frozen=True)
class Scale:
    """The scale of a machine."""

    capacity: float  # Heat capacity of the winding [J/K].
    resistance: float  # Resistance from the winding to the sink [K/W].
    loss: float  # Mean of the losses until the winding is hottest [W].
    fastest: float  # Largest speed [1000 rpm]; 0 where none was measured.
    basis: str  # Where it comes from, in words.


def scale_of_tests(tests: Sequence[Blocks], copper_ohm: float = 0.0) -> Scale | None:
    """Return the scale of a machine, None if no test heats it.

    Args:
        tests: Reduced records.
        copper_ohm: Phases times phase resistance where the loss channel leaves the copper loss out
            [ohm]; 0 where it is in it.
    """
    warming = [found for test in tests if (found := _warming(test.winding, copper_ohm)) is not None]
    if not warming:
        return None
    # a test that starts warm, or whose sensor lags, shows less of how fast the winding is
    power, slope = min(((found[0], found[1]) for found in warming), key=lambda one: one[0] / one[1])
    mean_loss, rise = np.exp(np.mean(np.log([found[2:] for found in warming]), axis=0))
    return Scale(
        capacity=float(IN_WINDING * power / slope),
        resistance=float(rise / mean_loss),
        loss=float(mean_loss),
        fastest=max((_fastest(test) for test in tests), default=0.0),
        basis=f"the winding changes by {rounded(60.0 * slope, 2)} K/min for {rounded(power)} W and "
        f"rises by {rounded(rise, 2)} K at {rounded(mean_loss)} W",
    )


def one_node(tests: Sequence[Blocks], copper_ohm: float = 0.0) -> tuple[float, float] | None:
    """Return heat capacity [J/K] and resistance to the sink [K/W] of the whole machine as one node.

    By least squares on the heat balance of stretches; None if it is not that of a machine. What
    the winding swings above the body follows the square of the current and is no heat in the body.
    In short stretches it hides the body, in long ones the body has settled: either way the
    capacity is too small, so the larger one counts.
    """
    found = [_balanced(tests, copper_ohm, num) for num in NUM_STRETCHES]
    return max((each for each in found if each is not None), default=None)


def _balanced(tests: Sequence[Blocks], copper_ohm: float, num: int) -> tuple[float, float] | None:
    balances = [_stretches(test.winding, copper_ohm, num) for test in tests]
    slope, swing, rise, loss = np.concatenate(balances, axis=1)
    seen = np.isfinite(slope + rise + loss)
    if np.sum(seen) < FEWEST_STRETCHES:
        return None
    heat = np.column_stack([slope, rise, swing])[seen]
    size = np.linalg.norm(heat, axis=0)
    size[size == 0.0] = 1.0  # no current
    capacity, conductance, _ = np.linalg.lstsq(heat / size, loss[seen], rcond=None)[0] / size
    if not (capacity > 0.0 and conductance > 0.0):
        return None
    return float(capacity), float(1.0 / conductance)


def _stretches(test: Blocks, copper_ohm: float, num: int) -> Float[np.ndarray, "4 stretch"]:
    """Return of stretches of a test slope [K/s], slope of the squared current [A²/s], rise [K] and
    loss [W]; NaN where not measured.
    """
    loss, sink = _drives(test, copper_ohm)
    size = max(1, loss.size // num)
    whole = loss.size // size * size
    measured = np.where(test.is_observed, test.measured, np.nan)
    T, squared, loss, sink = (
        rows[:whole].reshape(-1, size).mean(axis=1)
        for rows in (measured, test.by_block(test.means["current_squared"]), loss, sink)
    )
    slope, swing = ((e[2:] - e[:-2]) / (2.0 * size * test.block_s) for e in (T, squared))
    return np.stack([slope, swing, (T - sink)[1:-1], loss[1:-1]])


def _drives(test: Blocks, copper_ohm: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the loss [W] and the sink [degC] of each block."""
    loss = test.means["losses"] + copper_ohm * test.means["current_squared"]
    return test.by_block(loss), test.by_block(test.means["ambient"])


def scaled(form: NetworkForm, scale: Scale | None, masses: Masses) -> NetworkForm:
    """Return a network whose default priors suit a machine; others stay as they are.

    Args:
        form: The network.
        scale: What its tests say; None for nothing.
        masses: What its motor file says.
    """
    others = [node for node in form.nodes if node != form.copper]
    known = masses.capacities(form.copper, others)

    def capacity(node: str, parameter: Parameter) -> Parameter:
        if node in known:
            return _around(parameter, CAPACITANCE, *known[node])
        if scale is None:
            return parameter
        body = BODY_OVER_WINDING * scale.capacity
        if not others:
            centre = scale.capacity + body
        else:
            centre = scale.capacity if node == form.copper else body / len(others)
        return _around(parameter, CAPACITANCE, centre, SD_CAPACITANCE, scale.basis)

    def resistance(parameter: Parameter) -> Parameter:
        if scale is None:
            return parameter
        share = 1.0 if not others else 0.5
        centre = share * scale.resistance
        return _around(parameter, RESISTANCE, centre, SD_RESISTANCE, scale.basis)

    return replace(
        form,
        capacitance=tuple((node, capacity(node, p)) for node, p in form.capacitance),
        resistance=tuple((link, resistance(p)) for link, p in form.resistance),
        by_speed=tuple(_scaled_by_speed(loss, scale) for loss in form.by_speed),
    )


def _scaled_by_speed(loss: SpeedLossForm, scale: Scale | None) -> SpeedLossForm:
    if scale is None or not scale.fastest:
        return loss

    def around(parameter: Parameter, exponent: int) -> Parameter:
        if parameter.basis != SPEED_LOSS or parameter.fixed is not None:
            return parameter
        words = (
            f"log-normal, 95 % within a factor of {np.exp(1.96 * SD_SPEED_LOSS):.0f}: at "
            f"{rounded(1000.0 * scale.fastest)} rpm a tenth of the mean loss of "
            f"{rounded(scale.loss)} W"
        )
        centre = OF_LOSS * scale.loss / scale.fastest**exponent
        return replace(parameter, centre=centre, sd=SD_SPEED_LOSS, basis=words)

    return replace(loss, linear=around(loss.linear, 1), square=around(loss.square, 2))


def _fastest(test: Blocks) -> float:
    """Return the largest speed of a test [1000 rpm], 0 where it turns at none or has none."""
    return float(np.max(np.abs(test.means.get("speed", 0.0)))) * 0.03 / np.pi


def _around(parameter: Parameter, default: str, centre: float, sd: float, basis: str) -> Parameter:
    if parameter.basis != default or parameter.fixed is not None:
        return parameter  # the network's file states it
    factor = np.exp(1.96 * sd)
    words = f"log-normal, 95 % within a factor of {rounded(factor, 2)}: {basis}"
    return replace(parameter, centre=centre, sd=sd, basis=words)


def _warming(test: Blocks, copper_ohm: float) -> tuple[float, float, float, float] | None:
    """Return power [W] and slope [K/s] of the fastest change, mean loss [W] and rise [K].

    That is the fastest warming, or what changes where a load goes, whichever takes less heat for a
    kelvin.
    """
    loss, sink = _drives(test, copper_ohm)
    seen = np.flatnonzero(test.is_observed)
    num = max(1, round(min(WINDOW_S, OF_TEST * test.duration_s) / test.block_s))
    if seen.size <= num:
        return None
    T, time = test.measured[seen], test.time[seen]
    slope = (T[num:] - T[:-num]) / (time[num:] - time[:-num])
    first = int(np.argmax(slope))
    window = slice(seen[first], seen[first + num] + 1)
    top = seen[int(np.argmax(T - sink[seen]))]
    rise = float(test.measured[top] - sink[top])
    mean_loss = float(np.mean(loss[: top + 1]))
    changes = [(float(np.mean(loss[window])), float(slope[first]))]
    means = np.convolve(loss, np.ones(num) / num, "valid")
    ends = seen[num:-num]  # last blocks before a change, with as long a stretch behind it
    if ends.size:
        before, after = means[ends - num + 1], means[np.minimum(ends + 1, means.size - 1)]
        last = int(np.argmax(before - after))
        if after[last] < GONE * before[last]:
            change = slope[last] - slope[last + num]
            changes.append((float(before[last] - after[last]), float(change)))
    changes = [(watts, rate) for watts, rate in changes if watts > 0.0 and rate > 0.0]
    if rise < LEAST_RISE_K or mean_loss <= 0.0 or not changes:
        return None
    return *min(changes, key=lambda change: change[0] / change[1]), mean_loss, rise
