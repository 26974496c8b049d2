"""The machine of each draw under the load of the tests: what ratings are read from.

The other losses P_ol are held at what they were in the loaded part of the tests, because a
balance says nothing about loads that were not run; the copper loss follows current and
temperature. All physics is that of `lptn`, for any network with any effects.

What the tests have seen comes first; where the network comes to rest under the load that a test was
stopped at, at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import CopperLosses, Drive, Network, heat_input, steady_current, steady_state, time_to
from lptn.constant_drive import SteadyCurrent
from lptn.effects import AbstractEffect
from lptn.inputs import SIGNALS

from ..io.programs import compiled
from ..io.quantities import rounded
from ..model.bodies import corrected_losses
from ..model.model import Model, Values
from ..posterior.predict import Prediction
from ..record.blocks import Blocks
from ..results.model import TestedLoad
from .equilibrium import Stretch

REACH = 1.2
"""A current may lie this much above the largest one tested [1] before a figure is extrapolated."""

RAD_PER_S = np.pi / 30.0
"""One revolution per minute [rad/s]."""

REACH_K = 15.0
"""A temperature may lie this far above the highest one measured [K] likewise."""

SAME_LOAD = 0.1
"""Relative difference of speed or flow up to which a resistance that no effect lets follow it is
one quantity [1]: with the power 0.8 of a turbulent flow it changes by 8 %."""


@dataclass(frozen=True)
class Tested:
    """What the tests have seen."""

    current_A: float  # Largest rms current of a block [A].
    winding_degC: float  # Highest reading of a block [degC].
    loaded_winding_degC: float  # Mean reading of the loaded part [degC].
    # Means over the loaded part: current, loss channel, speed, coolant and fan; the sinks are those
    # of all tests. Speed, coolant, fan and second sink only if every test has them. Effects that
    # follow the time stand as at the start of the first test.
    loaded: Drive
    rated_speed: float  # Speed that effects are scaled with [rad/s].
    rated_current: float  # Current that effects are scaled with [A].

    @classmethod
    def of(cls, load: TestedLoad) -> Tested:
        """Return it as `fit.json` has it."""
        rated_speed, rated_current = load.rated_speed_rpm * RAD_PER_S, load.rated_current_A
        return cls(
            current_A=load.largest_current_A,
            winding_degC=load.highest_winding_degC,
            loaded_winding_degC=load.winding_degC,
            loaded=Drive.constant(
                current_squared=load.current_A**2,
                losses=load.losses_W,
                ambient=load.sink_degC,
                speed=None if load.speed_rpm is None else load.speed_rpm * RAD_PER_S,
                coolant=load.coolant_degC,
                fan=load.fan,
                second_sink=load.second_sink_degC,
                rated_speed=rated_speed,
                rated_current=rated_current,
            ),
            rated_speed=rated_speed,
            rated_current=rated_current,
        )

    @property
    def load(self) -> TestedLoad:
        """It as it stands in `fit.json`."""
        at = self.loaded
        rad, coolant, fan, second = (
            None if each is None else float(each)
            for each in (at.speed_rad, at.coolant, at.fan, at.second_sink)
        )
        return TestedLoad(
            current_A=self.amperes,
            losses_W=float(at.losses),
            winding_degC=self.loaded_winding_degC,
            sink_degC=self.sink_degC,
            second_sink_degC=second,
            speed_rpm=None if rad is None else rad / RAD_PER_S,
            coolant_degC=coolant,
            fan=fan,
            rated_speed_rpm=self.rated_speed / RAD_PER_S,
            rated_current_A=self.rated_current,
            largest_current_A=self.current_A,
            highest_winding_degC=self.winding_degC,
        )

    @property
    def sink_degC(self) -> float:
        """Mean temperature of the sink [degC]."""
        return float(self.loaded.ambient)

    @property
    def amperes(self) -> float:
        """Root of the mean squared current of the loaded part [A]."""
        return float(np.sqrt(self.loaded.current_squared))

    def lacks(self, kind: type[AbstractEffect]) -> list[str]:
        """Return what an effect needs and the tests do not tell."""
        return [need for need in kind.card.needs if getattr(self.loaded, need, 0.0) is None]

    def short_of(self, *, degC: float = -np.inf, amperes: float = -np.inf) -> str:
        """Return how far the tests went where a figure lies beyond, else nothing.

        Args:
            degC: Temperature of the figure [degC].
            amperes: Current of the figure [A].
        """
        if degC > self.winding_degC + REACH_K:
            return f"tested up to {self.winding_degC:.0f} °C"
        return (
            f"tested up to {rounded(self.current_A)} A" if amperes > REACH * self.current_A else ""
        )

    def surroundings(
        self,
        effects: Sequence[type[AbstractEffect]],
        *,
        follows_time: bool,
        second_sink: str = "",
        likely: Sequence[type[AbstractEffect]] = (),
    ) -> str:
        """Return what the figures of a model with effects hold under, to follow a condition.

        Args:
            effects: Effects in the model.
            follows_time: Whether one of them depends on the time since the start of a test.
            second_sink: Name of the network's second sink; empty where it has none.
            likely: Effects that the network is likely to miss, which the figures count.
        """
        needs = {need for kind in (*effects, *likely) for need in kind.card.needs}
        parts = []
        if second_sink and self.loaded.second_sink is not None:
            parts.append(f"{second_sink} {float(self.loaded.second_sink):.0f} °C")
        if "speed" in needs and self.loaded.speed_rad is not None:
            parts.append(f"{float(self.loaded.speed_rad) * 30.0 / np.pi:.0f} rpm")
        if "coolant" in needs and self.loaded.coolant is not None:
            parts.append(f"coolant {float(self.loaded.coolant):.0f} °C")
        if "fan" in needs and self.loaded.fan is not None:
            parts.append(f"fan or flow {100.0 * float(self.loaded.fan):.0f} % of rated")
        if follows_time:
            parts.append("as at the start of the first test")
        parts += [f"with {kind.card.id}" for kind in likely]
        return "".join(f", {part}" for part in parts)


def tested(tests: Sequence[Blocks]) -> Tested:
    """Return the range of the tests; loaded means above half of the largest squared current."""

    def means(name: str) -> np.ndarray | None:
        rows = []
        for test in tests:
            values = corrected_losses(test) if name == "losses" else getattr(test.inputs, name)
            if values is None:
                return None
            rows.append(test.by_block(values))
        return np.concatenate(rows)

    I2, losses, T0 = (np.asarray(means(n)) for n in ("current_squared", "losses", "ambient"))
    second = means("second_sink")
    Tw = np.concatenate([test.measured for test in tests])
    loaded = (0.5 * np.max(I2) <= I2) & np.isfinite(Tw)

    def of_load(name: str) -> float | None:
        values = means(name)
        return None if values is None else float(np.mean(values[loaded]))

    first = tests[0].inputs
    rated_speed, rated_current = float(first.rated_speed), float(first.rated_current)
    return Tested(
        current_A=float(np.sqrt(np.max(I2))),
        winding_degC=float(np.nanmax(Tw)),
        loaded_winding_degC=float(np.mean(Tw[loaded])),
        loaded=Drive.constant(
            current_squared=float(np.mean(I2[loaded])),
            losses=float(np.mean(losses[loaded])),
            ambient=float(np.mean(T0)),
            speed=of_load("speed"),
            coolant=of_load("coolant"),
            fan=of_load("fan"),
            second_sink=None if second is None else float(np.mean(second)),
            rated_speed=rated_speed,
            rated_current=rated_current,
        ),
        rated_speed=rated_speed,
        rated_current=rated_current,
    )


WARM = 0.75
"""Share of the steady rise that a warm start has [1]."""


class Machine(NamedTuple):
    """What one draw says; arrays over draws where many are evaluated."""

    other: Float[Array, "*draw"]  # Other losses of the loaded part [W].
    copper_slope: Float[Array, "*draw"]  # Copper loss per squared ampere and kelvin [W/(A^2 K)].
    # Steady rise of the copper [K], at the rated current where that was given, else at the loaded
    # part's; inf where it runs away.
    rise: Float[Array, "*draw"]
    # Squared current that holds the copper at the limit [A^2].
    limit_squared: Float[Array, "*draw"]
    # Time to the limit at the loaded part's current, from the sink [s].
    cold_s: Float[Array, "*draw"]
    warm_s: Float[Array, "*draw"]  # The same from `WARM` of the steady rise [s].
    # Squared current that holds the copper at the permitted rise [A^2].
    permitted_squared: Float[Array, "*draw"]


@compiled("model")
def machines(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    winding: Float[Array, ""],
    limit: Float[Array, ""],
    rated: Float[Array, ""] | float = 1.0,
    permitted: Float[Array, ""] | float = np.nan,
) -> Machine:
    """Return the machine of each draw; compiled once per model.

    Args:
        model: Network with effects.
        values: Parameters of the machine in general by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC].
        limit: Limit of the insulation [degC]; NaN for none, and nothing is said of it.
        rated: Squared rated current over that of the loaded part [1]; 1 where none is given.
        permitted: Temperature that the permitted rise leads to [degC]; NaN for none.
    """
    num = len(next(iter(values.values())))
    other = jax.vmap(lambda values: under_load(model, values, loaded, winding).drive.losses)(values)

    def of_two(function: Callable[..., Any], firsts: tuple, seconds: tuple) -> tuple[Any, Any]:
        """Return what a function of a machine gives with the first and with the second arguments.

        In one map over both: each map more around a loop has its body traced twice more.
        """

        def lanes(*two: Any) -> Array:
            return jnp.concatenate([jnp.broadcast_to(part, num) for part in two])

        def one(values: Values, other: Array, *given: Any) -> Any:
            return function(under_load(model, values, loaded, winding, other), *given)

        given = jax.tree.map(lanes, (values, other, *firsts), (values, other, *seconds))
        found = jax.vmap(one)(*given)
        pairs = jax.tree.map(lambda rows: rows.reshape(2, num), found)
        return jax.tree.map(lambda rows: rows[0], pairs), jax.tree.map(lambda rows: rows[1], pairs)

    def at_rest(at: UnderLoad, scale: Array) -> tuple[dict[str, Array], Array]:
        drive = at.drive.scale_current(scale)
        rest = steady_state(at.network, at.losses, drive, effects=at.effects)
        return rest, rest[at.network.copper_node] - drive.ambient

    def held(at: UnderLoad, copper: Array) -> SteadyCurrent:
        return steady_current(at.network, at.losses, at.drive, copper, effects=at.effects)

    def time_from(at: UnderLoad, share: Array, rest: Any, top: Any) -> Array:
        sink = at.drive.ambient
        start = {
            # where the copper runs away, the warm start is on the way to the limit
            node: sink + share * (jnp.where(jnp.isfinite(T), T, top[node]) - sink)
            for node, T in rest.items()
        }
        return time_to(
            at.network, at.losses, at.drive, start, node=at.network.copper_node, limit=limit,
            effects=at.effects, steady=rest,
        )  # fmt: skip

    (rest, _), (_, top_rise) = of_two(at_rest, (1.0,), (rated,))
    top, by_rise = of_two(held, (limit,), (permitted,))
    known_of = rest, top.temperature
    cold_s, warm_s = of_two(time_from, (0.0, *known_of), (WARM, *known_of))
    return Machine(
        other=other,
        copper_slope=jax.vmap(lambda values: model.losses(values).slope(jnp.asarray(1.0)))(values),
        rise=jnp.where(jnp.isfinite(top_rise), top_rise, jnp.inf),
        limit_squared=top.squared,
        cold_s=cold_s,
        warm_s=warm_s,
        permitted_squared=by_rise.squared,
    )


class UnderLoad(NamedTuple):
    """A machine at the load of the tests."""

    network: Network  # The network.
    losses: CopperLosses  # Its losses, the other ones given.
    drive: Drive  # The loaded part, with the other losses.
    effects: tuple[AbstractEffect, ...]  # The effects.


def under_load(
    model: Model,
    values: Values,
    loaded: Drive,
    winding: Float[Array, ""],
    other: Float[Array, ""] | None = None,
) -> UnderLoad:
    """Return the machine of one draw, with the other losses held at what they were in the tests.

    Args:
        model: Network with effects.
        values: Parameters by name [their units].
        loaded: The loaded part of the tests.
        winding: Mean reading of the loaded part [degC].
        other: The other losses [W], where they are known by now.
    """
    network, losses = model.network(values), model.losses(values)
    effects = model.built_effects(values)
    if other is None:
        other = other_losses(network, losses, loaded, winding, effects)
    return UnderLoad(network, fixed_losses(losses), replace(loaded, losses=other), effects)


def fixed_losses(losses: CopperLosses) -> CopperLosses:
    """Return the losses of a machine whose other losses are given, and its true sink.

    The current stays as the bench reads it, with its error.
    """
    return replace(
        losses,
        kind="map",
        power_gain=0.0,
        torque_offset=0.0,
        ambient_offset=0.0,
        shaft_power_gain=0.0,
        shaft_power_offset=0.0,
        second_sink_offset=0.0,
    )


def other_losses(
    network: Network,
    losses: CopperLosses,
    loaded: Drive,
    winding: Float[Array, ""],
    effects: Sequence[AbstractEffect],
) -> Float[Array, ""]:
    """Return the other losses [W] with which the machine is heated as it was in the tests.

    The heat is proportional to them apart from a constant, so one step of Newton's method is the
    solution. Effects on the copper loss are counted: under a balance their heat is part of Pd.
    """
    at = dict.fromkeys(network.nodes, winding)

    def total(losses: CopperLosses, watts: Float[Array, ""]) -> Float[Array, ""]:
        drive = replace(loaded, losses=watts)
        heat = heat_input(network, losses, drive, at, effects=effects)
        return jnp.sum(jnp.stack(list(heat.values())))

    def excess(watts: Float[Array, ""]) -> Float[Array, ""]:
        return total(fixed_losses(losses), watts) - total(losses, loaded.losses)

    guess = loaded.losses
    value, slope = jax.jvp(excess, (guess,), (jnp.ones_like(guess),))
    return guess - value / slope


NUM_DRAWS = 200
"""Draws behind the limits: they are good to an eighth of a standard deviation."""


@dataclass(frozen=True)
class SteadyNetwork:
    """The steady state of a network under the mean load of the last part of a stretch."""

    median_degC: Mapping[str, float]  # Temperature by node [degC].
    limits_degC: Mapping[str, tuple[float, float]]  # Its 95 % limits by node [degC].
    # Rise of the measured node over the sink [K], median and 95 % limits.
    rise_K: tuple[float, float, float]
    from_s: float  # First moment of the load that it is told for [s].
    to_s: float  # Last one [s].


def steady_of_network(found: Prediction, stretch: Stretch) -> SteadyNetwork | None:
    """Return the steady state of a predicted network, None where it has none.

    Current, speed, sink and the losses outside the copper are held at their means over the last
    third of the stretch; the copper loss follows its temperature.

    Args:
        found: The test, as the run predicts it.
        stretch: Of constant load, on the record's clock.
    """
    from_s = stretch.to_s - stretch.length_s / 3.0
    inputs = found.test.inputs
    ends = np.cumsum(np.broadcast_to(inputs.step, inputs.num_time))
    clock = ends - 0.5 * np.asarray(inputs.step) + found.test.first_s
    late = (clock >= from_s) & (clock <= stretch.to_s)
    read = found.test.is_observed & (found.time_s >= from_s) & (found.time_s <= stretch.to_s)
    if not late.any() or not read.any():
        return None
    means = {
        name: float(np.mean(np.asarray(values)[late]))
        for name in SIGNALS
        if (values := getattr(inputs, name)) is not None
    }
    held = Drive.constant(
        **means, time=float(np.mean(clock[late] - found.test.first_s)),
        rated_speed=inputs.rated_speed, rated_current=inputs.rated_current,
    )  # fmt: skip
    winding = np.asarray(np.mean(found.test.measured[read]))
    values = {n: np.asarray(draws[:NUM_DRAWS]) for n, draws in found.values.items()}
    draws = _rest(found.model, values, held, winding)
    nodes = {node: np.asarray(each) for node, each in draws.items()}
    if not all(np.isfinite(each).all() for each in nodes.values()):
        return None
    shares = (0.5, 0.025, 0.975)
    middle, low, high = np.quantile(nodes[found.model.form.copper] - float(held.ambient), shares)
    limits = {n: np.quantile(draws, shares[1:]) for n, draws in nodes.items()}
    return SteadyNetwork(
        {n: float(np.median(draws)) for n, draws in nodes.items()},
        {n: (float(low), float(high)) for n, (low, high) in limits.items()},
        (float(middle), float(low), float(high)),
        from_s,
        stretch.to_s,
    )


@compiled("model", is_seldom=True)
def _rest(
    model: Model, values: dict[str, Float[Any, " draw"]], held: Drive, winding: Float[Any, ""]
) -> dict[str, jax.Array]:
    """Return the steady state of each draw [degC]."""

    def rest(one: dict[str, jax.Array]) -> dict[str, jax.Array]:
        network, losses, effects = model.network(one), model.losses(one), model.built_effects(one)
        other = other_losses(network, losses, held, winding, effects)
        load = replace(held, losses=other)
        return steady_state(network, fixed_losses(losses), load, effects=effects)

    return jax.vmap(rest)(values)
