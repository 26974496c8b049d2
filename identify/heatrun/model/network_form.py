"""The form of a network: its nodes and links, and the parameter and prior behind each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .parameters import Parameter

if TYPE_CHECKING:
    from jaxtyping import Array, Float

    from lptn import Network, SpeedLoss

RESISTANCE = (
    "log-normal; its 95 % span a factor of 20 to either side, which holds machines from 1 kW "
    "air-cooled to 100 kW water-cooled"
)
_SD_RESISTANCE = 1.5
CAPACITANCE = (
    "log-normal; its 95 % span a factor of 7 to either side: copper and iron of 1 kg to 60 kg "
    "and 3 kg to 150 kg, at 0.39 and 0.48 kJ/(kg K)"
)
_SD_CAPACITANCE = 1.0


def capacitance(node: str, is_winding: bool, said: Mapping, where: str) -> Parameter:
    """Return the heat capacity of a node [J/K], with what the file says of it."""
    found = said_of(said, "capacitance", node)
    name = found or f"Ceq_{node}"
    default = Parameter(
        name, "J/K", f"heat capacity of {node}", "network", "log",
        500.0 if is_winding else 1e4, _SD_CAPACITANCE, CAPACITANCE,
    )  # fmt: skip
    return prior(default, said.get(name, {}), f"{where}, [parameters.{name}]")


def resistance(link: Link, said: Mapping, where: str) -> Parameter:
    """Return the resistance of a link [K/W], with what the file says of it."""
    found = said_of(said, "resistance", list(link)) or said_of(said, "resistance", [*link][::-1])
    name = found or f"Req_{link[0]}_{link[1]}"
    default = Parameter(
        name, "K/W", f"resistance from {link[0]} to {link[1]}", "network", "log",
        0.15, _SD_RESISTANCE, RESISTANCE,
    )  # fmt: skip
    return prior(default, said.get(name, {}), f"{where}, [parameters.{name}]")


def prior(default: Parameter, keys: Mapping[str, Any], where: str) -> Parameter:
    """Return a parameter with the prior that its section gives."""
    numbers = {}
    for key in ("value", "sd", "sd_log", "relative_sd", "fixed"):
        if key in keys:
            number = keys[key]
            is_number = isinstance(number, int | float) and not isinstance(number, bool)
            if not is_number or not math.isfinite(number) or not number > 0.0:
                raise InputError(f"{key} = {number!r:.40}: expected a number above 0.", where=where)
            numbers[key] = float(number)
    for key in ("meaning", "basis"):
        if key in keys and not isinstance(keys[key], str):
            raise InputError(f"{key}: expected a text.", where=where)
    is_log = default.transform == "log"
    wrong = [key for key in numbers if key in (("sd",) if is_log else ("sd_log", "relative_sd"))]
    if wrong:
        raise InputError(
            f"{wrong[0]} has no meaning for {default.name}.",
            where=where,
            remedy="Give relative_sd = 0.5, for example." if is_log else "Give sd.",
        )
    sd = numbers.get("sd_log" if is_log else "sd", default.sd)
    if "relative_sd" in numbers:
        sd = math.log1p(numbers["relative_sd"])
    stated = [key for key in ("value", "sd", "sd_log", "relative_sd") if key in numbers]
    return replace(
        default,
        centre=numbers.get("value", default.centre),
        sd=sd,
        fixed=numbers.get("fixed"),
        meaning=keys.get("meaning", default.meaning),
        basis=keys.get("basis", "stated in the network file" if stated else default.basis),
    )


def prior_text(parameter: Parameter) -> dict[str, Any]:
    """Return the keys of a parameter's section, which read back to the same prior."""
    text: dict[str, Any] = {"meaning": parameter.meaning, "basis": parameter.basis}
    if parameter.fixed is not None:
        return text | {"fixed": parameter.fixed}
    # of a logarithm exactly as it is carried: exp and back would lose the last digit
    sd = "sd_log" if parameter.transform == "log" else "sd"
    return text | {"value": parameter.centre, sd: parameter.sd}


def said_of(said: Mapping[str, Any], key: str, value: Any) -> str | None:
    """Return the section whose key has a value, such as `capacitance = "winding"`."""
    names = [name for name, keys in said.items() if keys.get(key) == value]
    return names[0] if names else None


Link = tuple[str, str]

WINDING = "winding_degC"
"""Channel of the winding's sensor, which every network has."""


@dataclass(frozen=True)
class SpeedLossForm:
    """A kind of loss that follows the speed, without numbers."""

    kind: str  # `"iron"` or `"mechanical"`.
    linear: Parameter  # Parameter of the part that grows with the speed [W at 1000 rpm].
    square: Parameter  # Parameter of the part that grows with its square [W at 1000 rpm].
    # Share [1] of it by node, as `NetworkForm.share`.
    share: tuple[tuple[str, float | Parameter | None], ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters: watts, then shares."""
        shares = [share for _, share in self.share if isinstance(share, Parameter)]
        return (self.linear, self.square, *shares)

    def build(self, values: Mapping[str, Float[Array, ""] | float]) -> tuple[SpeedLoss, ...]:
        """Return the loss of each node for values by parameter name [their units]."""
        import jax.numpy as jnp

        from lptn import SpeedLoss

        linear, square = (jnp.asarray(values[p.name]) for p in (self.linear, self.square))
        shares = shares_of(self.share, values)
        return tuple(SpeedLoss(part * linear, part * square, node) for node, part in shares.items())


def shares_of(
    share: tuple[tuple[str, float | Parameter | None], ...],
    values: Mapping[str, Float[Array, ""] | float],
) -> dict[str, Float[Array, ""]]:
    """Return shares by node [1] that add up to one, for values by parameter name."""
    import jax.numpy as jnp

    shares: dict[str, Float[Array, ""]] = {}
    for node, part in share:
        if part is not None:
            number = values[part.name] if isinstance(part, Parameter) else part
            shares[node] = jnp.asarray(number)
    for node, part in share:
        if part is None:
            shares[node] = 1.0 - sum(shares.values(), start=jnp.asarray(0.0))
    return shares


@dataclass(frozen=True, eq=False)
class NetworkForm:
    """A network without numbers: hashable, so that it keys a compilation.

    Two are equal if they have the same nodes, links, losses, sensors and names; their priors are
    numbers, and may differ.
    """

    name: str  # As in `--model`, in file names and in JSON.
    title: str  # As in sentences, such as `"second order"`.
    # Parameter of each node [J/K], in the order of the nodes.
    capacitance: tuple[tuple[str, Parameter], ...]
    # Parameter of each link [K/W]; the sink is the second end of its links.
    resistance: tuple[tuple[Link, Parameter], ...]
    # Share [1] of the losses other than copper by node: a number, a parameter, or None for the one
    # node that takes the rest.
    share: tuple[tuple[str, float | Parameter | None], ...]
    copper: str  # Node that the copper loss heats.
    sink: str  # Name of the boundary.
    # Node that each measured temperature belongs to, by channel: the winding's and those of bodies.
    sensors: tuple[tuple[str, str], ...]
    starts: tuple[tuple[str, str], ...]  # Name of the start temperature of each node.
    effects: tuple[str, ...] = ()  # Ids of the effects that belong to it.
    # Name of the second boundary; empty where there is one sink. A network of two sinks names the
    # channels that they are measured by, `"ambient"` and `"coolant"`.
    second_sink: str = ""
    # Losses that follow the speed, apart from those that the shares divide.
    by_speed: tuple[SpeedLossForm, ...] = ()

    def compiled_as(self) -> tuple[Any, ...]:
        """Return what a compiled program holds of it: all but the numbers of the priors."""
        shares = tuple((n, s.name if isinstance(s, Parameter) else s) for n, s in self.share)
        named = [(place, p.name) for place, p in (*self.capacitance, *self.resistance)]
        rest = (self.copper, self.sinks, self.sensors, self.starts, self.effects)
        by_speed = [
            (loss.kind, tuple(p.name for p in loss.parameters), tuple(n for n, _ in loss.share))
            for loss in self.by_speed
        ]
        return (self.name, self.title, tuple(named), shares, tuple(by_speed), *rest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, NetworkForm) and self.compiled_as() == other.compiled_as()

    def __hash__(self) -> int:
        return hash(self.compiled_as())

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, in the order of the text."""
        return tuple(node for node, _ in self.capacitance)

    @property
    def sinks(self) -> tuple[str, ...]:
        """Names of the boundaries, the one that stands for T0 first."""
        return (self.sink, self.second_sink) if self.second_sink else (self.sink,)

    def with_main_sink(self, sink: str) -> NetworkForm:
        """Return the network with one of its two sinks as T0; a network of one stays as it is."""
        if not self.second_sink or sink == self.sink:
            return self
        return replace(self, sink=self.second_sink, second_sink=self.sink)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the network: capacitances, resistances, shares, losses by speed."""
        shares = [share for _, share in self.share if isinstance(share, Parameter)]
        return (
            *(parameter for _, parameter in self.capacitance),
            *(parameter for _, parameter in self.resistance),
            *shares,
            *(parameter for loss in self.by_speed for parameter in loss.parameters),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all its parameters, start temperatures included."""
        return (*(p.name for p in self.parameters), *(name for _, name in self.starts))

    def sensed(self, channel: str) -> str | None:
        """Return the node that a channel measures, None if it measures none."""
        return dict(self.sensors).get(channel)

    def with_sensors(self, said: Mapping[str, str]) -> NetworkForm:
        """Return the network with bodies at other nodes, or at none.

        Args:
            said: Node by channel, `"none"` for a body that is not fitted; nodes that the network
                lacks are left aside.
        """
        kept = [(channel, node) for channel, node in self.sensors if channel not in said]
        kept += [(channel, node) for channel, node in said.items() if node in self.nodes]
        return replace(self, sensors=tuple(kept))

    @property
    def measured_node(self) -> str:
        """Node that the winding's sensor sits in."""
        return dict(self.sensors)[WINDING]

    @property
    def body(self) -> tuple[str, str]:
        """Names of capacitance and resistance of the node that holds the slow heat.

        It is the node with the largest capacitance (by its prior) of those tied to a sink.
        """
        capacitance = dict(self.capacitance)
        tied = [(link[0], R) for link, R in self.resistance if link[1] in self.sinks]
        node, resistance = max(tied, key=lambda pair: capacitance[pair[0]].centre)
        return capacitance[node].name, resistance.name

    def build(self, values: Mapping[str, Float[Array, ""] | float]) -> Network:
        """Return the network for values by parameter name [their units]."""
        import jax.numpy as jnp

        from lptn import Network

        own = {node: jnp.asarray(0.0) for loss in self.by_speed for node, _ in loss.share}
        return Network(
            capacitance={node: jnp.asarray(values[p.name]) for node, p in self.capacitance},
            resistance={link: jnp.asarray(values[p.name]) for link, p in self.resistance},
            share=own | shares_of(self.share, values),
            copper_node=self.copper,
            boundary=self.sink,
            second_boundary=self.second_sink,
        )
