"""A housing node: next to nothing is seen of it in the winding."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..network import Network
from .base import EffectCard, NodeEffect, Quantity

HOUSING = "housing"

TINY = 1e-12
"""Share that is left at the null value, where 0/0 would stand [1]."""


class HousingNode(NodeEffect):
    r"""The stator splits into a core and a housing that stands between it and the sink.

    $$ C_h \dot T_h = \frac{T_{sr} - T_h}{(1-x) R} - \frac{T_h - T_0}{x R}, \quad
       C_h = \frac{\tau}{x (1-x) R} $$

    The resistance R to the sink is divided; at x = 0 the housing sits at the temperature of the
    sink and the base network is left. Seen from the stator, with a constant sink, this ladder is
    exactly equivalent to the base network with a side body of capacity x tau/((1-x) R) and
    resistance (1-x) R/x. That is the form it is carried in here, so that other effects find the
    link to the sink; and it is why a winding sensor never tells a housing from a neighbour. The
    node's temperature T_b is that of the side body; the housing itself is at T0 + x (T_b - T0).

    Attributes:
        x: Share of the resistance that lies between housing and sink [1].
        tau: Time constant of the housing against core and sink [s].
        link: Link that is divided.

    Valid for: a housing of one temperature, and a sink that is slow against tau.
    """

    x: Float[Array, ""]
    tau: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="housing_node",
        family="extra node",
        law="stator splits into core and housing: R -> (1-x) R + x R with Ch between",
        needs=(),
        signature="nearly nothing: usually not identifiable from the winding",
        separating_test="a thermocouple on the housing during a step of load of 60 minutes",
        parameters={
            "x": Quantity(
                "1", 0.0, 0.0, 0.9, 0.4, "share of the resistance outside the housing", 1.0
            ),
            "tau": Quantity("s", None, 20.0, 20e3, 200.0, "time constant of the housing"),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        whole = network.resistance[self.link]
        conductance = (self.x + TINY) / ((1.0 - self.x) * whole)
        return network.with_node(
            HOUSING,
            capacitance=self.tau * conductance,
            links={self.link[0]: 1.0 / conductance},
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the side body at the stator's temperature: a steady housing."""
        return dict(start) | {HOUSING: start[self.link[0]]}
