"""The interface of a physical effect, and the sums that effects add to.

An effect is one of three kinds, by what it touches: the heat balance (`HeatEffect`), the nodes
(`NodeEffect`), or the reading (`SensorEffect`). Effects of all kinds compose by folding; none
may read another.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Link, Network


class Quantity(NamedTuple):
    """A parameter of an effect.

    Attributes:
        unit: Unit in SI.
        null: Value at which the effect vanishes, or None for a shape parameter (such as an
            exponent) that has no meaning once the effect is gone.
        low: Smallest plausible value.
        high: Largest plausible value.
        typical: Value to start from.
        meaning: What it is, in a few words.
    """

    unit: str
    null: float | None
    low: float
    high: float
    typical: float
    meaning: str


class EffectCard(NamedTuple):
    """What the bench needs to know of an effect.

    Attributes:
        id: Name in reports and files.
        family: Group that it belongs to.
        law: Formula in words of the field.
        needs: Inputs it cannot do without, names of fields of `Drive`.
        signature: What the bench shows when the effect is missing.
        separating_test: The test that would tell it from its twins.
        parameters: Its parameters by name.
    """

    id: str
    family: str
    law: str
    needs: tuple[str, ...]
    signature: str
    separating_test: str
    parameters: Mapping[str, Quantity]


class AbstractEffect(eqx.Module):
    """A physical effect that the two base networks leave out."""

    card: ClassVar[EffectCard]


class HeatEffect(AbstractEffect):
    """An effect on the heat balance: a source, a conductance, the sink."""

    @abc.abstractmethod
    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
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
        edges: Float[Array, " edge"],
    ) -> Float[Array, " edge"]:
        """Return the changed reading [degC], shape (edge,).

        Args:
            reading: Reading so far at the edges of the intervals [degC].
            temperature: Temperatures by node at the edges [degC].
            edges: Times of the edges [s].
        """


@dataclass(frozen=True)
class Terms:
    """Right-hand side of the heat balance at one instant.

    Attributes:
        heat: Heat put into each node [W].
        conductance: Conductance of each link [W/K].
        sink: Temperature of the boundary [degC].
        boundary: Name of the boundary.
    """

    heat: dict[str, Float[Array, "..."]]
    conductance: dict[Link, Float[Array, "..."]]
    sink: Float[Array, "..."]
    boundary: str

    def add_heat(self, node: str, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with more heat [W] put into a node."""
        return replace(self, heat=self.heat | {node: self.heat[node] + watts})

    def move_heat(self, source: str, target: str, watts: Float[Array, "..."]) -> Terms:
        """Return the terms with heat [W] moved between nodes at a constant sum."""
        return self.add_heat(source, -watts).add_heat(target, watts)

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

    def flow(
        self, link: Link, temperature: Mapping[str, Float[Array, "..."]]
    ) -> Float[Array, "..."]:
        """Return the heat flow [W] through a link, from its first end to its second."""
        first, second = link
        far = self.sink if second == self.boundary else temperature[second]
        return self.conductance[link] * (temperature[first] - far)
