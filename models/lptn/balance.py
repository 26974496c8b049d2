"""The heat balance of a network under its losses and effects, at one instant or at many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from jaxtyping import Array, Float

from .effects.base import HeatEffect, Terms
from .inputs import Drive
from .losses import CopperLosses
from .network import Network

Temperatures = Mapping[str, Float[Array, "..."]]


def loss_split(
    losses: CopperLosses, winding: Float[Array, "..."], drive: Drive
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return the copper loss P_js and the other losses P_ol [W].

    Args:
        losses: Resistance, and what the loss channel means.
        winding: Temperature of the copper node [degC].
        drive: Inputs, scalars or arrays like `winding`.
    """
    copper = losses.slope(drive.current_squared) * (losses.coefficient + winding)
    channel = (1.0 + losses.power_gain) * drive.losses
    if drive.speed_rad is not None:
        channel = channel - losses.torque_offset * drive.speed_rad
    if drive.shaft_power is not None:
        missing = losses.shaft_power_gain * drive.shaft_power + losses.shaft_power_offset
        channel = channel - missing
    return copper, channel - copper if losses.kind == "balance" else channel


def heat_balance(
    network: Network,
    losses: CopperLosses,
    effects: Sequence[HeatEffect],
    temperature: Temperatures,
    drive: Drive,
) -> Terms:
    """Return sources [W], conductances [W/K] and sink [degC] at the given temperatures.

    Everything broadcasts: scalars inside a scan, arrays over time after it.
    """
    copper, other = loss_split(losses, temperature[network.copper_node], drive)
    zero = 0.0 * copper
    heat = {
        node: network.share[node] * other if node in network.share else zero
        for node in network.nodes
    }
    heat[network.copper_node] = heat[network.copper_node] + copper
    terms = Terms(
        heat=heat,
        conductance={link: 1.0 / network.resistance[link] for link in network.links},
        sink=drive.ambient + losses.ambient_offset,
        second_sink=None
        if drive.second_sink is None
        else drive.second_sink + losses.second_sink_offset,
        network=network,
        losses=losses,
        copper=copper,
        other=other,
    )
    for effect in effects:
        terms = effect.apply(terms, temperature, drive)
    return terms


def rates(
    network: Network, terms: Terms, temperature: Temperatures
) -> dict[str, Float[Array, "..."]]:
    """Return dT/dt of each node [K/s]."""
    net = dict(terms.heat)
    for link in network.links:
        first, second = link
        flow = terms.flow(link, temperature)
        net[first] = net[first] - flow
        if second not in network.boundaries:
            net[second] = net[second] + flow
    return {node: net[node] / network.capacitance[node] for node in network.nodes}
