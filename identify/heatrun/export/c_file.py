"""A run as C99 for a drive: the network, an observer of its nodes, vectors to verify a port."""

from __future__ import annotations

import io
import itertools
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

from lptn.effects.heat_paths import STEFAN_BOLTZMANN

from ..errors import InputError
from ..version import __version__
from .missed import Missed
from .network_course import simulate_held, with_bodies, without_errors_of_bench
from .network_file import SIGNALS

HEADER, SOURCE, HARNESS, VECTORS = "thermal_network.h", "thermal_network.c", "main.c", "vectors.csv"
OBSERVER_VECTORS = "observer_vectors.csv"

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

STEP_S = 1.0

SHARE_OF_FASTEST = 0.02
"""Parts of a step stay below this share of 1 over the fastest rate (Gershgorin): Runge-Kutta of the
fourth order then errs by 0.02^4/120, some 1e-9 of a change."""

MOST_PARTS = 1000
"""More parts than this cost a drive too much."""

MOST_BYTES = 1024
"""The state of an observer stays below this."""

VECTOR_S = 7200.0
"""Length of the vectors at most [s]."""

OBSERVED_STEPS, ASKED_EVERY = 1800, 60
"""Steps of each course of the observer's vectors at most, and between two questions for time to the
limit and permitted current, which cost many steps."""

COURSES = ("a sound sensor", "lost for a third of the course", "sticks for a third of the course",
           "a start that is 30 K wrong")  # fmt: skip
"""What the observer's vectors go through."""

MOST_PLAYED = 50_000
"""Steps of a test that the observer is played on, at most: fourteen hours at 1 Hz."""

ASKS_NOTHING = (-1.0, 0.0, 0.0)
"""Node, limit and horizon of a step without a question."""

START_SD_K = 5.0
"""How well the temperatures at the start of a course are known [K]."""

LATE_S = 60.0
"""Lag of a sensor that is looked for [s]; what others leave is much like it."""

LEAST_STUCK_K = 2.0
"""Sensors of a resolution of 1 K stand still as long as the machine changes by less [K]."""

UNLIKE_C = re.compile(r"[^A-Za-z0-9 .,:;()+=@_-]")
"""What text in a comment is escaped of: it can neither end the comment nor be a trigraph."""

INPUTS = {"Is": "current_A", "Pd": "losses_W", "Pol": "losses_W", "Te": "sink_degC",
          "Te2": "second_sink_degC", "coolant_degC": "coolant_degC", "speed_rpm": "speed_rpm",
          "fan": "fan"}  # fmt: skip
"""Member of the struct of inputs by the name in `network.mat`, in the order of the struct."""


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
        refuse_lawless((each["id"] for each in np.atleast_1d(of_run["effects"])), said["run"])
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
        parts = parts_of(step, with_bodies(of_run))
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
        laws = {each["id"] for each in np.atleast_1d(self.found["effects"])}
        is_used = {"speed_rpm": bool(laws & BY_SPEED), "fan": "fan_cooling" in laws,
                   "coolant_degC": "coolant_sink" in laws}  # fmt: skip
        return [name for name in INPUTS if name in self.found and is_used.get(name, True)]

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
            if effect["id"] in OF_PLACE:
                moved = float(effect["parameters"][OF_PLACE[effect["id"]]])
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
        laws = [e["id"] for e in np.atleast_1d(self.found["effects"])
                if e["id"] in ("sensor_lag", *OF_PLACE)]  # fmt: skip
        node = self.found["sensor"]["node"]
        where = [f"its sensor is at {node}"] if node != self.found["copper_node"] else []
        if not laws + where:
            return []
        return ["heatrun_winding_degC is the mean of the winding at once, and the observer expects "
                f"another reading ({', '.join(laws + where)}): do not pass it there."]  # fmt: skip

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

    def vectors(self, test: str) -> bytes:
        """Return inputs and what `lptn` makes of them, as CSV.

        The first row holds the start; every other one the inputs held over a step, those of the
        record at its middle, and the temperatures at its end.

        Args:
            test: Name of the test, for the comment.

        Raises:
            InputError: If the test is shorter than a step.
        """
        if self.num_vectors < 1:
            raise InputError(
                f"the test is shorter than a step of {self.step:g} s.",
                where=test,
                remedy="Pass a shorter --step, or another --test.",
            )
        held, course = self._driven
        columns = [self.step * np.arange(len(held) + 1)]
        columns += [*np.vstack([np.zeros(held.shape[1]), held]).T, *course.T]
        heading = [*self._driving(), *(f"{node}_degC" for node in self.nodes)]
        text = io.StringIO()
        text.write(f"# heatrun export: inputs and lptn's temperatures, test {in_comment(test)}\n")
        np.savetxt(text, np.column_stack(columns), "%.17g", ",", header=",".join(heading),
                   comments="")  # fmt: skip
        return text.getvalue().encode("ascii")

    def observer_courses(self, test: str) -> bytes:
        """Return inputs and readings of `COURSES`, as CSV: the harness writes the outputs.

        The machine is as the model has it, the readings those of its sensor with the white noise
        of the run, to 0.01 K.

        Args:
            test: Name of the test, for the comment; it is no shorter than a step.
        """
        held, course = (each[: OBSERVED_STEPS + k] for k, each in enumerate(self._driven))
        num = len(held)
        rng = np.random.default_rng(1)
        noise = rng.normal(0.0, self.missed.reading(self.step), (len(COURSES), num))
        copper = self.nodes.index(self.found["copper_node"])
        question = [copper, np.round(course[:, copper].max(), 1), 600.0 * self.step]
        asked = np.where(
            (np.arange(1, num + 1) % ASKED_EVERY == 0)[:, None], question, ASKS_NOTHING
        )
        text = io.StringIO()
        text.write(f"# heatrun export: inputs, readings and the observer's outputs by this C in "
                   f"double, test {in_comment(test)}\n{self._observed_heading}\n")  # fmt: skip
        for k, (what, each) in enumerate(zip(COURSES, noise, strict=True)):
            reading = np.round(self._shown(course) + each, 2)
            late = slice(num // 3, 2 * num // 3)
            if k == 1:
                reading[late] = np.nan
            elif k == 2:
                reading[late] = reading[late][:1]
            wrong_K, sd_K = (-30.0, 30.0) if k == 3 else (0.0, START_SD_K)
            text.write(f"# {what}\n")
            self._write_observed(text, held, reading, course[0] + wrong_K, sd_K, asked)
        return text.getvalue().encode("ascii")

    def readings(self) -> bytes:
        """Return inputs and readings of the test, `MOST_PLAYED` steps at most, as
        `observer_courses`: where no sample falls into a step there is none. They come without
        errors of the bench's sensor, such as its pickup.
        """
        time = self.found["t"] - self.found["t"][0]
        num = min(int(time[-1] / self.step + 1e-9), MOST_PLAYED)
        latest = np.searchsorted(time, self.step * np.arange(num + 1) + 1e-9, side="right") - 1
        is_new = np.diff(latest) > 0
        reading = np.where(is_new, without_errors_of_bench(self.found)[latest[1:]], np.nan)
        held, start = self._in_order(self._by_name(num)), np.atleast_1d(self.found["start"])
        asked = np.tile(ASKS_NOTHING, (num, 1))
        text = io.StringIO()
        text.write(f"{self._observed_heading}\n")
        self._write_observed(text, held, reading, start, START_SD_K, asked)
        return text.getvalue().encode("ascii")

    @property
    def _observed_heading(self) -> str:
        outputs = [f"{node}_{what}" for node in self.nodes for what in ("degC", "sd_K")]
        asked = ("reading_degC", "node", "limit_degC", "horizon_s")
        told = (*outputs, "status", "sensor", "time_to_limit_s", "permitted_A")
        return ",".join([*self._driving(), *asked, *told])

    def _write_observed(
        self, text: io.StringIO, held: np.ndarray, reading: np.ndarray, start: np.ndarray,
        sd_K: float, asked: np.ndarray,
    ) -> None:  # fmt: skip
        """Write the start, and inputs, readings and questions of each step; outputs are NaN."""
        unknown = np.full((len(held), 2 * len(self.nodes) + 4), np.nan)
        time_s = self.step * np.arange(1, len(held) + 1)
        rows = np.column_stack([time_s, held, reading, asked, unknown])
        both = [each for T in start for each in (T, sd_K)]
        first = [*np.zeros(1 + held.shape[1]), np.nan, *ASKS_NOTHING, *both, 0, 0, -1, -1]
        np.savetxt(text, np.vstack([first, rows]), "%.12g", ",")

    def _shown(self, course: Float[np.ndarray, "time node"]) -> Float[np.ndarray, " step"]:
        """Return what the sensor shows at the end of each step [degC]."""
        at_place = course @ self.reading
        if not self.lag_s:
            return at_place[1:]
        keep = math.exp(-self.step / self.lag_s)
        mean, shown = self.lag_s / self.step * (1.0 - keep), [at_place[0]]
        for before, after in itertools.pairwise(at_place):
            shown.append(keep * shown[-1] + (1.0 - mean) * after + (mean - keep) * before)
        return np.array(shown[1:])

    def _driving(self) -> list[str]:
        """Return the names of time and inputs."""
        return ["time_s", *(INPUTS[name] for name in self.inputs)]

    @cached_property
    def _driven(self) -> tuple[np.ndarray, np.ndarray]:
        """Inputs held over the steps (step, input) and temperatures (step + 1, node)."""
        held = self._by_name(self.num_vectors)
        course = simulate_held(self.of_run, held, self.step)
        return self._in_order(held), np.column_stack([course[node] for node in self.nodes])

    def _in_order(self, held: Mapping[str, np.ndarray]) -> Float[np.ndarray, "step input"]:
        return np.column_stack([held[name] for name in self.inputs])

    def _by_name(self, num: int) -> dict[str, np.ndarray]:
        """Return what drives the machine in the middle of each step, by its name."""
        time = self.found["t"] - self.found["t"][0]
        middle = self.step * (np.arange(num) + 0.5)
        driving = [name for name in SIGNALS if name in self.found and name not in ("t", "Tw_m")]
        held = {name: np.interp(middle, time, self.found[name]) for name in driving}
        held["Is"] = np.sqrt(np.interp(middle, time, self.found["Is"] ** 2))
        return held

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
            "has_warmth": str(int(any(e["id"] in BY_WARMTH for e in found["effects"]))),
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
        sizes = ((OF_NETWORK, ()), (OF_LINK, len(links)), (OF_NODE, len(nodes)))
        numbers = {
            member: np.zeros(size) for table, size in sizes for members in table.values()
            for member in members.values()
        }  # fmt: skip
        for effect in np.atleast_1d(found["effects"]):
            place: tuple[int, ...] = ()
            if effect["id"] in OF_LINK:
                place = (links.index(tuple(effect["link"])),)
            elif effect["id"] in OF_NODE:
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
        rate = _rates(found)[sensed]
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


def in_comment(text: str) -> str:
    """Return text that stands safely in a comment of C: other characters by their number."""
    return UNLIKE_C.sub(lambda found: f"<U+{ord(found[0]):04X}>", text)


def _enumerators(nodes: Sequence[str]) -> list[str]:
    """Return names of nodes in the letters of C, each once."""
    names: list[str] = []
    for node in nodes:
        plain = re.sub(r"[^A-Z0-9_]", "_", node.upper())
        names.append(f"{plain}_{len(names)}" if plain in names else plain)
    return names


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


def _rates(found: Mapping[str, Any]) -> np.ndarray:
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
