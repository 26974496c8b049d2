"""The variables of `network.mat`: any network with any effects of the catalogue, as data.

Text stands in char arrays and cells, an effect in a struct with its parameters, so that one fixed
script integrates them all.
"""

import math
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import jax.numpy as jnp
import numpy as np

from lptn.effects import AbstractEffect

from ..errors import InputError
from ..model.model import Model
from ..record.motor import Motor
from ..record.record import Record
from .variables import Corrections, Shaft, bridged

SCRIPT = "run_network.m"

RPM = math.pi / 30.0
"""[rad/s] per [rpm]."""

UNITS: Mapping[str, str] = {
    "B": "degC",
    "Is": "A",
    "Pd": "W",
    "Pol": "W",
    "Rs0": "ohm",
    "Te": "degC",
    "Te2": "degC",
    "Tref": "degC",
    "Tw_m": "degC",
    "capacitance": "J/K",
    "coolant_degC": "degC",
    "copper_node": "text",
    "effects": "struct",
    "fan": "1",
    "links": "text",
    "losses": "text",
    "nodes": "text",
    "phases": "1",
    "rated_current_A": "A",
    "rated_speed_rpm": "rpm",
    "resistance": "K/W",
    "second_sink": "text",
    "sensor": "struct",
    "share": "1",
    "sink": "text",
    "speed_rpm": "rpm",
    "start": "degC",
    "t": "s",
}
"""Every variable that the file may have, with its unit or what it is instead of a number."""

SIGNALS = ("t", "Is", "Pd", "Pol", "Te", "Te2", "Tw_m", "speed_rpm", "coolant_degC", "fan")

NEEDS = {"speed": "speed_rpm", "speed_rad": "speed_rpm", "coolant": "coolant_degC", "fan": "fan"}
"""Signal behind what an effect's card says it needs."""


@cache
def known_laws() -> frozenset[str]:
    """Return the ids of the effects whose laws the script holds."""
    text = (files("heatrun.export") / "templates" / SCRIPT).read_text()
    cases = re.findall(r"^ *case (.*(?:\.\.\.\n.*)*)$", text, flags=re.MULTILINE)
    return frozenset(re.findall(r"'(\w+)'", " ".join(cases)))


def refuse_unknown(ids: tuple[str, ...], where: str) -> None:
    """Refuse effects whose laws the script does not hold.

    Args:
        ids: Ids of the effects of a model.
        where: The run, for the message.

    Raises:
        InputError: With their names.
    """
    unknown = [name for name in ids if name not in known_laws()]
    if unknown:
        raise InputError(
            f"{SCRIPT} holds the laws of heatrun's own catalogue, and not that of "
            f"{', '.join(unknown)}, which comes from a file after --effects or another package.",
            where=where,
            remedy="Export a run without it, or use `heatrun simulate`.",
        )


def network_variables(
    record: Record,
    values: Mapping[str, float],
    motor: Motor,
    model: Model,
    *,
    rated_speed: float,
    rated_current: float,
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the variables of `network.mat` and sentences on what is in them.

    Args:
        record: The test, which `heatrun.record.reduction.reduce` accepts; its own samples are used.
        values: Parameters by name, those of the effects as `"speed_cooling.g"`, start
            temperatures and the errors of the sensor among them.
        motor: The sink.
        model: The network with effects, and what the losses mean.
        rated_speed: Speed that the laws are scaled with [rad/s].
        rated_current: Rms current that they are scaled with [A].

    Returns:
        Float64 columns of shape (time, 1), (node, 1) and (link, 1), scalars of shape (1, 1),
        text, cells of text, and dictionaries that become structs; sorted by name. NaN stands in
        `Tw_m` where nothing was read, and nowhere else.

    Raises:
        InputError: If the script lacks the law of an effect, the record a channel that an effect
            needs, or a capacitance or resistance is not above 0.
    """
    refuse_unknown(tuple(kind.card.id for kind in model.effects), record.name)
    notes: list[str] = []
    sink = f"{motor.sink}_degC"
    loss = "Pd" if model.kind == "balance" else "Pol"
    signals = {
        "t": record.time_s,
        "Is": bridged(record, "phase_current_A", notes, power=2),
        loss: bridged(record, "losses_W", notes),
        "Te": bridged(record, sink, notes),
        "Tw_m": record["winding_degC"],
        **_further(record, notes),
    }
    second = model.form.second_sink
    if second:
        signals["Te2"] = _second_sink(record, f"{second}_degC", notes)
        notes.append(f"Te2 holds {second}_degC, the second sink of this network.")
    _refuse_missing(model, signals, record.name)
    unread = int(np.sum(~np.isfinite(record["winding_degC"])))
    if unread:
        notes.append(f"Tw_m is NaN at {unread} samples without a reading.")
    if motor.sink != "ambient":
        notes.append(f"Te holds {sink}, the sink of this motor.")
    if "Rs0" not in values:
        notes.append("Rs0 is 0: the phase resistance does not enter this model.")
    arrays = {name: jnp.asarray(value) for name, value in values.items()}
    network = model.network(arrays)
    starts = model.start(arrays)
    nodes, links = model.form.nodes, network.links
    capacitance = [float(network.capacitance[node]) for node in nodes]
    resistance = [float(network.resistance[link]) for link in links]
    _refuse_negative(model, values, record.name)
    arrays.pop("load_timing", None)  # shifts the reading, and is no effect of the machine
    effects = [_effect(effect) for effect in model.built_effects(arrays)]
    variables: dict[str, Any] = {
        "B": _scalar(model.coefficient),
        "Rs0": _scalar(values.get("Rs0", 0.0)),
        "Tref": _scalar(model.reference_temperature),
        "capacitance": _column(capacitance),
        "copper_node": network.copper_node,
        "effects": _cell([[effect] for effect in effects], 1),
        "links": _cell(links, 2),
        "losses": model.kind,
        "nodes": _cell([[node] for node in nodes], 1),
        "phases": _scalar(model.phases),
        "rated_current_A": _scalar(rated_current),
        "rated_speed_rpm": _scalar(rated_speed / RPM),
        "resistance": _column(resistance),
        "sensor": {
            "node": model.form.measured_node,
            "gain": _scalar(values.get("sensor_gain", 0.0)),
            "offset": _scalar(values.get("sensor_offset", 0.0)),
        },
        "share": _column([float(network.share.get(node, 0.0)) for node in nodes]),
        "sink": network.boundary,
        **({"second_sink": second} if second else {}),
        "start": _column([float(starts[node]) for node in nodes]),
    } | {name: _column(signal) for name, signal in signals.items()}
    return {name: variables[name] for name in UNITS if name in variables}, tuple(notes)


def corrected_network(
    variables: Mapping[str, Any], corrections: Corrections, shaft: Shaft
) -> dict[str, Any]:
    """Return the variables with current, losses, sink and timing as the run has them.

    As `Corrections.applied`; whatever else drives an effect comes later with the load.
    """
    loss = "Pd" if "Pd" in variables else "Pol"
    thesis = {"t": variables["t"], "Is": variables["Is"], "Te": variables["Te"]}
    changed = corrections.applied({**thesis, "Pd": variables[loss]}, shaft)
    changed[loss] = changed.pop("Pd")
    if "Te2" in variables:
        changed["Te2"] = variables["Te2"] + corrections.second_sink_offset
    further = {
        name: corrections.later(variables["t"], {**variables, **changed}[name])
        for name in ("speed_rpm", "coolant_degC", "fan", "Te2")
        if name in variables and corrections.load_timing
    }
    return {**variables, **changed, **further}


def _second_sink(record: Record, channel: str, notes: list[str]) -> np.ndarray:
    if channel not in record or not np.any(np.isfinite(record[channel])):
        raise InputError(
            f"the network loses heat to a second sink, and this test has no {channel}.",
            where=record.name,
            remedy="Map the channel in [columns], or export another test of the run.",
        )
    return bridged(record, channel, notes)


def _further(record: Record, notes: list[str]) -> dict[str, np.ndarray]:
    """Return speed, coolant and fan where they were recorded, as the reduction takes them."""
    found: dict[str, np.ndarray] = {}
    for channel in ("speed_rpm", "coolant_degC"):
        if channel in record and np.any(np.isfinite(record[channel])):
            found[channel] = bridged(record, channel, notes)
    for channel in ("fan", "coolant_flow_L_per_min"):
        if "fan" not in found and channel in record and np.nanmax(np.abs(record[channel])) > 0:
            is_fan = channel == "fan"
            largest = 1.0 if is_fan else float(np.nanmax(record[channel]))
            found["fan"] = bridged(record, channel, notes) / largest
            if not is_fan:
                notes.append(f"fan is {channel} over its largest value, {largest:.4g}.")
    return found


def _refuse_missing(model: Model, signals: Mapping[str, np.ndarray], test: str) -> None:
    for kind in model.effects:
        lacking = [NEEDS[need] for need in kind.card.needs if NEEDS[need] not in signals]
        if lacking:
            raise InputError(
                f"the effect {kind.card.id} needs {lacking[0]}, which this test does not have.",
                where=test,
                remedy="Map the channel in [columns], or export another test of the run.",
            )


def _refuse_negative(model: Model, values: Mapping[str, float], test: str) -> None:
    bad = [
        f"{parameter.name} = {values[parameter.name]:g} {parameter.unit}"
        for parameter in model.form.parameters
        if parameter.unit in ("J/K", "K/W") and not 0.0 < values[parameter.name] < math.inf
    ]
    if bad:
        raise InputError(
            f"expected capacitances and resistances above 0, got {', '.join(bad)}.",
            where=test,
            remedy="Calibrate again.",
        )


def _effect(effect: AbstractEffect) -> dict[str, Any]:
    """Return an effect as a struct: id, law, parameters with units, and its place."""
    card = effect.card
    struct: dict[str, Any] = {
        "id": card.id,
        "law": card.law,
        "parameters": {name: _scalar(float(getattr(effect, name))) for name in card.parameters},
        "units": {name: quantity.unit for name, quantity in card.parameters.items()},
    }
    node, link = getattr(effect, "node", None), getattr(effect, "link", None)
    if node is not None:
        struct["node"] = node
    if link is not None:
        struct["link"] = _cell([link], 2)
    return struct


def _cell(rows: Any, num_columns: int) -> np.ndarray:
    cell = np.empty((len(rows), num_columns), dtype=object)
    for i, row in enumerate(rows):
        for j, content in enumerate(row):
            cell[i, j] = content
    return cell


def _column(values: Any) -> np.ndarray:
    return np.asarray(values, float)[:, None]


def _scalar(value: float) -> np.ndarray:
    return np.full((1, 1), float(value))
