"""Effects that add a body: a neighbour, rotor, end winding, housing, or winding."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive, Inputs
from ..network import Network
from .base import (
    EffectCard,
    HeatEffect,
    NodeEffect,
    Quantity,
    SensorEffect,
    Temperatures,
    Terms,
    at_load,
)

LEAST_CAPACITY = 1e-9
"""Capacity that is left at the null value, where 0/0 would stand [J/K]."""


class NeighbourBody(NodeEffect):
    r"""A third mass (flange, gearbox, inverter) exchanges heat with the stator.

    $$ C \dot T_b = G\,(T_{sr} - T_b), \quad G = C/\tau $$

    It is parametrised by capacity and time constant: the effect vanishes with the capacity, and
    what a small body does already has the right course in time. With the conductance going to
    zero at a given capacity, a body would look like one more way to the sink.

    Valid for: a body that loses little heat to the air of its own within the test.
    """

    C: Float[Array, ""]
    tau: Float[Array, ""]  # Against the stator: tau/C is the resistance between them.
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
        capacity = self.C + LEAST_CAPACITY
        return network.with_node(
            "neighbour", capacitance=capacity, links={self.node: self.tau / capacity}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the body at the stator's temperature, as after a long soak."""
        return dict(start) | {"neighbour": start[self.node]}


ROTOR = "rotor"

LEAST_HEAT = 1e-9
"""Heat of a rotor that is left at the null value, where 0/0 would stand [W]."""

LEAST_SHARE = 1e-12
"""Share that is left at the null value, where 0/0 would stand [1]."""


class RotorNode(NodeEffect, HeatEffect):
    r"""Part of the losses arises in the rotor, which hands it on to the stator with a delay.

    $$ C_r \dot T_r = P_r - \frac{P_r^*}{\Delta}\,(T_r - T_{sr}), \quad
       P_r = P_r^* (s^n (1 - m) + \max(s, s_0)^n\, m\,i^2), \quad C_r = \tau P_r^*/\Delta $$

    The resistance to the stator is given by the rise above it, and the heat capacity by the time
    constant: nothing is left of the rotor where no heat arises in it. The heat is moved from the
    other losses at a constant sum. That of a cage goes with the load alone, whatever the speed, and
    is there with the rotor locked; eddy currents in magnets go with the speed, and less with the
    load.

    Valid for: a rotor that loses its heat through the air gap alone.
    """

    P: Float[Array, ""]  # P_r^* of the law.
    rise: Float[Array, ""]  # Delta of the law.
    tau: Float[Array, ""]
    n: Float[Array, ""]  # That of a cage is nearly 0.
    m: Float[Array, ""]  # 0 not at all, 1 in proportion to the squared current.
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="rotor_node",
        family="extra node",
        law="P s^n (1 - m + m i^2) heats a rotor node tied to the stator: moves heat at a constant "
        "sum",
        needs=("speed",),
        signature="the stator is still fed after a stop",
        separating_test="30 minutes at rated speed, then a stop and 60 minutes of cool-down",
        parameters={
            "P": Quantity("W", 0.0, 1.0, 150.0, 40.0, "heat of the rotor at rated load and speed"),
            "rise": Quantity("K", None, 3.0, 60.0, 15.0, "rise of the rotor above the stator"),
            "tau": Quantity("s", None, 150.0, 4000.0, 900.0, "time constant of the rotor"),
            "n": Quantity("1", None, 0.05, 2.6, 1.0, "exponent of the speed"),
            "m": Quantity("1", None, -0.3, 1.5, 0.6, "how far its heat goes with the load"),
        },
    )

    def extend(self, network: Network) -> Network:
        """As `NodeEffect.extend`."""
        conductance = (self.P + LEAST_HEAT) / self.rise
        return network.with_node(
            ROTOR, capacitance=self.tau * conductance, links={self.node: 1.0 / conductance}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the rotor at the stator's temperature, as after a long soak."""
        return dict(start) | {ROTOR: start[self.node]}

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        # the same tiny heat as of the conductance: the rotor's temperature is regular at P = 0
        moved = (self.P + LEAST_HEAT) * at_load(drive, "rotor_node", self.n, self.m)
        return terms.add_other(-moved).add_heat(ROTOR, moved)


OVERHANG = "overhang"


class EndWindingNode(NodeEffect, HeatEffect, SensorEffect):
    r"""The winding splits into a part in the slots and an overhang that only the slots cool.

    $$ f C_w \dot T_e = f P_{js} \frac{B + T_e}{B + T_w} - \frac{f C_w}{\tau}\,(T_e - T_w), \quad
       T_m = T_w + p\,(T_e - T_w) $$

    The resistance between the two is tau/(f C_w); given by the time constant, the effect vanishes
    with the share f. Each part's copper has the loss of its own temperature: reckoned at that of
    the slots, `Req_w` came out 10 % too large.

    Valid for: an overhang that hands its heat to the slots, not to the air.
    """

    f: Float[Array, ""]
    tau: Float[Array, ""]
    p: Float[Array, ""]  # Where the sensor lies.

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
        part = (self.f + LEAST_SHARE) * whole
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

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`."""
        winding = terms.network.copper_node
        part = (self.f + LEAST_SHARE) * terms.copper
        warmer = temperature[OVERHANG] - temperature[winding]
        more = part * warmer / (terms.losses.coefficient + temperature[winding])
        return terms.add_copper(more).move_heat(winding, OVERHANG, part + more)

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return reading + self.p * (temperature[OVERHANG] - temperature["winding"])


HOUSING = "housing"


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

    Valid for: a housing of one temperature, and a sink that is slow against tau.
    """

    x: Float[Array, ""]
    tau: Float[Array, ""]  # Against core and sink.
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
        conductance = (self.x + LEAST_SHARE) / ((1.0 - self.x) * whole)
        return network.with_node(
            HOUSING, capacitance=self.tau * conductance, links={self.link[0]: 1.0 / conductance}
        )

    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start with the side body at the stator's temperature: a steady housing."""
        return dict(start) | {HOUSING: start[self.link[0]]}


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

    Valid for: a machine that starts soaked at one temperature.
    """

    x: Float[Array, ""]
    tau: Float[Array, ""]  # c (1 - c) C R.

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

    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """As `HeatEffect.apply`; nothing changes where the resistance is that of a machine."""
        winding, capacity = terms.network.copper_node, terms.network.capacitance
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
        return terms.move_heat(winding, BODY, self.holds_back(terms.network) * apart)

    def holds_back(self, network: Network) -> Float[Array, ""]:
        """Return the part of the heat that does not drive winding and body apart in an extended
        network [1]: 0 where the resistance is that of a machine.
        """
        R = network.resistance[BODY, network.boundary]
        C = network.capacitance[network.copper_node] + network.capacitance[BODY]
        return 1.0 - jnp.minimum(1.0, LARGEST_PRODUCT * self._through(R, C))

    def _through(self, R: Float[Array, ""], C: Float[Array, ""]) -> Float[Array, ""]:
        """Return 1/(c (1-c)) of a machine with this resistance and time constant [1]."""
        return self.x * R * C / self.tau

    @staticmethod
    def _product(through: Float[Array, ""]) -> Float[Array, ""]:
        return 1.0 / jnp.maximum(through, 1.0 / LARGEST_PRODUCT)
