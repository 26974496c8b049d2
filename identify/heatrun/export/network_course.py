"""What `lptn` makes of `prova.mat` and of `network.mat`: the courses that other programs must meet.

Between the samples of a file it takes short steps.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy.io

from lptn import EFFECTS, CopperLosses, Inputs, Network, Sensor, SpeedLoss, longest_step, simulate
from lptn.effects import AbstractEffect, HeatEffect, NodeEffect
from lptn.effects.bodies import WindingNode
from lptn.effects.sensors import SensorGain, SensorLag, SensorPickup, TimeShift

from .network_file import RPM, SIGNALS
from .variables import Corrections

SHARE_OF_NETWORK = 0.005
"""Steps stay below this share of the longest that the method takes, a fraction of a hundredth of
the fastest time constant: means over a step then stand for straight lines, and for the laws of
effects that bend between two samples."""

SENSOR_STEP_S = 0.02
LINES_PER_SAMPLE = 40
"""A sensor that lags or is late reads along straight lines between the edges of the steps. So
many to a sampling interval, and none shorter than `SENSOR_STEP_S`, keep the bend of the
temperature at a hard step of load below 1e-3 K."""


@dataclass(frozen=True)
class Grid:
    """Steps that split each interval between two samples evenly."""

    time: np.ndarray  # Time of the samples [s], shape (sample,).
    step: np.ndarray  # Length of the steps [s], shape (step,).
    first: np.ndarray  # Number of the edge at which each sample lies, shape (sample,).
    middle: np.ndarray  # Middle of the steps [s], shape (step,).

    @classmethod
    def of(cls, time: np.ndarray, longest: float) -> Grid:
        """Return the grid of a record.

        Args:
            time: Time of the samples [s], shape (sample,).
            longest: No step is longer than this [s].
        """
        interval = np.diff(time)
        parts = np.ceil(interval / longest).astype(int)
        step = np.repeat(interval / parts, parts)
        first = np.concatenate([[0], np.cumsum(parts)])
        inside = np.arange(step.size) - np.repeat(first[:-1], parts)
        middle = np.repeat(time[:-1], parts) + (inside + 0.5) * step
        return cls(time, step, first, middle)

    def mean(self, values: np.ndarray) -> jnp.ndarray:
        """Return the mean over each step of straight lines from sample to sample, (step,)."""
        return jnp.asarray(np.interp(self.middle, self.time, values.ravel()))


@dataclass(frozen=True)
class Held:
    """Steps over which the inputs are held, each split evenly."""

    step: np.ndarray  # Length of the parts [s], shape (part,).
    parts: int  # Number of parts of a step.

    def mean(self, values: np.ndarray) -> jnp.ndarray:
        """Return values of the steps, shape (step,), at the parts, shape (part,)."""
        return jnp.asarray(np.repeat(values, self.parts))


@dataclass(frozen=True)
class NetworkCourse:
    """Temperatures at the samples of a record."""

    time: np.ndarray  # Time of the samples [s], shape (time,).
    # Temperature by node, those of effects included [degC], shape (time,).
    temperature: Mapping[str, np.ndarray]
    sensed: np.ndarray  # Temperature of the node that the sensor sits in [degC], shape (time,).
    reading: np.ndarray  # What the sensor reads [degC], shape (time,).
    # Readings of the record [degC], shape (time,); NaN where nothing was read.
    measured: np.ndarray

    def rmse(self, values: np.ndarray) -> float | None:
        """Return the RMSE of a course [degC] to the readings [K], None without any."""
        error = (values - self.measured)[np.isfinite(self.measured)]
        return float(np.sqrt(np.mean(error**2))) if error.size else None


def simulate_variables(
    variables: Mapping[str, np.ndarray], corrections: Corrections | None = None
) -> NetworkCourse:
    """Simulate the variables of `prova.mat` at the samples of the record, as `simulate_network`.

    Args:
        variables: As `thesis_variables`; without `Ceqsr` it is the first order.
        corrections: Errors of the sensor, for which the file has no variables; None for none.

    Valid for: `Pd` the measured total of the losses.
    """
    p = {name: float(value[0, 0]) for name, value in variables.items() if value.size == 1}
    sensor, is_second = corrections or Corrections(), "Ceqsr" in p
    nodes = ["winding", "stator"] if is_second else ["winding"]
    return _simulated({
        "nodes": nodes,
        "links": list(itertools.pairwise([*nodes, "ambient"])),
        "capacitance": [p[name] for name in ("Ceqw", "Ceqsr") if name in p],
        "resistance": [p[name] for name in ("Reqw", "Reqsr") if name in p],
        "share": [0.0, 1.0] if is_second else [1.0],
        "start": [p[name] for name in ("Two", "Tso") if name in p],
        "copper_node": "winding",
        "sink": "ambient",
        "sensor": {"node": "winding", "gain": sensor.sensor_gain, "offset": sensor.sensor_offset},
        "effects": [],
        "losses": "balance",
        # the copper loss only enters the second order; its file always has Rrif, of all phases
        "Rs0": p.get("Rrif", 0.0),
        "phases": 1,
        "Tref": p["Trif"],
        "B": p["B"],
        "rated_speed_rpm": 1.0,
        "rated_current_A": 1.0,
        **{name: variables[name].ravel() for name in ("t", "Is", "Pd", "Te", "Tw_m")},
    })  # fmt: skip


def simulate_network(content: bytes) -> NetworkCourse:
    """Simulate the variables of `network.mat` at the samples of the record.

    The squared current and all other inputs run straight from sample to sample; an interval that
    is long for the network or the sensor is split.

    Args:
        content: The bytes of the file.
    """
    return _simulated(read_network(content))


def _simulated(found: Mapping[str, Any]) -> NetworkCourse:
    network, start = _network(found)
    effects = [_effect(each) for each in np.atleast_1d(found["effects"])]
    time = np.atleast_1d(found["t"]) - found["t"][0]
    grid = Grid.of(time, _longest(network, effects, time))
    sensor = Sensor(
        node=found["sensor"]["node"], gain=found["sensor"]["gain"], offset=found["sensor"]["offset"]
    )
    trace = simulate(network, _losses(found), _inputs(found, grid), start, effects=effects,
                     sensor=sensor)  # fmt: skip
    at_samples = {node: np.asarray(T)[grid.first] for node, T in trace.temperature.items()}
    return NetworkCourse(
        time=found["t"],
        temperature=at_samples,
        sensed=at_samples[sensor.node],
        reading=np.asarray(trace.reading)[grid.first],
        measured=found["Tw_m"],
    )


def read_network(content: bytes) -> dict[str, Any]:
    """Return the variables of `network.mat`: arrays of shape (n,), numbers, text, dictionaries.

    Args:
        content: The bytes of the file.
    """
    return scipy.io.loadmat(io.BytesIO(content), simplify_cells=True)


def simulate_held(
    found: Mapping[str, Any], held: Mapping[str, np.ndarray], step: float
) -> dict[str, np.ndarray]:
    """Simulate equal steps over each of which the inputs are held.

    Args:
        found: From `read_network`.
        held: By the names of `network.mat` what drives the machine, shape (step,).
        step: Length of the steps [s].

    Returns:
        Temperature by node at the edges of the steps [degC], shape (step + 1,).
    """
    network, start = _network(found)
    effects = [_effect(each) for each in np.atleast_1d(found["effects"])]
    longest = SHARE_OF_NETWORK * float(longest_step(network, effects))
    parts = int(np.ceil(step / longest))
    grid = Held(np.full(parts * held["Is"].size, step / parts), parts)
    fixed = {name: value for name, value in found.items() if name not in SIGNALS}
    inputs = _inputs({**fixed, **held}, grid)
    trace = simulate(network, _losses(found), inputs, start, effects=effects)
    return {node: np.asarray(T)[::parts] for node, T in trace.temperature.items()}


def without_errors_of_bench(found: Mapping[str, Any]) -> np.ndarray:
    """Return the readings of the record without what the bench's sensor adds, which that of a drive
    does not [degC], shape (time,).

    Args:
        found: From `read_network`.
    """
    time, measured = np.atleast_1d(found["t"]) - found["t"][0], np.atleast_1d(found["Tw_m"])
    effects = map(_effect, np.atleast_1d(found["effects"]))
    errors = [each for each in effects if isinstance(each, SensorGain | SensorPickup)]
    if not errors:
        return measured
    sample = float(np.median(np.diff(time)))
    grid = Grid.of(time, max(sample / LINES_PER_SAMPLE, SENSOR_STEP_S))
    inputs, seen = _inputs(found, grid), jnp.zeros(grid.step.size + 1).at[grid.first].set(measured)
    for effect in errors:
        seen = effect.observe(seen, {}, inputs)
    return 2.0 * measured - np.asarray(seen)[grid.first]


def _network(found: Mapping[str, Any]) -> tuple[Network, dict[str, float]]:
    nodes = [str(node) for node in np.atleast_1d(found["nodes"])]
    links = [(str(a), str(b)) for a, b in np.reshape(found["links"], (-1, 2))]
    by_node = {name: np.atleast_1d(found[name]) for name in ("capacitance", "share", "start")}
    resistance = np.atleast_1d(found["resistance"])
    network = Network(
        capacitance={n: jnp.asarray(C) for n, C in zip(nodes, by_node["capacitance"], strict=True)},
        resistance={link: jnp.asarray(R) for link, R in zip(links, resistance, strict=True)},
        share={n: jnp.asarray(s) for n, s in zip(nodes, by_node["share"], strict=True) if s},
        copper_node=found["copper_node"],
        boundary=found["sink"],
        second_boundary=found.get("second_sink", ""),
    )
    return network, dict(zip(nodes, map(float, by_node["start"]), strict=True))


def with_bodies(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the variables of a network with the bodies that effects add among its nodes.

    An effect that does nothing else is not among the effects any more, nor is a `winding_node`
    whose resistance is that of a machine; one that also moves heat names the node that it has
    `added`.

    Args:
        found: As `simulate_network`.
    """
    network, start = _network(found)
    nodes = list(start)
    links = [(str(a), str(b)) for a, b in np.reshape(found["links"], (-1, 2))]
    state = {node: jnp.asarray(T) for node, T in start.items()}
    effects = []
    for said in np.atleast_1d(found["effects"]):
        effect = _effect(said)
        if isinstance(effect, NodeEffect):
            network, state = effect.extend(network), effect.start(state)
            (added,) = (node for node in network.nodes if node not in nodes)
            nodes.append(added)
            kept = [link for link in links if link in network.links]
            links = [*kept, *(link for link in network.links if link not in kept)]
            if not isinstance(effect, HeatEffect):
                continue
            if isinstance(effect, WindingNode) and not effect.holds_back(network):
                continue
            said = {**said, "added": added}
        effects.append(said)
    return {
        **found,
        "nodes": nodes,
        "links": links,
        "capacitance": np.array([float(network.capacitance[node]) for node in nodes]),
        "resistance": np.array([float(network.resistance[link]) for link in links]),
        "share": np.array([float(network.share.get(node, 0.0)) for node in nodes]),
        "start": np.array([float(state[node]) for node in nodes]),
        "effects": effects,
    }


def _losses(found: Mapping[str, Any]) -> CopperLosses:
    return CopperLosses(
        Rs0=jnp.asarray(found["Rs0"]),
        reference_temperature=found["Tref"],
        coefficient=found["B"],
        phases=int(found["phases"]),
        kind=found["losses"],
    )


def _effect(said: Mapping[str, Any]) -> AbstractEffect:
    kind = {kind.card.id: kind for kind in (*EFFECTS, SpeedLoss)}[said["id"]]
    places: dict[str, Any] = {}
    if "node" in said:
        places["node"] = said["node"]
    if "link" in said:
        a, b = said["link"]
        places["link"] = (str(a), str(b))
    return kind(**{n: jnp.asarray(v) for n, v in said["parameters"].items()}, **places)


def _inputs(found: Mapping[str, Any], grid: Grid | Held) -> Inputs:
    def mean(name: str, factor: float = 1.0) -> jnp.ndarray | None:
        return grid.mean(factor * found[name]) if name in found else None

    return Inputs(
        step=jnp.asarray(grid.step),
        current_squared=grid.mean(found["Is"] ** 2),
        losses=grid.mean(found["Pd"] if found["losses"] == "balance" else found["Pol"]),
        ambient=grid.mean(found["Te"]),
        speed=mean("speed_rpm", RPM),
        coolant=mean("coolant_degC"),
        fan=mean("fan"),
        second_sink=mean("Te2"),
        rated_speed=found["rated_speed_rpm"] * RPM,
        rated_current=found["rated_current_A"],
    )


def _longest(network: Network, effects: Sequence[AbstractEffect], time: np.ndarray) -> float:
    longest = SHARE_OF_NETWORK * float(longest_step(network, effects))
    if any(isinstance(effect, SensorLag | SensorPickup | TimeShift) for effect in effects):
        sample = float(np.median(np.diff(time)))
        return min(longest, max(sample / LINES_PER_SAMPLE, SENSOR_STEP_S))
    return longest
