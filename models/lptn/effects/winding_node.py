"""A winding apart from the iron: the fast part of every step of load when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Network
from .base import EffectCard, HeatEffect, NodeEffect, Quantity, Terms

BODY = "stator"

LARGEST_SHARE = 0.3
"""Share of the heat capacity that a winding has at most [1]; machines have 0.01 to 0.3."""

LARGEST_PRODUCT = LARGEST_SHARE * (1.0 - LARGEST_SHARE)


class WindingNode(NodeEffect, HeatEffect):
    r"""The one node splits into a winding, which the copper heats, and the body behind it.

    $$ c C \dot T_w = P_{js} - \frac{T_w - T_b}{x R}, \quad
       (1-c) C \dot T_b = P_{ol} + \frac{T_w - T_b}{x R} - \frac{T_b - T_0}{R}, \quad
       c (1-c) = \frac{\tau}{x R C} $$

    C and R are those of the one node. With it the first order is the second order, with
    Ceq,w = c C, Ceq,sr = (1-c) C, Req,w = x R and Req,sr = R. It is given by the resistance in
    front of the body and by the time constant of the winding against it: with the resistance
    alone going to zero the winding would become stiff.

    A resistance so small that the time constant would take a winding of more than
    `LARGEST_SHARE` of the capacity stands for no machine. There the share stays at that limit,
    and of the heat that would drive winding and body apart only a part is let through, which
    vanishes with x: at x = 0 both keep one temperature and the base network is left, whatever
    other effects do to it.

    The body is called stator, as in the second order; the sink, the other losses and the effects
    on the stator are its own. This effect looks at the whole balance, so it acts on it last.

    Attributes:
        x: Resistance from winding to body over that from body to sink [1].
        tau: Time constant of the winding against the body, c (1-c) C x R [s].

    Valid for: a machine that starts soaked at one temperature.
    """

    x: Float[Array, ""]
    tau: Float[Array, ""]

    rebuilds: ClassVar[bool] = True

    card: ClassVar[EffectCard] = EffectCard(
        id="winding_node",
        family="extra node",
        law="one node splits into winding and body: Pjs heats the winding, x R before the body",
        needs=(),
        signature="the fast part of every step of load is missing",
        separating_test="steps of current of 5 minutes up and down at one speed",
        parameters={
            "x": Quantity("1", 0.0, 0.0, 4.0, 1.0, "resistance winding to body over body to sink"),
            "tau": Quantity("s", None, 15.0, 400.0, 80.0, "time constant winding against body"),
        },
    )

    @classmethod
    def fits(cls, network: Network) -> bool:
        """Whether the network is one node tied to the sink."""
        return network.links == ((network.copper_node, network.boundary),)

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        if not self.fits(network):
            raise ValueError(
                f"winding_node splits a network of one node tied to the sink, and this one has the "
                f"links {list(network.links)}: it already has a winding apart, drop the effect."
            )
        winding, sink = network.copper_node, network.boundary
        R, C = network.resistance[winding, sink], network.capacitance[winding]
        product = self._product(self._through(R, C))
        c = 0.5 * (1.0 - jnp.sqrt(1.0 - 4.0 * product))
        return Network(
            capacitance={winding: c * C, BODY: (1.0 - c) * C},
            resistance={(winding, BODY): self.tau / (product * C), (BODY, sink): R},
            share={BODY: network.share[winding]},
            copper_node=winding,
            boundary=sink,
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the body at the winding's temperature: a soaked machine."""
        (winding,) = start
        return {winding: start[winding], BODY: start[winding]}

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`; nothing changes where the resistance is that of a machine."""
        winding, sink = terms.network.copper_node, terms.network.boundary
        capacity = terms.network.capacitance
        C = capacity[winding] + capacity[BODY]
        c = capacity[winding] / C
        into_winding, into_body = terms.heat[winding], terms.heat[BODY]
        for link in terms.network.links:
            if link == (winding, BODY):
                continue  # the heat between the two brings them together
            flow = terms.flow(link, temperature)
            into_winding -= flow * ((link[0] == winding) - (link[1] == winding))
            into_body -= flow * ((link[0] == BODY) - (link[1] == BODY))
        apart = (1.0 - c) * into_winding - c * into_body
        R = terms.network.resistance[BODY, sink]
        held_back = 1.0 - jnp.minimum(1.0, LARGEST_PRODUCT * self._through(R, C))
        return terms.move_heat(winding, BODY, held_back * apart)

    def _through(self, R: Float[Array, ""], C: Float[Array, ""]) -> Float[Array, ""]:
        """Return 1/(c (1-c)) of a machine with this resistance and time constant [1]."""
        return self.x * R * C / self.tau

    @staticmethod
    def _product(through: Float[Array, ""]) -> Float[Array, ""]:
        return 1.0 / jnp.maximum(through, 1.0 / LARGEST_PRODUCT)
