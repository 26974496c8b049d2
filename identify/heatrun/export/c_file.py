"""A run as C99 for a drive: the network, an observer of its nodes, vectors to verify a port."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from ..version import __version__
from . import laws
from .laws import in_comment, links_of
from .missed import Missed
from .network_course import with_bodies
from .vectors import VECTOR_S

HEADER, SOURCE, HARNESS, VECTORS = "thermal_network.h", "thermal_network.c", "main.c", "vectors.csv"
OBSERVER_VECTORS = "observer_vectors.csv"

STEP_S = 1.0

MOST_PARTS = 1000
"""More parts than this cost a drive too much."""

MOST_BYTES = 1024
"""The state of an observer stays below this."""

LATE_S = 60.0
"""Lag of a sensor that is looked for [s]; what others leave is much like it."""

LEAST_STUCK_K = 2.0
"""Sensors of a resolution of 1 K stand still as long as the machine changes by less [K]."""


@dataclass(frozen=True, eq=False)
class CSource:
    """A network as C."""

    of_run: Mapping[str, Any]  # The variables of `network.mat`, as `read_network` gives them.
    missed: Missed  # What the observer knows of noise and missed heat.
    said: Mapping[str, str]  # Words in the comment: run, sha256, machine, network, corrections.
    step: float  # Length of a step [s].
    parts: int  # Number of parts of a step.
    # Resistance of the circuit whose resistance tells the winding's temperature, without leads, at
    # the reference temperature, and of its leads [ohm]; the first is 0 where the machine has none.
    cold: tuple[float, float] = (0.0, 0.0)
    # The variables with the parameters one sd off in the direction that the run tells least of;
    # None where all are known.
    aside: Mapping[str, Any] | None = None

    @classmethod
    def of(
        cls, of_run: Mapping[str, Any], missed: Missed, said: Mapping[str, str],
        step: float = STEP_S, cold: tuple[float, float] = (0.0, 0.0),
    ) -> CSource:  # fmt: skip
        """Return the source of a network.

        Raises:
            InputError: If it lacks the law of an effect, or the step is not one for this network.
        """
        laws.refuse_lawless((each["id"] for each in np.atleast_1d(of_run["effects"])), said["run"])
        if any(each["id"] == "winding_node" for each in with_bodies(of_run)["effects"]):
            raise InputError(
                "the C source holds winding_node with the resistance of a machine alone, and here "
                "winding and body keep one temperature.",
                where=said["run"],
                remedy="Export the first order without it, or --to mat.",
            )
        if not 0.0 < step < math.inf:
            raise InputError(
                f"expected a step above 0 s, got {step:g} s.",
                where="--step",
                remedy="Pass the time between two calls of the drive [s].",
            )
        parts = laws.parts_of(step, with_bodies(of_run))
        if parts > MOST_PARTS:
            longest = step * MOST_PARTS / parts
            raise InputError(
                f"a step of {step:g} s is too long for this network: its fastest node needs "
                f"{parts} parts of it (limit {MOST_PARTS}).",
                where=said["run"],
                remedy=f"Pass --step {longest:.1g} or less.",
            )
        return cls(of_run, missed, said, step, parts, cold)

    @cached_property
    def found(self) -> Mapping[str, Any]:
        """The variables with the bodies that effects add among the nodes."""
        return with_bodies(self.of_run)

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes in the order of the arrays."""
        return [str(node) for node in np.atleast_1d(self.found["nodes"])]

    @property
    def inputs(self) -> list[str]:
        """Names in `network.mat` of what drives this network, in the order of the struct."""
        ids = {each["id"] for each in np.atleast_1d(self.found["effects"])}
        is_used = {"speed_rpm": bool(ids & laws.BY_SPEED), "fan": "fan_cooling" in ids,
                   "coolant_degC": "coolant_sink" in ids}  # fmt: skip
        return [name for name in laws.INPUTS if name in self.found and is_used.get(name, True)]

    @property
    def heated(self) -> list[int]:
        """Numbers of the nodes that losses heat."""
        share = np.atleast_1d(self.found["share"])
        copper = self.nodes.index(self.found["copper_node"])
        return [i for i in range(share.size) if share[i] or i == copper]

    @property
    def num_states(self) -> int:
        """Number of states of an observer."""
        return len(self.nodes) + len(self.heated) + 5 + self.is_apart

    @property
    def lag_s(self) -> float:
        """Time constant of the sensor [s], 0 for one that does not lag."""
        effects = np.atleast_1d(self.found["effects"])
        return sum(float(each["parameters"]["tau"]) for each in effects
                   if each["id"] == "sensor_lag")  # fmt: skip

    @property
    def reading(self) -> Float[np.ndarray, " node"]:
        """Part of each node's temperature in that of the sensor's place [1]."""
        parts = np.zeros(len(self.nodes))
        parts[self.nodes.index(self.found["sensor"]["node"])] = 1.0
        for effect in np.atleast_1d(self.found["effects"]):
            if effect["id"] in laws.OF_PLACE:
                moved = float(effect["parameters"][laws.OF_PLACE[effect["id"]]])
                parts[self.nodes.index(effect.get("added", effect.get("node")))] += moved
                parts[self.nodes.index("winding")] -= moved
        return parts

    @property
    def is_apart(self) -> bool:
        """Whether what the sensor shows is not the temperature of a node."""
        return self.lag_s > 0.0 or int(np.count_nonzero(self.reading)) > 1

    @property
    def not_by_resistance(self) -> list[str]:
        """Why readings by resistance are not for this observer, or at all, in a sentence each."""
        if not self.cold[0]:
            return ["heatrun_winding_degC is left out: the run has no resistance of the winding. "
                    "State phase_resistance_ohm in [winding]."]  # fmt: skip
        ids = [e["id"] for e in np.atleast_1d(self.found["effects"])
               if e["id"] in ("sensor_lag", *laws.OF_PLACE)]  # fmt: skip
        node = self.found["sensor"]["node"]
        where = [f"its sensor is at {node}"] if node != self.found["copper_node"] else []
        if not ids + where:
            return []
        return ["heatrun_winding_degC is the mean of the winding at once, and the observer expects "
                f"another reading ({', '.join(ids + where)}): do not pass it there."]  # fmt: skip

    @property
    def state_bytes(self) -> int:
        """Size of an observer in double [bytes]: `heatrun_observer` of the template."""
        nodes, heats, num = len(self.nodes), len(self.heated), self.num_states
        covariances = (num - 4) * (num + 5) // 2  # the four constants have none with each other
        return 8 * (2 * nodes + heats + self.is_apart + covariances + 25) + 4 * 8

    @property
    def has_observer(self) -> bool:
        """Whether an observer fits into 1 kB."""
        return self.state_bytes < MOST_BYTES

    @property
    def num_vectors(self) -> int:
        """Number of steps of the vectors."""
        time = self.found["t"]
        return int(min(time[-1] - time[0], VECTOR_S) / self.step + 1e-9)

    @property
    def losses_words(self) -> str:
        """What the losses are that drive this network."""
        is_balance = self.found["losses"] == "balance"
        return "all losses, copper included" if is_balance else "losses other than copper"

    def largest(self) -> dict[str, str]:
        """Return the limits of current, losses and speed as the header has them [A, W, rpm]."""
        found = self.found
        speed = found["speed_rpm"] if "speed_rpm" in self.inputs else 0.0
        losses = found["Pd" if found["losses"] == "balance" else "Pol"]
        return {
            "max_current": _limit(10.0, found["Is"], found["rated_current_A"]),
            "max_losses": _limit(10.0, losses, 1.0),
            "max_speed": _limit(2.0, speed, found["rated_speed_rpm"]),
        }

    def texts(self, said: Iterable[tuple[str, str, tuple[float, float]]] = ()) -> dict[str, bytes]:
        """Return header, source and harness by file name.

        Args:
            said: Name in the run, member and 95 % interval of the parameters, for a comment.
        """
        lines = [f" *     {member:30} {low:.6g} to {high:.6g}  {in_comment(name)}\n"
                 for name, member, (low, high) in said]  # fmt: skip
        intervals = "".join(["/* 95 % intervals of the run\n", *lines, " */\n\n"] if lines else [])
        filled = {**self._header(), **self._tables(), **self._observer(), "intervals": intervals}
        observer = {
            ending: filled_template(f"observer.{ending}", filled) if self.has_observer else ""
            for ending in "hc"
        }
        filled["observer_header"] = observer["h"]
        return {
            HEADER: filled_template("network.h", filled).encode("ascii"),
            SOURCE: (filled_template("network.c", filled) + observer["c"]).encode("ascii"),
            HARNESS: _template("main.c").encode("ascii"),
        }

    def _header(self) -> dict[str, str]:
        found, inputs = self.found, self.inputs
        names = _enumerators(self.nodes)
        return {name: in_comment(text) for name, text in self.said.items()} | {
            "version": __version__,
            "step": repr(float(self.step)),
            "num_nodes": str(len(self.nodes)),
            "num_links": str(len(links_of(found))),
            "has_second": str(int("Te2" in inputs)),
            "has_speed": str(int("speed_rpm" in inputs)),
            "has_fan": str(int("fan" in inputs)),
            "has_coolant": str(int("coolant_degC" in inputs)),
            "has_warmth": str(int(any(e["id"] in laws.BY_WARMTH for e in found["effects"]))),
            **self.largest(),
            "speed_limit": f"#define HEATRUN_MAX_SPEED_RPM {self.largest()['max_speed']}\n"
            if "speed_rpm" in inputs
            else "",  # an unused one is a finding of MISRA
            "node_enumerators": ",\n".join(
                f"    HEATRUN_NODE_{name} = {i} /* {in_comment(node)} */"
                for i, (name, node) in enumerate(zip(names, self.nodes, strict=True))
            ),
            "losses_words": self.losses_words,
            "has_resistance": str(int(self.cold[0] > 0.0)),
            "cold": _reals(np.array([self.cold[0], found["Tref"], found["B"], self.cold[1]])),
            "kelvin_per_ohm": f"{(found['Tref'] + found['B']) / (self.cold[0] or 1.0):.6g}",
            "not_by_resistance": "".join(
                f" *\n * {in_comment(line)}\n"
                for line in textwrap.wrap(" ".join(self.not_by_resistance), 94)
            ),
            "sink": in_comment(found["sink"]),
            "second_sink": in_comment(found.get("second_sink", "none")),
        }

    def parameters(self) -> dict[str, np.ndarray]:
        """Return the members of `heatrun_parameters` [their units]: shape (node,), (link,), ()."""
        found, nodes, links = self.found, self.nodes, links_of(self.found)
        sizes = ((laws.OF_NETWORK, ()), (laws.OF_LINK, len(links)), (laws.OF_NODE, len(nodes)))
        numbers = {
            member: np.zeros(size) for table, size in sizes for members in table.values()
            for member in members.values()
        }  # fmt: skip
        for effect in np.atleast_1d(found["effects"]):
            place: tuple[int, ...] = ()
            if effect["id"] in laws.OF_LINK:
                place = (links.index(tuple(effect["link"])),)
            elif effect["id"] in laws.OF_NODE:
                node = effect.get("added", effect.get("node", found["copper_node"]))
                place = (nodes.index(node),)
            for table, _ in sizes:
                for name, member in table.get(effect["id"], {}).items():
                    numbers[member][place] += effect["parameters"][name]
        of_network = {
            "capacitance_J_per_K": np.atleast_1d(found["capacitance"]),
            "resistance_K_per_W": np.atleast_1d(found["resistance"]),
            "share": np.atleast_1d(found["share"]),
            "Rs0_ohm": found["Rs0"],
        }
        return {name: np.asarray(value, float) for name, value in {**of_network, **numbers}.items()}

    def _tables(self) -> dict[str, str]:
        found = self.found
        links = links_of(found)
        ends = [*self.nodes, found["sink"], found.get("second_sink", "")]
        is_balance = found["losses"] == "balance"
        return {
            "other_words": "losses - Pjs" if is_balance else "as given",
            "parts": str(self.parts),
            "copper": str(self.nodes.index(found["copper_node"])),
            "is_balance": str(int(is_balance)),
            "first": ", ".join(str(ends.index(a)) for a, _ in links),
            "second": ", ".join(str(ends.index(b)) for _, b in links),
            "coefficient": repr(float(found["B"])),
            "reference": repr(float(found["Tref"])),
            "copper_per_ohm": repr(float(found["phases"] / (found["B"] + found["Tref"]))),
            "rated_speed": repr(float(found["rated_speed_rpm"])),
            "rated_current": repr(float(found["rated_current_A"])),
            "identified": self._parameters_text(),
        }

    def _parameters_text(self) -> str:
        return filled_template("parameters.c", {
            name: repr(float(values)) if values.ndim == 0 else _reals(values)
            for name, values in self.parameters().items()
        })  # fmt: skip

    def _observer(self) -> dict[str, str]:
        found = self.found
        losses = float(np.mean(found["Pd" if found["losses"] == "balance" else "Pol"]))
        if found["losses"] == "map":
            losses += found["phases"] * found["Rs0"] * float(np.mean(found["Is"] ** 2))
        losses = max(abs(losses), 1e-3)
        sensed = self.nodes.index(found["sensor"]["node"])
        keep = math.exp(-self.step / self.lag_s) if self.lag_s else 0.0
        lightest = min(np.atleast_1d(found["capacitance"])[self.heated])
        missed, white = self.missed, self.missed.reading(self.step)
        rate = laws.rates(found)[sensed]
        W_per_K = rate * np.atleast_1d(found["capacitance"])[sensed]
        heat_W, heat_s = missed.heat_W(losses, float(W_per_K), float(1.0 / rate))
        return {
            "num_heats": str(len(self.heated)),
            "heated": ", ".join(map(str, self.heated)),
            "sensed": str(sensed),
            "reading_sd": f"{white:.6g}",
            "slow_sd": f"{missed.slow_K:.6g}",
            "slow_decay": repr(math.exp(-self.step / missed.slow_s)),
            "has_lag": str(int(self.is_apart)),
            "reading": _reals(self.reading),
            "lag_decay": repr(keep),
            "lag_mean": repr(self.lag_s / self.step * (1.0 - keep)),
            "sensor_sd": f"{missed.sensor_K:.6g}",
            "stuck": f"{LEAST_STUCK_K + 4.0 * math.hypot(white, missed.slow_K):.4g}",
            "heat_sd": repr(heat_W),
            "sink_sd": repr(missed.sink_K),
            "share_sd": repr(missed.share),
            "losses_sd": repr(missed.losses),
            "heat_error_sd": repr(both := math.hypot(missed.share, missed.losses)),
            "losses_part": repr((missed.losses / max(both, 1e-30)) ** 2),
            "aside": replace(self, of_run=self.aside or self.of_run)._parameters_text(),
            "answer_sd": repr(missed.answer),
            "misfit_sd": repr(missed.misfit_K),
            "late_decay": repr(math.exp(-self.step / LATE_S)),
            "answer_decay": repr(math.exp(-self.step * rate)),
            "heat_decay": repr(math.exp(-self.step / heat_s)),
            "errors": repr(float(W_per_K) * math.hypot(missed.sensor_K, missed.sink_K)),
            "blind": repr(float(self.step * losses / lightest)),
        }


def _enumerators(nodes: Sequence[str]) -> list[str]:
    """Return names of nodes in the letters of C, each once."""
    names: list[str] = []
    for node in nodes:
        plain = re.sub(r"[^A-Z0-9_]", "_", node.upper())
        names.append(f"{plain}_{len(names)}" if plain in names else plain)
    return names


def _limit(factor: float, values: Any, rated: float) -> str:
    largest = max(float(np.max(np.abs(values))), abs(float(rated)))
    return f"{factor * largest:.3g}" if factor * largest < 1e3 else repr(round(factor * largest, 0))


def _reals(values: np.ndarray) -> str:
    return ", ".join(f"R({float(value)!r})" for value in values)


@cache
def _template(name: str) -> str:
    return (files("heatrun.export") / "templates" / name).read_text(encoding="ascii")


def filled_template(name: str, values: Mapping[str, str]) -> str:
    """Return a template of this package with its places filled."""
    return Template(_template(name)).substitute(values)
