"""The laws that the C holds: where the parameters of effects stand, and how fast it may become."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from lptn import EFFECTS, SpeedLoss
from lptn.effects.heat_paths import STEFAN_BOLTZMANN

from ..errors import InputError

MOVED = {"iron_loss_in_winding": "k", "rotor_node": "P"}
"""Effects that move heat out of the other losses, and the parameter that says how much [W]."""

OF_NETWORK = {
    "winding_resistance": {"g": "resistance_gain"},
    "copper_coefficient": {"dB": "coefficient_more_degC"},
    "standby_loss": {"P0": "standby_W"},
    "loss_gain": {"g": "loss_gain"},
    "ambient_recirculation": {"r": "recirculation_K_per_W"},
    "coolant_sink": {"a": "coolant_share"},
    "ac_copper_loss": {"k": "ac_copper"},
    "stray_load_loss": {"k": "stray_W"},
    "external_loss": {"k": "outside_share", "m": "outside_exponent"},
}
OF_LINK = {
    "speed_cooling": {"g": "speed_gain", "m": "speed_exponent"},
    "fan_cooling": {"g": "fan_gain"},
    "natural_convection": {"f": "natural_share", "n": "natural_exponent"},
    "insulation_conductivity": {"b": "warmth_gain_per_K"},
}
OF_NODE = {
    "speed_loss": {"linear": "speed_loss_W", "square": "speed_squared_loss_W"},
    "bearing_friction": {"T_f": "friction_Nm", "kappa": "friction_fall_per_K"},
    "radiation": {"eA": "radiating_m2"},
    **{id: {P: "moved_W", "n": "moved_exponent", "m": "moved_by_load"} for id, P in MOVED.items()},
    "end_winding_node": {"f": "copper_moved"},
}
"""Member of `heatrun_parameters` for each parameter of the effects: one number, or one for each
link or node, where it stands at that of the effect."""

OF_PLACE = {"end_winding_node": "p", "sensor_contact": "k"}
"""Effects by which the sensor sits between the winding and another node, and the share of that."""

OF_READING = ("sensor_lag", "sensor_contact", "sensor_gain", "sensor_pickup")
"""What they do to the reading is in the observer; gain and pickup are of the bench's sensor."""

LAWS = (*OF_LINK, *OF_NODE, *OF_NETWORK, "neighbour_body", "housing_node", "winding_node",
        *OF_READING)  # fmt: skip
"""Effects whose laws the source holds."""

BY_SPEED = {"speed_cooling", "ac_copper_loss", *MOVED, "stray_load_loss", "speed_loss",
            "external_loss", "bearing_friction"}  # fmt: skip
"""Those that take the speed."""

BY_WARMTH = {"radiation", "natural_convection", "insulation_conductivity"}
"""Those by which a network is not linear in its temperatures."""

HOT_K = 200.0
"""How far a node may be above 60 °C, or above the sink, for which a step is short enough [K]."""

UNLIKE_C = re.compile(r"[^A-Za-z0-9 .,:;()+=@_-]")
"""What text in a comment is escaped of: it can neither end the comment nor be a trigraph."""

INPUTS = {"Is": "current_A", "Pd": "losses_W", "Pol": "losses_W", "Te": "sink_degC",
          "Te2": "second_sink_degC", "coolant_degC": "coolant_degC", "speed_rpm": "speed_rpm",
          "fan": "fan"}  # fmt: skip
"""Member of the struct of inputs by the name in `network.mat`, in the order of the struct."""

UNITS = {"N m": "N.m", "m^2": "m2", "degC": "K"}
"""As other programs write them; what is a temperature here is a difference."""


def _of_cards() -> Iterator[tuple[str, tuple[str, str, str]]]:
    cards = {kind.card.id: kind.card for kind in (*EFFECTS, SpeedLoss)}
    for table, place in ((OF_NETWORK, ""), (OF_LINK, ""), (OF_NODE, ".{0}")):
        for id, members in table.items():
            for name, member in members.items():
                said = cards[id].parameters[name]
                unit = UNITS.get(said.unit, said.unit)
                yield member, (f"{id}{place}.{name}", unit, said.meaning)


MEMBERS = {
    **dict(_of_cards()),
    "moved_W": ("moved_loss.{0}.P", "W", "loss that heats {0} at the rated speed and current"),
    "moved_exponent": ("moved_loss.{0}.n", "1", "exponent of the speed in it"),
    "moved_by_load": ("moved_loss.{0}.m", "1", "how far it goes with the squared current"),
    "copper_moved": ("end_winding.f", "1", "share of the copper loss that heats {0}"),
    "share": ("share.{0}", "1", "share of the losses other than copper in {0}"),
}
"""Name, unit and meaning of each member beside C, R and Rs0; {0} is a node. They are those of the
effect's card, but of what effects have in common."""

SHARE_OF_FASTEST = 0.02
"""Parts of a step stay below this share of 1 over the fastest rate (Gershgorin): Runge-Kutta of the
fourth order then errs by 0.02^4/120, some 1e-9 of a change."""


def in_comment(text: str) -> str:
    """Return text that stands safely in a comment of C: other characters by their number."""
    return UNLIKE_C.sub(lambda found: f"<U+{ord(found[0]):04X}>", text)


def lacking_laws(ids: Iterable[str]) -> list[str]:
    """Return the effects whose laws the source does not hold."""
    return sorted({name for name in ids if name not in LAWS})


def refuse_lawless(ids: Iterable[str], where: str) -> None:
    """Refuse effects whose laws the source does not hold.

    Raises:
        InputError: With their names.
    """
    if lacking := lacking_laws(ids):
        raise InputError(
            f"the C source does not hold the law of {', '.join(lacking)}: events, drifts and "
            "delays of a test are not the drive's, nor are laws beyond the catalogue.",
            where=where,
            remedy="Pass --replica for the nearest network without it, or export --to mat.",
        )


def parts_of(step: float, found: Mapping[str, Any]) -> int:
    """Return into how many parts a step [s] of a network is divided."""
    return max(1, math.ceil(step * _fastest(found) / SHARE_OF_FASTEST))


def _fastest(found: Mapping[str, Any]) -> float:
    """Return a bound of the fastest rate of the network at its limits [1/s]."""
    nodes = [str(node) for node in np.atleast_1d(found["nodes"])]
    conductance = 1.0 / np.atleast_1d(found["resistance"])
    links, radiating = links_of(found), np.zeros(len(nodes))
    for effect in np.atleast_1d(found["effects"]):
        id, q = effect["id"], effect["parameters"]
        if id == "radiation":
            radiating[nodes.index(effect["node"])] += (
                4.0 * STEFAN_BOLTZMANN * q["eA"] * (60 + HOT_K + 273) ** 3
            )
        elif id in OF_LINK:
            gain = (
                1.0 + HOT_K * abs(q["b"]) if id == "insulation_conductivity"
                else 1.0 + q["f"] * ((HOT_K / 40.0) ** q["n"] - 1.0) if id == "natural_convection"
                else 1.0 + 2.0 * q["g"]  # at twice its rated speed
            )  # fmt: skip
            conductance[links.index(tuple(effect["link"]))] *= gain
    from_node = 2.0 * _by_node(conductance, links, nodes) + radiating
    return float(np.max(from_node / found["capacitance"]))


def rates(found: Mapping[str, Any]) -> np.ndarray:
    """Return how fast each node goes to what surrounds it [1/s], shape (node,)."""
    nodes = [str(node) for node in np.atleast_1d(found["nodes"])]
    conductance = 1.0 / np.atleast_1d(found["resistance"])
    return _by_node(conductance, links_of(found), nodes) / np.atleast_1d(found["capacitance"])


def _by_node(
    conductance: np.ndarray, links: Sequence[tuple[str, ...]], nodes: Sequence[str]
) -> np.ndarray:
    return np.array([
        sum(g for g, link in zip(conductance, links, strict=True) if node in link)
        for node in nodes
    ])  # fmt: skip


def links_of(found: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return both ends of each link, in the order of the resistances."""
    return [tuple(map(str, link)) for link in np.reshape(found["links"], (-1, 2))]
