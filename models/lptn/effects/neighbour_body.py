"""A neighbouring body: the cool-down stalls above ambient when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..network import Network
from .base import EffectCard, NodeEffect, Quantity

TINY = 1e-9
"""Capacity that is left at the null value, where 0/0 would stand [J/K]."""


class NeighbourBody(NodeEffect):
    r"""A third mass (flange, gearbox, inverter) exchanges heat with the stator.

    $$ C \dot T_b = G\,(T_{sr} - T_b), \quad G = C/\tau $$

    It is parametrised by capacity and time constant: the effect vanishes with the capacity, and
    what a small body does already has the right course in time. With the conductance going to
    zero at a given capacity, a body would look like one more way to the sink.

    Attributes:
        C: Heat capacity of the body [J/K].
        tau: Time constant of the body against the stator [s]; its resistance is tau/C.
        node: Node that it is tied to.

    Valid for: a body that loses little heat to the air of its own within the test.
    """

    C: Float[Array, ""]
    tau: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="neighbour_body",
        family="extra node",
        law="third node on the stator: C dTb/dt = (C/tau) (Tsr - Tb)",
        needs=(),
        signature="the cool-down stalls above ambient",
        separating_test="a long cool-down, with a thermocouple on the flange",
        parameters={
            "C": Quantity("J/K", 0.0, 100.0, 60e3, 5e3, "heat capacity of the body"),
            "tau": Quantity("s", None, 300.0, 20e3, 2500.0, "time constant of the body"),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        if self.node not in network.capacitance:
            raise ValueError(
                f"The network has no node {self.node!r}, only {list(network.nodes)}: "
                "build the effect with `node=`."
            )
        capacity = self.C + TINY
        return network.with_node(
            "neighbour", capacitance=capacity, links={self.node: self.tau / capacity}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the body at the stator's temperature, as after a long soak."""
        return dict(start) | {"neighbour": start[self.node]}
