"""A neighbouring body: the cool-down stalls above ambient when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..network import Network
from .base import EffectCard, NodeEffect, Quantity


class NeighbourBody(NodeEffect):
    r"""A third mass (flange, gearbox, inverter) exchanges heat with the stator.

    $$ C \dot T_b = G\,(T_{sr} - T_b) $$

    It is parametrised by the conductance, so that the effect vanishes at zero.

    Attributes:
        G: Conductance between stator and body [W/K].
        C: Heat capacity of the body [J/K].
        node: Node that it is tied to.

    Valid for: a body that loses little heat to the air of its own within the test.
    """

    G: Float[Array, ""]
    C: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="neighbour_body",
        family="extra node",
        law="third node on the stator: C dTb/dt = G (Tsr - Tb)",
        needs=(),
        signature="the cool-down stalls above ambient",
        separating_test="a long cool-down, with a thermocouple on the flange",
        parameters={
            "G": Quantity("W/K", 0.0, 0.2, 10.0, 3.0, "conductance to the stator"),
            "C": Quantity("J/K", None, 500.0, 50e3, 10e3, "heat capacity of the body"),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        if self.node not in network.capacitance:
            raise ValueError(
                f"The network has no node {self.node!r}, only {list(network.nodes)}: "
                "build the effect with `node=`."
            )
        return network.with_node(
            "neighbour", capacitance=self.C, links={self.node: _resistance(self.G)}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the body at the stator's temperature, as after a long soak."""
        return dict(start) | {"neighbour": start[self.node]}


def _resistance(G: Float[Array, ""]) -> Float[Array, ""]:
    # 1/0 is inf and the link's conductance 1/inf is an exact zero, but the gradient through
    # inf is NaN; a conductance of 1e-12 W/K moves less than a nanojoule in a day.
    return 1.0 / (G + 1e-12)
