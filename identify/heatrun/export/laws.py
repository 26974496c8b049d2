"""The laws that the C holds: where the parameters of effects stand, how fast it may become, and how
other programs see its parameters: names, units, 95 % intervals.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lptn import EFFECTS, SpeedLoss
from lptn.effects.heat_paths import STEFAN_BOLTZMANN

from ..errors import InputError
from ..model.model import Model

if TYPE_CHECKING:
    from .c_file import CSource

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


@dataclass(frozen=True)
class Entry:
    """One number among the parameters of the C."""

    name: str  # In letters, digits and points, each once.
    member: str  # Of `heatrun_parameters`.
    index: int | None  # Its place there; None for a member that is one number.
    unit: str  # Its unit, `"1"` for none.
    meaning: str  # What it is.
    value: float  # What the run states [unit].
    # Its 95 % interval [unit]; None where the run has none for it.
    interval_95: tuple[float, float] | None

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which it may be set: half and twice, and all of the interval [unit]."""
        values = (self.value, *(self.interval_95 or ()))
        about = (0.5 * self.value, 2.0 * self.value)
        low, high = min(*about, *values), max(*about, *values)
        is_share = self.member.endswith("share")
        return low, min(high, 0.5 * (1.0 + max(values))) if is_share else high

    @property
    def words(self) -> str:
        """Meaning with value and interval."""
        if self.interval_95 is None:
            return self.meaning
        low, high = self.interval_95
        return f"{self.meaning}; 95 % interval {low:.4g} to {high:.4g}"


def entries(source: CSource, model: Model, ends: Iterable[CSource] = ()) -> list[Entry]:
    """Return the parameters that a run has found, in the order of the C.

    Args:
        source: The network as C.
        model: That it was made of.
        ends: The same at the ends of the intervals; empty where there are none.
    """
    tables = [each.parameters() for each in (source, *ends)]
    kept = []
    for member, values in tables[0].items():
        for place in np.ndindex(values.shape):
            value, *limits = (float(table[member][place]) for table in tables)
            is_there = any((value, *limits)) if member != "share" else len({value, *limits}) > 1
            if is_there:
                index = place[0] if place else None
                interval = (min(limits), max(limits)) if limits else None
                name, unit, meaning = _said(source, model, member, index)
                kept.append(Entry(name, member, index, unit, meaning, value, interval))
    names = unique((each.name for each in kept), ["time"])
    return [replace(each, name=name) for each, name in zip(kept, names, strict=True)]


def _said(source: CSource, model: Model, member: str, index: int | None) -> tuple[str, str, str]:
    """Return name, unit and meaning."""
    form, nodes, links = model.form, source.nodes, links_of(source.found)
    if member == "capacitance_J_per_K":
        node = nodes[index or 0]
        parameter = dict(form.capacitance).get(node)
        if parameter is None:  # a body that an effect adds
            return f"C_{node}", "J/K", f"heat capacity of {node}"
        return parameter.name, parameter.unit, parameter.meaning
    if member == "resistance_K_per_W":
        a, b = links[index or 0]
        parameter = dict(form.resistance).get((a, b))
        if parameter is None:
            return f"R_{a}_{b}", "K/W", f"resistance from {a} to {b}"
        return parameter.name, parameter.unit, parameter.meaning
    if member == "Rs0_ohm":
        return "Rs0", "Ohm", f"phase resistance at {float(source.found['Tref']):g} degC"
    name, unit, meaning = MEMBERS[member]
    node = nodes[index] if "{0}" in name and index is not None else ""
    return name.format(node), unit, meaning.format(node)


def unique(names: Iterable[str], taken: Iterable[str] = (), point: str = ".") -> Iterator[str]:
    """Give names in letters and digits that any program reads, each once.

    Args:
        names: Any names; points part them.
        taken: Names that are there already.
        point: What parts them afterwards.
    """
    used = set(taken)
    for name in names:
        parts = name.split(".")
        plain = point.join(re.sub(r"\W|^(?=\d)|^$", "_", each, flags=re.ASCII) for each in parts)
        while plain in used:
            plain += "_"
        used.add(plain)
        yield plain
