"""An end-winding node: a fast residual with the sign of a step of current when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive, Inputs
from ..network import Network
from .base import EffectCard, HeatEffect, NodeEffect, Quantity, SensorEffect, Terms

OVERHANG = "overhang"

TINY = 1e-12
"""Share that is left at the null value, where 0/0 would stand [1]."""


class EndWindingNode(NodeEffect, HeatEffect, SensorEffect):
    r"""The winding splits into a part in the slots and an overhang that only the slots cool.

    $$ f C_w \dot T_e = f P_{js} - \frac{f C_w}{\tau}\,(T_e - T_w), \quad
       T_m = T_w + p\,(T_e - T_w) $$

    The resistance between the two is tau/(f C_w); given by the time constant, the effect vanishes
    with the share f and no node becomes stiff. The overhang's loss is reckoned at the temperature
    of the slots. The copper loss is split at a constant sum.

    Attributes:
        f: Share of the winding that is overhang [1].
        tau: Time constant of the overhang against the slots [s].
        p: Place of the sensor: share of the overhang in the reading [1].

    Valid for: an overhang that hands its heat to the slots, not to the air.
    """

    f: Float[Array, ""]
    tau: Float[Array, ""]
    p: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="end_winding_node",
        family="extra node",
        law="winding splits into slot and overhang, share f, sensor between them",
        needs=(),
        signature="a fast residual with the sign of a step of the squared current",
        separating_test="steps of current of 3 minutes up and down, with a second sensor in a slot",
        parameters={
            "f": Quantity("1", 0.0, 0.0, 0.6, 0.4, "share of the winding that is overhang", 1.0),
            "tau": Quantity("s", None, 5.0, 150.0, 25.0, "time constant of the overhang"),
            "p": Quantity("1", 0.0, 0.0, 1.0, 0.5, "share of the overhang in the reading", 1.0),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        winding = network.copper_node
        whole = network.capacitance[winding]
        part = (self.f + TINY) * whole
        split = Network(
            capacitance=network.capacitance | {winding: (1.0 - self.f) * whole},
            resistance=network.resistance,
            share=network.share,
            copper_node=winding,
            boundary=network.boundary,
            second_boundary=network.second_boundary,
        )
        return split.with_node(OVERHANG, capacitance=part, links={winding: self.tau / part})

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the overhang at the winding's temperature."""
        return dict(start) | {OVERHANG: start["winding"]}

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        moved = (self.f + TINY) * terms.copper
        return terms.move_heat(terms.network.copper_node, OVERHANG, moved)

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return reading + self.p * (temperature[OVERHANG] - temperature["winding"])
