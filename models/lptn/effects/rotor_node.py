"""A rotor node: the stator is still fed after a stop when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Network
from .base import EffectCard, HeatEffect, NodeEffect, Quantity, Terms

ROTOR = "rotor"

TINY = 1e-12
"""Share that is left at the null value, where 0/0 would stand [1]."""


class RotorNode(NodeEffect, HeatEffect):
    r"""Part of the losses arises in the rotor, which hands it on to the stator with a delay.

    $$ p\,C\,\dot T_r = p\,P_{ol} - \frac{p\,C}{\tau}\,(T_r - T_{sr}) $$

    Heat capacity and conductance of the rotor go with its share p, so that nothing is left of it
    at p = 0: the rotor's capacity is p C, its resistance to the stator tau/(p C). The heat is
    moved from the other losses at a constant sum.

    Attributes:
        p: Share of the other losses that arises in the rotor [1].
        C: Heat capacity per share [J/K]; 2...8 kJ/K of the rotor itself.
        tau: Time constant of the rotor against the stator [s].
        node: Node that it is tied to.

    Valid for: a rotor that loses its heat through the air gap alone.
    """

    p: Float[Array, ""]
    C: Float[Array, ""]
    tau: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="rotor_node",
        family="extra node",
        law="share p of Pol heats a rotor node tied to the stator: moves heat at a constant sum",
        needs=(),
        signature="the stator is still fed after a stop",
        separating_test="30 minutes at rated speed, then a stop and 60 minutes of cool-down",
        parameters={
            "p": Quantity("1", 0.0, 0.02, 0.5, 0.2, "share of the other losses in the rotor", 1.0),
            "C": Quantity("J/K", None, 3e3, 100e3, 20e3, "heat capacity of the rotor per share"),
            "tau": Quantity("s", None, 150.0, 4000.0, 900.0, "time constant of the rotor"),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        capacity = (self.p + TINY) * self.C
        return network.with_node(
            ROTOR, capacitance=capacity, links={self.node: self.tau / capacity}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the rotor at the stator's temperature, as after a long soak."""
        return dict(start) | {ROTOR: start[self.node]}

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        # the same tiny share as of the capacity: the rotor's temperature is regular at p = 0
        moved = (self.p + TINY) * terms.other
        return terms.add_other(-moved).add_heat(ROTOR, moved)
