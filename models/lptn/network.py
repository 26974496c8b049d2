"""The machine as data: its thermal network, the loss of its copper, the sensor that reads it.

A network has nodes with a capacitance, links with a resistance, a boundary or two. The topology is
the keys of two dictionaries, so a third node is one more entry and no new class. `first_order` and
`second_order` are the two networks that the bench calibrates. `CopperLosses` has the resistance at
the present temperature, and says what the loss channel means.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Link = tuple[str, str]
"""Names of the two ends of a link, a boundary last where it is one of them."""


class Network(eqx.Module):
    """A lumped-parameter thermal network.

    Attributes:
        capacitance: Heat capacity by node [J/K].
        resistance: Thermal resistance by link [K/W].
        share: Share of the losses other than copper that heats each node [1]; the shares add up
            to one. Nodes that are not named get none.
        copper_node: Node that the copper loss heats and whose temperature sets R(T).
        boundary: Name of the end of a link that is held at T0.
        second_boundary: Name of the end of a link that is held at the temperature of a second
            sink, such as the air around a machine whose yoke is cooled by a liquid; empty
            where there is none.
    """

    capacitance: dict[str, Float[Array, ""]]
    resistance: dict[Link, Float[Array, ""]]
    share: dict[str, Float[Array, ""]]
    copper_node: str = eqx.field(static=True, default="winding")
    boundary: str = eqx.field(static=True, default="ambient")
    second_boundary: str = eqx.field(static=True, default="")

    def __check_init__(self) -> None:
        nodes = set(self.capacitance)
        for link in self.resistance:
            unknown = set(link) - nodes - set(self.boundaries)
            if unknown or link[0] == link[1] or link[0] in self.boundaries:
                raise ValueError(
                    f"Link {link} must join two different nodes of {sorted(nodes)}, or a node and "
                    f"the boundary {' or '.join(map(repr, self.boundaries))}, the boundary last."
                )
        for name in [self.copper_node, *self.share]:
            if name not in nodes:
                raise ValueError(
                    f"Losses are to heat node {name!r}, which is none of {sorted(nodes)}."
                )

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, sorted."""
        return tuple(sorted(self.capacitance))

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the ends of links that are held at a temperature, that at T0 first."""
        return (self.boundary, self.second_boundary) if self.second_boundary else (self.boundary,)

    @property
    def links(self) -> tuple[Link, ...]:
        """The links, sorted."""
        return tuple(sorted(self.resistance))

    def with_node(
        self,
        name: str,
        *,
        capacitance: Float[Array, ""],
        links: Mapping[str, Float[Array, ""]],
        share: Float[Array, ""] | None = None,
    ) -> Network:
        """Return the network with one more node.

        Args:
            name: Name of the new node.
            capacitance: Its heat capacity [J/K].
            links: Resistance [K/W] to each node (or the boundary) it is tied to.
            share: Share of the other losses that heats it [1]; the rest is scaled down.

        Raises:
            ValueError: If the name is taken or a link leads nowhere.
        """
        if name in self.capacitance or name in self.boundaries:
            raise ValueError(f"The network already has a node {name!r}: choose another name.")
        new_links = {
            ((name, end) if end in self.boundaries else (end, name)): jnp.asarray(R)
            for end, R in links.items()
        }
        shares = dict(self.share)
        if share is not None:
            shares = {node: part * (1 - share) for node, part in shares.items()}
            shares[name] = jnp.asarray(share)
        return Network(
            capacitance=self.capacitance | {name: jnp.asarray(capacitance)},
            resistance=self.resistance | new_links,
            share=shares,
            copper_node=self.copper_node,
            boundary=self.boundary,
            second_boundary=self.second_boundary,
        )


def first_order(Ceq: Float[Array, ""] | float, Req: Float[Array, ""] | float) -> Network:
    """Return the one-node network, Ceq dTw/dt = Pd - (Tw - T0)/Req.

    Args:
        Ceq: Heat capacity of the whole machine [J/K].
        Req: Resistance from the machine to the sink [K/W].

    Valid for: times well below or well above the time constant of the winding; in between the
        winding runs ahead of the body, which one node cannot show.
    Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di
        Torino, 2023, section 4.5.
    """
    return Network(
        capacitance={"winding": jnp.asarray(Ceq)},
        resistance={("winding", "ambient"): jnp.asarray(Req)},
        share={"winding": jnp.asarray(1.0)},
    )


def second_order(
    Ceq_w: Float[Array, ""] | float,
    Ceq_sr: Float[Array, ""] | float,
    Req_w: Float[Array, ""] | float,
    Req_sr: Float[Array, ""] | float,
) -> Network:
    r"""Return the two-node network of winding and stator (with rotor).

    $$ C_{eq,w} \dot T_w = P_{js} - (T_w - T_{sr})/R_{eq,w} $$
    $$ C_{eq,sr} \dot T_{sr} = P_{ol} + (T_w - T_{sr})/R_{eq,w} - (T_{sr} - T_0)/R_{eq,sr} $$

    Args:
        Ceq_w: Heat capacity of the winding with its insulation [J/K].
        Ceq_sr: Heat capacity of stator and rotor without the winding [J/K].
        Req_w: Resistance from the winding to the stator lamination [K/W].
        Req_sr: Resistance from the stator to the sink [K/W].

    Reference: E. Armando, A. Boglietti, F. Mandrile, E. Carpaneto, S. Rubino, D. G. Nair,
        Definition and Experimental Validation of a Second-Order Thermal Model for Electrical
        Machines, IEEE Transactions on Industry Applications, 2021.
    """
    return Network(
        capacitance={"winding": jnp.asarray(Ceq_w), "stator": jnp.asarray(Ceq_sr)},
        resistance={
            ("winding", "stator"): jnp.asarray(Req_w),
            ("stator", "ambient"): jnp.asarray(Req_sr),
        },
        share={"stator": jnp.asarray(1.0)},
    )


COPPER_COEFFICIENT = 234.5
"""B of R(T) = R (B + T)/(B + Tref) for copper [degC]; IEEE 112 and the thesis. IEC 60034-1, 8.6.2
uses 235."""

ALUMINIUM_COEFFICIENT = 225.0
"""B for aluminium [degC]; IEC 60034-1, 8.6.2."""


class CopperLosses(eqx.Module):
    r"""How the electrical record heats the machine.

    $$ P_{js} = m\, I_s^2 R_{s0} (B + T_w)/(B + T_{ref}) $$

    Under `kind="balance"` the channel is the measured total Pd (electrical in minus mechanical
    out), so the rest is P_ol = Pd - P_js and a warmer winding moves heat from the stator to
    itself. Under `kind="map"` the channel is P_ol alone, and P_js comes on top.

    Attributes:
        Rs0: Phase resistance at `reference_temperature` [ohm].
        reference_temperature: Temperature that Rs0 holds for [degC].
        coefficient: B of the material [degC].
        phases: Number of phases m [1].
        kind: What the loss channel means.
        power_gain: Correction of the loss channel [1]; the model uses (1 + gain) Pd.
        torque_offset: Correction of the torque signal, to be added to it [N m]; the model uses
            Pd - offset * speed. It has a meaning under `kind="balance"` only.
        ambient_offset: Correction of the sink temperature, to be added to it [K].
        current_gain: Correction of the current [1]; the model uses (1 + gain) Is.
        shaft_power_gain: Correction of the mechanical power [1]; the model uses Pd - gain Pm. As
            the offset, it has a meaning under `kind="balance"` only.
        shaft_power_offset: Correction of the mechanical power, to be added to it [W].
        second_sink_offset: Correction of the second sink's temperature, to be added to it [K].
    """

    Rs0: Float[Array, ""]
    reference_temperature: Float[Array, ""] | float = 25.0
    coefficient: Float[Array, ""] | float = COPPER_COEFFICIENT
    phases: int = eqx.field(static=True, default=3)
    kind: Literal["balance", "map"] = eqx.field(static=True, default="balance")
    power_gain: Float[Array, ""] | float = 0.0
    torque_offset: Float[Array, ""] | float = 0.0
    ambient_offset: Float[Array, ""] | float = 0.0
    current_gain: Float[Array, ""] | float = 0.0
    shaft_power_gain: Float[Array, ""] | float = 0.0
    shaft_power_offset: Float[Array, ""] | float = 0.0
    second_sink_offset: Float[Array, ""] | float = 0.0

    def slope(self, current_squared: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return k of P_js = k (B + Tw) [W/K], shape as `current_squared` [A^2]."""
        per_square = self.phases * self.Rs0 / (self.coefficient + self.reference_temperature)
        return per_square * (1.0 + self.current_gain) ** 2 * current_squared


def copper_loss(
    current_squared: Float[Array, "..."], temperature: Float[Array, "..."], losses: CopperLosses
) -> Float[Array, "..."]:
    """Return the Joule loss P_js of the winding at its present temperature [W].

    Args:
        current_squared: Mean squared rms phase current [A^2].
        temperature: Mean winding temperature [degC], shape as `current_squared`.
        losses: Resistance and material.

    Raises:
        ValueError: If the shapes differ.

    Valid for: skin and proximity effects negligible or contained in Rs0.
    Reference: IEC 60034-1, 8.6.2 (resistance and temperature).

    Example:
        >>> losses = CopperLosses(Rs0=jnp.asarray(0.1), reference_temperature=20.0)
        >>> round(float(copper_loss(jnp.asarray(100.0), jnp.asarray(20.0), losses)), 9)
        30.0
    """
    if jnp.shape(current_squared) != jnp.shape(temperature):
        raise ValueError(
            f"Current has shape {jnp.shape(current_squared)}, temperature "
            f"{jnp.shape(temperature)}: expected the same."
        )
    return losses.slope(current_squared) * (losses.coefficient + temperature)


class Sensor(eqx.Module):
    """A thermometer in one node with a scale and an offset error, and a lag if it has one.

    Attributes:
        node: Node that it sits in.
        gain: Relative error of the rise above the sink [1].
        offset: Constant error [K].
        lag: Time constant of a first-order lag [s]; None for a sensor that follows at once. It
            starts in equilibrium.
    """

    node: str = eqx.field(static=True, default="winding")
    gain: Float[Array, ""] | float = 0.0
    offset: Float[Array, ""] | float = 0.0
    lag: Float[Array, ""] | float | None = None

    def read(
        self, temperature: Float[Array, "..."], ambient: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the reading [degC], T + gain (T - T0) + offset, shape as `temperature`.

        Args:
            temperature: Temperature of the node [degC].
            ambient: Sink temperature T0 at the same times [degC].
        """
        return temperature + self.gain * (temperature - ambient) + self.offset

    def follow(
        self,
        sensed: Float[Array, "..."],
        before: Float[Array, "..."],
        after: Float[Array, "..."],
        step: Float[Array, ""],
    ) -> Float[Array, "..."]:
        """Return what the sensor shows at the end of an interval [degC].

        Exact where the reading without the lag runs straight over the interval.

        Args:
            sensed: What it showed at the beginning [degC].
            before: Reading without the lag at the beginning [degC].
            after: The same at the end [degC].
            step: Length of the interval [s].
        """
        if self.lag is None:
            return after
        return _follow(sensed, before, after, *_weights(self.lag, step))


def lagged(
    reading: Float[Array, " edge"], lag: Float[Array, ""] | float, step: Float[Array, " time"]
) -> Float[Array, " edge"]:
    """Return a reading with a first-order lag that starts in equilibrium [degC], shape (edge,).

    Exact where the reading runs straight between edges, so that a lag much shorter than the
    interval is as stable as a long one.

    Args:
        reading: Reading without the lag at the edges of the intervals [degC].
        lag: Time constant [s].
        step: Length of each interval [s].
    """

    def advance(sensed, x):
        sensed = _follow(sensed, *x)
        return sensed, sensed

    rows = (reading[:-1], reading[1:], *_weights(lag, step))
    _, sensed = jax.lax.scan(advance, reading[0], rows)
    return jnp.concatenate([reading[:1], sensed])


def _weights(lag, step):
    """Return the decay over an interval, and its mean over it [1]."""
    # the summand keeps value and one-sided gradient finite at no lag
    ratio = step / (lag + 1e-9 * step)
    return jnp.exp(-ratio), -jnp.expm1(-ratio) / ratio


def _follow(sensed, before, after, decay, mean):
    """Return the response to a ramp from `before` to `after`."""
    return decay * sensed + (mean - decay) * before + (1.0 - mean) * after
