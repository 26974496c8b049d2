"""The heat balance under one constant drive, as a function from a vector to a vector.

It is the right-hand side that `simulate` and `reference` integrate, effects and their nodes
included. Effects on the sensor do not enter: they change the reading, not the temperatures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .balance import heat_balance, rates
from .effects.base import AbstractEffect, Terms
from .inputs import Drive
from .losses import CopperLosses
from .march import heat_effects, prepare
from .network import Network
from .sensor import Sensor


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
