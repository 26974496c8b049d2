"""The heat balance under one constant drive, as a function from a vector to a vector.

It is the right-hand side that `simulate` and `reference` integrate, effects and their nodes
included. Effects on the sensor do not enter: they change the reading, not the temperatures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .effects.base import AbstractEffect, Terms
from .inputs import Drive
from .losses import CopperLosses
from .march import heat_effects, prepare
from .network import Link, Network
from .sensor import Sensor
from .stepping import heat_balance, rates


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
