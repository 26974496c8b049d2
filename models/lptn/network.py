"""Thermal networks as data: nodes with a capacitance, links with a resistance, a boundary or two.

The topology is the keys of two dictionaries, so a third node is one more entry and no new
class. `first_order` and `second_order` are the two networks that the bench calibrates.
"""

from __future__ import annotations

from collections.abc import Mapping

import equinox as eqx
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
