"""The interface of a physical effect, and the sums that effects add to.

An effect is one of three kinds, by what it touches: the heat balance (`HeatEffect`), the nodes
(`NodeEffect`), or the reading (`SensorEffect`). Effects of all kinds compose by folding; none
may read another.
"""

from __future__ import annotations

import abc
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, TypeVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive, Inputs
from ..network import CopperLosses, Link, Network

Temperatures = Mapping[str, Float[Array, "..."]]
"""Of the nodes by name [degC]."""


class Quantity(NamedTuple):
    """A parameter of an effect."""

    unit: str  # Unit in SI.
    # Value at which the effect vanishes, or None for a shape parameter (such as an exponent) that
    # has no meaning once the effect is gone.
    null: float | None
    low: float  # Smallest plausible value.
    high: float  # Largest plausible value.
    typical: float  # Value to start from.
    meaning: str  # What it is, in a few words.
    # Value that it cannot pass, such as 1 for a share; None where there is none.
    limit: float | None = None


class EffectCard(NamedTuple):
    """What the bench needs to know of an effect."""

    id: str  # Name in reports and files.
    family: str  # Group that it belongs to.
    law: str  # Formula in words of the field.
    needs: tuple[str, ...]  # Inputs it cannot do without, names of fields of `Drive`.
    signature: str  # What the bench shows when the effect is missing.
    separating_test: str  # The test that would tell it from its twins.
    parameters: Mapping[str, Quantity]  # Its parameters by name.
    # Whether it shows from one sample to the next, where means over seconds take a fast body for
    # it.
    is_at_once: bool = False
    # Whether a measured balance of the losses holds its heat, so that it is missed under a map
    # alone.
    is_in_balance: bool = False


class AbstractEffect(eqx.Module):
    """A physical effect that the two base networks leave out."""

    card: ClassVar[EffectCard]  # What the bench needs to know of it.
    # Whether it takes the base network apart. It then comes before all others, which find their
    # places in what it leaves, and acts on the heat balance after all others.
    rebuilds: ClassVar[bool] = False

    @classmethod
    def fits(cls, network: Network) -> bool:
        """Whether a base network is one that the effect can be added to."""
        return True


Effect = TypeVar("Effect", bound=AbstractEffect)


class HeatEffect(AbstractEffect):
    """An effect on the heat balance: a source, a conductance, the sink."""

    @abc.abstractmethod
    def apply(self, terms: Terms, temperature: Temperatures, drive: Drive) -> Terms:
        """Return the balance with the effect in it.

        Args:
            terms: Sums so far; ends of links and names of nodes are those of the network.
            temperature: Temperature by node [degC], numbers in a step, arrays over time after it.
            drive: Inputs of the interval.
        """


class NodeEffect(AbstractEffect):
    """An effect that adds a node to the network."""

    @abc.abstractmethod
    def extend(self, network: Network) -> Network:
        """Return the network with the node in it."""

    @abc.abstractmethod
    def start(self, start: Mapping[str, Float[Array, ""]]) -> dict[str, Float[Array, ""]]:
        """Return the start temperatures [degC] with the added node's among them."""


class SensorEffect(AbstractEffect):
    """An effect on what the sensor reads."""

    @abc.abstractmethod
    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """Return the changed reading [degC], shape (edge,).

        Args:
            reading: Reading so far at the edges of the intervals [degC].
            temperature: Temperatures by node at the edges [degC].
            inputs: What drives the network; gives the times of the edges and the sink.
        """


@dataclass(frozen=True)
class Terms:
    """Right-hand side of the heat balance at one instant, and what it was made of."""

    heat: dict[str, Float[Array, "..."]]  # Heat put into each node [W].
    conductance: dict[Link, Float[Array, "..."]]  # Conductance of each link [W/K].
    sink: Float[Array, "..."]  # Temperature of the boundary [degC].
    network: Network  # The network, effects' nodes included.
    losses: CopperLosses  # Resistance, material, and what the loss channel means.
    copper: Float[Array, "..."]  # Copper loss P_js of the base model [W].
    other: Float[Array, "..."]  # Other losses P_ol of the base model [W].
    # Temperature of the second boundary [degC]; None where none is given.
    second_sink: Float[Array, "..."] | None = None

    def add_heat(self, node: str, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with more heat [W] put into a node.

        Raises:
            ValueError: If the network has no such node.
        """
        if node not in self.heat:
            raise ValueError(
                f"The network has no node {node!r}, only {sorted(self.heat)}: "
                "build the effect with `node=`."
            )
        return replace(self, heat=self.heat | {node: self.heat[node] + watts})

    def move_heat(self, source: str, target: str, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with heat [W] moved between nodes at a constant sum."""
        return self.add_heat(source, -watts).add_heat(target, watts)

    def add_other(self, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with more heat [W] put in where the other losses P_ol go."""
        terms = self
        for node, share in self.network.share.items():
            terms = terms.add_heat(node, share * watts)
        return terms

    def add_copper(self, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with more heat [W] in the copper.

        Under a measured balance the total is known: what the copper gains, the other losses
        lose. Under a map it comes on top.
        """
        terms = self.add_heat(self.network.copper_node, watts)
        return terms.add_other(-watts) if self.losses.kind == "balance" else terms

    def scale_conductance(self, link: Link, factor: Float[Array, "..."]) -> Terms:
        """Return the terms with the conductance of a link multiplied by a factor [1].

        Raises:
            ValueError: If the network has no such link.
        """
        if link not in self.conductance:
            raise ValueError(
                f"The network has no link {link}, only {sorted(self.conductance)}: "
                "build the effect with `link=`."
            )
        return replace(self, conductance=self.conductance | {link: self.conductance[link] * factor})

    def with_sink(self, temperature: Float[Array, "..."]) -> Terms:
        """Return the terms with another temperature of the boundary [degC]."""
        return replace(self, sink=temperature)

    def far_end(self, link: Link, temperature: Temperatures) -> Float[Array, "..."]:
        """Return the temperature at the second end of a link [degC], a node or a sink."""
        end = link[1]
        if end == self.network.boundary:
            return self.sink
        if end == self.network.second_boundary and self.second_sink is not None:
            return self.second_sink
        return temperature[end]

    def flow(self, link: Link, temperature: Temperatures) -> Float[Array, "..."]:
        """Return the heat flow [W] through a link, from its first end to its second."""
        difference = temperature[link[0]] - self.far_end(link, temperature)
        return self.conductance[link] * difference


def require(values: Float[Array, "..."] | None, effect: str, channel: str) -> Float[Array, "..."]:
    """Return an input that an effect cannot do without.

    Args:
        values: The input, or None.
        effect: Id of the effect, for the message.
        channel: Channel of the record that it comes from.

    Raises:
        ValueError: If it is not there.
    """
    if values is None:
        raise ValueError(f"{effect} needs the channel {channel}: map it, or drop the effect.")
    return values


def power(speed: Float[Array, "..."], exponent: Float[Array, ""] | float) -> Float[Array, "..."]:
    """Return |speed|^exponent with finite derivatives at standstill [1].

    By the exponential, which many machines at once take in full vector registers: a power of its
    own for each of them takes six times as long.
    """
    size = jnp.abs(speed)
    turns = size > 0.0
    return jnp.where(turns, jnp.exp(exponent * jnp.log(jnp.where(turns, size, 1.0))), 0.0)


LOCKED = 0.01
"""Speed that a locked rotor counts as, over the rated one [1]."""


def at_load(
    drive: Drive, effect: str, exponent: Float[Array, ""] | float, by_load: Float[Array, ""] | float
) -> Float[Array, "..."]:
    r"""Return a loss over itself at rated speed and current [1].

    $$ s^n (1 - m) + \max(s, s_0)^n\, m\,i^2 $$

    What goes with the load is there with the rotor locked too: by its exponent, nearly all of a
    cage's loss and nearly nothing of eddy currents.

    Args:
        drive: Inputs.
        effect: Id of the effect, for the message.
        exponent: n, of the speed; positive.
        by_load: m, how far it goes with the squared current: 0 not at all, 1 in proportion. Where
            it would be negative, there is none.

    Raises:
        ValueError: If there is no speed.
    """
    speed = jnp.abs(require(drive.speed, effect, "speed_rpm"))
    of_speed = (1.0 - by_load) * power(speed, exponent)
    of_load = by_load * drive.current_ratio_squared * power(jnp.maximum(speed, LOCKED), exponent)
    return jnp.maximum(of_speed + of_load, 0.0)


def applies(kind: type[AbstractEffect], network: Network) -> bool:
    """Whether an effect has a place in a network: some act on a link that not all have."""
    link = _places(kind).get("link")
    if not kind.fits(network):
        return False
    return link is None or link in network.links or _leads_out(link, network)


def build(
    kind: type[Effect], values: Mapping[str, Float[Array, ""] | float], network: Network
) -> Effect:
    """Return an effect with its parameters, placed in a network.

    An effect on the stator sits on the copper node of a network without one, and one on the
    link to the sink sits on the first link that leads there.

    Args:
        kind: The effect.
        values: Its parameters by name, in the units of its card.
        network: Where it is to act.

    Raises:
        ValueError: If the network has no place for it.
    """
    if not kind.fits(network):
        raise ValueError(
            f"{kind.card.id} cannot be added to a network with the links {list(network.links)}."
        )
    if not applies(kind, network):
        raise ValueError(
            f"{kind.card.id} acts on the link {_places(kind)['link']}, and the network has only "
            f"{list(network.links)}."
        )
    places = _places(kind)
    if "link" in places:
        places["link"] = placed_link(kind, network)
    if "node" in places and places["node"] not in network.nodes:
        places["node"] = network.copper_node
    return kind(**{name: jnp.asarray(values[name]) for name in kind.card.parameters}, **places)


def placed_link(kind: type[AbstractEffect], network: Network) -> Link | None:
    """Return the link that an effect acts on in a network that it applies to, None if on none.

    Args:
        kind: The effect.
        network: Where it is to act.
    """
    link = _places(kind).get("link")
    if link is None or link in network.links:
        return link
    return next(each for each in network.links if network.boundary in each)


def build_all(
    wanted: Sequence[tuple[type[AbstractEffect], Mapping[str, Float[Array, ""] | float]]],
    network: Network,
) -> tuple[AbstractEffect, ...]:
    """Return effects with their parameters, each placed in the network that it will find.

    An effect that rebuilds the base network comes first, then those of the sink, which surfaces and
    bearings see: the ambient's, then the coolant's. The others keep their order.

    Args:
        wanted: Each effect with its parameters by name, in the units of its card.
        network: The base network.

    Raises:
        ValueError: As `build`.
    """
    built: list[AbstractEffect] = []

    def rank(each: tuple[type[AbstractEffect], Mapping[str, Any]]) -> tuple[bool, bool, str]:
        card = each[0].card
        is_sink = card.family == "sink"
        return not each[0].rebuilds, not is_sink, card.id if is_sink else ""

    for kind, values in sorted(wanted, key=rank):
        effect = build(kind, values, network)
        if kind.rebuilds:
            network = extended(network, [effect])
        built.append(effect)
    return tuple(built)


def extended(network: Network, effects: Iterable[AbstractEffect]) -> Network:
    """Return a network with the nodes that effects bring."""
    for effect in effects:
        if isinstance(effect, NodeEffect):
            network = effect.extend(network)
    return network


def _leads_out(link: Link, network: Network) -> bool:
    """Whether a link of a card is the one to the sink, whatever a network calls its sink."""
    return link[1] in (Network.boundary, network.boundary)


def _places(kind: type[AbstractEffect]) -> dict[str, Any]:
    return {f.name: f.default for f in fields(kind) if f.name in ("link", "node")}
