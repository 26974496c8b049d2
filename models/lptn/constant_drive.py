"""A network with effects under one constant drive: its balance, its rest, how it gets there.

The balance is a function from a vector to a vector: the right-hand side that `simulate` and
`reference` integrate, effects and their nodes included. Effects on the sensor do not enter: they
change the reading, not the temperatures. Near one operating point it is the linear network of
`linearise`, which may not settle: the copper heats itself, since its resistance rises. Where it
rests, and the current that brings the copper there, is found by Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .effects.base import AbstractEffect, Terms
from .inputs import Drive
from .march import heat_effects, prepare
from .network import CopperLosses, Link, Network, Sensor
from .stepping import eliminate, heat_balance, rates


class Field(NamedTuple):
    """The rates of a network by its temperatures.

    Attributes:
        nodes: Names of the nodes, sorted, those of the effects among them: the order of vectors.
        start: Temperatures [degC], shape (node,).
        slope: Returns the rates [K/s] for temperatures [degC], both of shape (node,).
        heat: Returns the heat put into each node [W] likewise.
    """

    nodes: tuple[str, ...]
    start: Float[Array, " node"]
    slope: Callable[[Float[Array, " node"]], Float[Array, " node"]]
    heat: Callable[[Float[Array, " node"]], Float[Array, " node"]]

    def place(self, node: str) -> int:
        """Return the place of a node in a vector.

        Raises:
            ValueError: If there is no such node.
        """
        if node not in self.nodes:
            raise ValueError(f"The network has no node {node!r}, only {list(self.nodes)}.")
        return self.nodes.index(node)

    def by_node(self, vector: Float[Array, " node"]) -> dict[str, Float[Array, ""]]:
        """Return a vector as a dictionary."""
        return {node: vector[index] for index, node in enumerate(self.nodes)}


def field(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    start: Mapping[str, Float[Array, ""] | float] | None,
    effects: Sequence[AbstractEffect],
) -> Field:
    """Return the rates of a network under a constant drive, and a start.

    Args:
        network: Nodes and links, without those of the effects.
        losses: Copper loss and the meaning of the loss channel.
        drive: Inputs that hold all the time, numbers. Effects that follow the time since the
            start of a test stand as they are at `drive.time`.
        start: Temperature of each node of `network` [degC]; of nodes of effects too, which
            otherwise start as the effects have it. None puts all nodes at the sink.
        effects: Effects, in order.

    Raises:
        ValueError: As `lptn.march.prepare`, if a start is given for a node that is not there,
            or if the drive is no set of single numbers.
    """
    if jnp.ndim(drive.current_squared):
        raise ValueError(
            f"The drive holds arrays of shape {jnp.shape(drive.current_squared)}, expected one "
            "number of each quantity: use `Drive.constant`, or `jax.vmap` for many drives."
        )
    if start is None:
        sink = jnp.asarray(drive.ambient + losses.ambient_offset)
        start = dict.fromkeys(network.nodes, sink)
    own = {node: T for node, T in start.items() if node in network.nodes}
    sensor = Sensor(node=network.copper_node)
    full, first = prepare(network, losses, drive, own, effects, (sensor,))
    unknown = set(start) - set(full.nodes)
    if unknown:
        raise ValueError(
            f"Temperatures are given for {sorted(unknown)}, which are none of {list(full.nodes)}."
        )
    acting = heat_effects(effects)
    first = first | {node: jnp.asarray(T, dtype=float) for node, T in start.items()}

    def balance(vector: Float[Array, " node"]) -> tuple[Terms, dict[str, Float[Array, ""]]]:
        temperature = {node: vector[index] for index, node in enumerate(full.nodes)}
        return heat_balance(full, losses, acting, temperature, drive), temperature

    def slope(vector: Float[Array, " node"]) -> Float[Array, " node"]:
        rate = rates(full, *balance(vector))
        return jnp.stack([rate[node] for node in full.nodes])

    def heat(vector: Float[Array, " node"]) -> Float[Array, " node"]:
        terms, _ = balance(vector)
        return jnp.stack([terms.heat[node] for node in full.nodes])

    return Field(full.nodes, jnp.stack([first[node] for node in full.nodes]), slope, heat)


def heat_input(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    temperature: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
) -> dict[str, Float[Array, ""]]:
    """Return the heat that losses and effects put into each node at one instant [W].

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `linearise`.
        temperature: As `linearise`.
        effects: As `linearise`.

    Raises:
        ValueError: As `linearise`.
    """
    at = field(network, losses, drive, temperature, effects)
    return at.by_node(at.heat(at.start))


def link_resistances(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    temperature: Mapping[str, Float[Array, ""]],
    *,
    effects: Sequence[AbstractEffect] = (),
) -> dict[Link, Float[Array, ""]]:
    """Return the resistance of each link as effects leave it at one instant [K/W].

    Heat that a surface gives off by an effect of its own lies beside the link to the sink, and a
    node that an effect adds is taken out by turning its star of links into a mesh.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `linearise`.
        temperature: Of all nodes, those of effects among them [degC].
        effects: As `linearise`.
    """
    own = {node: T for node, T in temperature.items() if node in network.nodes}
    sensor = Sensor(node=network.copper_node)
    full, _ = prepare(network, losses, drive, own, effects, (sensor,))
    acting = heat_effects(effects)
    bare = heat_balance(full, losses, (), temperature, drive)
    terms = heat_balance(full, losses, acting, temperature, drive)
    conductance = dict(terms.conductance)
    for effect in acting:
        if effect.card.family == "surface":
            heat = effect.apply(bare, temperature, drive).heat
            for node in full.nodes:
                link = (node, full.boundary)
                if link in conductance:
                    rise = temperature[node] - terms.sink
                    conductance[link] += (bare.heat[node] - heat[node]) / rise
    for node in full.nodes:
        if node not in network.nodes:
            conductance = _without(conductance, node)
    return {link: 1.0 / conductance[link] for link in network.links}


def _without(conductance: dict[Link, Array], node: str) -> dict[Link, Array]:
    """Return the links without a node through which no heat comes in."""
    star = {(a if b == node else b): G for (a, b), G in conductance.items() if node in (a, b)}
    rest = {link: G for link, G in conductance.items() if node not in link}
    total = sum(star.values())
    ends = list(star)
    for place, first in enumerate(ends):
        for second in ends[place + 1 :]:
            link = (second, first) if (second, first) in rest else (first, second)
            rest[link] = rest.get(link, 0.0) + star[first] * star[second] / total
    return rest


class Linearised(eqx.Module):
    """A network as dT/dt = A T + q.

    Attributes:
        nodes: Names of the nodes in the order of rows and columns: sorted, those of the effects
            among them.
        A: State matrix [1/s], shape (node, node).
        offset: q [K/s] for temperatures in degC, shape (node,).
    """

    nodes: tuple[str, ...] = eqx.field(static=True)
    A: Float[Array, "*draw node node"]
    offset: Float[Array, "*draw node"]


def linearise(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    temperature: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
) -> Linearised:
    """Return the network as linear equations around the given temperatures.

    The Jacobian is taken of the very balance that `simulate` integrates: it holds the feedback of
    the resistance R(T), the meaning of the loss channel, and whatever the effects do. It is exact
    at all temperatures where no effect bends with the temperature. It can be compiled and mapped.

    Args:
        network: Nodes and links.
        losses: Copper loss and the meaning of the loss channel.
        drive: Inputs that hold all the time, numbers. Effects that follow the time since the
            start of a test stand as they are at `drive.time`.
        temperature: Temperature of each node of `network` [degC]; nodes of effects may be left
            out, and then stand where the effect has them at the start of a test.
        effects: Effects, in order; those on the sensor do not enter.

    Returns:
        State matrix and offset.

    Raises:
        ValueError: If JAX runs in float32, a temperature is missing or of no node, or an input
            is missing that an effect or the torque offset needs.
    """
    at = field(network, losses, drive, temperature, effects)
    A = jax.jacfwd(at.slope)(at.start)
    return Linearised(at.nodes, A, at.slope(at.start) - A @ at.start)


def time_constants(A: Float[Array, "*draw node node"]) -> Float[np.ndarray, "*draw node"]:
    """Return the time constants of state matrices [s], shape (..., node), shortest first.

    A mode that grows or stays has none and stands as inf, at the end.

    Args:
        A: State matrices [1/s], shape (..., node, node), numbers and not placeholders: JAX has
            eigenvalues of a matrix that is not symmetric on the CPU alone, so NumPy takes them.
    """
    decay = -np.linalg.eigvals(np.asarray(A)).real
    is_decaying = decay > 0.0
    return np.sort(np.where(is_decaying, 1.0 / np.where(is_decaying, decay, 1.0), np.inf), axis=-1)


NUM_SQUARINGS = 36
"""Squarings of the step over the fastest rate: 2^36 steps, after which 10^-10 of it has faded."""


def growth_rate(network: Network, losses: CopperLosses, current_squared: float) -> float:
    r"""Return the fastest growth of a temperature rise under a constant current [1/s].

    It is the largest real part of the eigenvalues of dT/dt = A T + q. Below 0 the network
    settles, with 1/|rate| as its slowest time constant; above 0 it runs away. One node under
    `kind="map"` does so from $m I^2 R_{s0} R_{eq} = B + T_{ref}$ on.

    Args:
        network: Nodes and links, without effects; numbers, not placeholders of a trace.
        losses: Copper loss and the meaning of the loss channel.
        current_squared: Squared rms phase current [A^2].

    Valid for: constant current and sink; a drive that holds its power and not its current ends
        the growth.
    Reference: IEC 60034-1, 8.6.2 (resistance and temperature).
    """
    drive = Drive.constant(
        current_squared=current_squared, losses=0.0, ambient=0.0, speed=0.0, second_sink=0.0
    )
    at = linearise(network, losses, drive, dict.fromkeys(network.nodes, 0.0))
    return float(np.max(np.linalg.eigvals(np.asarray(at.A)).real))


def is_stable(A: Float[Array, "node node"]) -> Bool[Array, ""]:
    r"""Return whether all eigenvalues of a state matrix have a negative real part.

    They have if and only if the powers of $(I + hA)(I - hA)^{-1}$ fade. Unlike the eigenvalues of
    a matrix that is not symmetric, this can be compiled for every device.

    Args:
        A: State matrix [1/s], shape (node, node).

    Valid for: rates that are apart by less than a factor of 10^10 from the fastest one; slower
        ones count as standing still, which is not stable.
    Reference: R. A. Horn, C. R. Johnson, Topics in Matrix Analysis, 1991, section 2.1 (the
        transform of Cayley).
    """
    unit = jnp.eye(A.shape[0])
    scaled = A / jnp.max(jnp.sum(jnp.abs(A), axis=1))
    power = eliminate(unit - 0.5 * scaled, unit + 0.5 * scaled)
    for _ in range(NUM_SQUARINGS):
        power = jnp.sum(power[:, :, None] * power[None, :, :], axis=1)
    return jnp.max(jnp.abs(power)) < 0.5  # false for NaN and inf


Vector = Float[Array, " node"]

TOLERANCE = 1e-10
"""Largest last step of Newton's method, relative to 1 K and the temperature [1]; the error left
is of the order of its square."""

MOST_ITERATIONS = 50
"""Steps of Newton's method after which it is given up; a handful is usual."""

HOT_K = 1500.0
"""Rise of the second start [K], above every temperature at which there is a machine."""


def steady_state(
    network: Network, losses: CopperLosses, drive: Drive, *, effects: Sequence[AbstractEffect] = ()
) -> dict[str, Float[Array, ""]]:
    """Return the temperatures at which a network rests under a constant drive [degC].

    Newton's method on the very balance that `simulate` integrates, from the sink; and from far
    above it, where the copper runs away at first and an effect on the surface catches it. Only an
    equilibrium that small disturbances decay to counts. It can be compiled and mapped.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `linearise`; effects that follow the time stand as they are at `drive.time`, as
            if the clock stood still.
        effects: As `linearise`.

    Returns:
        Temperature by node [degC], nodes of effects among them; all NaN where there is no stable
        equilibrium, that is where the copper runs away.

    Raises:
        ValueError: As `linearise`.
    """
    at = field(network, losses, drive, None, effects)
    return at.by_node(equilibrium(at.slope, at.start))


def equilibrium(slope: Callable[[Vector], Vector], sink: Vector) -> Vector:
    """Return the stable temperatures at which the rates vanish [degC], NaN if there are none.

    Args:
        slope: Rates [K/s] by temperatures [degC].
        sink: Temperature of the sink for every node [degC], where the search begins.
    """
    found, is_found = _newton(slope, jnp.stack([sink, sink + HOT_K]))
    is_found &= jax.vmap(lambda rest: is_stable(jax.jacfwd(slope)(rest)))(found)
    (cold, hot), (is_cold, is_hot) = found, is_found
    return jnp.where(is_cold, cold, jnp.where(is_hot, hot, jnp.nan))


class SteadyCurrent(NamedTuple):
    """The current that holds the copper at a temperature.

    Attributes:
        squared: Squared rms phase current [A^2]; negative where the other losses alone make the
            copper hotter, NaN where none was found.
        temperature: Temperature by node [degC].
    """

    squared: Float[Array, ""]
    temperature: dict[str, Float[Array, ""]]


def steady_current(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    copper: Float[Array, ""] | float,
    *,
    effects: Sequence[AbstractEffect] = (),
) -> SteadyCurrent:
    """Return the constant current under which the copper rests at a given temperature.

    The same balance as in `steady_state`, with the temperature of the copper given and the
    current unknown. It can be compiled and mapped.

    Args:
        network: As `linearise`.
        losses: As `linearise`.
        drive: As `steady_state`; its current, which must not be 0, is the first guess.
        copper: Temperature of the copper node [degC].
        effects: As `linearise`.

    Raises:
        ValueError: As `linearise`.
    """
    at = field(network, losses, drive, None, effects)
    place = at.place(network.copper_node)
    copper = jnp.asarray(copper, dtype=float)

    def residual(unknown: Vector) -> Vector:
        scaled = drive.scale_current(unknown[place])
        slope = field(network, losses, scaled, None, effects).slope
        return slope(unknown.at[place].set(copper))

    (found,), (is_found,) = _newton(residual, at.start.at[place].set(1.0)[None])
    found = jnp.where(is_found, found, jnp.nan)
    temperature = at.by_node(found.at[place].set(copper))
    return SteadyCurrent(found[place] * drive.current_squared, temperature)


def _newton(
    residual: Callable[[Vector], Vector], first: Float[Array, "start node"]
) -> tuple[Float[Array, "start node"], Bool[Array, " start"]]:
    """Return where each start leads, and whether that is a zero."""

    def step(value: Vector) -> Vector:
        there, slopes = jax.vmap(
            lambda way: jax.jvp(residual, (value,), (way,)), out_axes=(None, 1)
        )(jnp.eye(value.size))
        return eliminate(slopes, -there[:, None])[:, 0]

    def improve(state):
        value, _, count = state
        change = jax.vmap(step)(value)
        after = value + change
        return after, jnp.max(jnp.abs(change) / (1.0 + jnp.abs(after)), axis=1), count + 1

    def is_moving(state):
        _, size, count = state
        return jnp.any(size > TOLERANCE) & (count < MOST_ITERATIONS)  # false for NaN

    sizes = jnp.full(first.shape[:1], jnp.inf)
    value, size, _ = jax.lax.while_loop(is_moving, improve, (first, sizes, jnp.asarray(0)))
    return value, size <= TOLERANCE
