"""A run's model as the one or two bodies that drives, relays and simulators compute.

They know the current alone: the copper loss is all that heats such a body, and the other losses of
the tested loads hide in its resistance. How far it is from the model is stated. The DC motor of
MuJoCo is one of them.

Reference: MuJoCo XML reference, actuator/dcmotor, attribute `thermal`; MuJoCo DC Motor Model
    (mujoco.readthedocs.io, dcmotor.pdf). Tried with MuJoCo 4.0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ..errors import InputError, UsageError
from ..io.whole_files import numbered
from ..model.catalogue import refuse_unmeasured_current
from ..model.model import Model
from ..model.network_text import network_named
from ..posterior.predict import Prediction
from ..results.model import DerivedFigure
from ..runs.machine import Tested, tested
from ..runs.replica import Followed, Nearest, nearest
from ..runs.run import Run, open_run
from .c_file import filled_template
from .laws import in_comment
from .mat import write_export
from .rerun import read_test_of_run

COLD = 10.0
"""An error towards cold counts so many times one towards warm where a motor is protected [1]."""

EXACT = dict.fromkeys(("power_gain", "ambient_offset", "sensor_gain", "sensor_offset"), 0.0)
"""Instruments without an error: those of the drive are its own."""

CONSTANT = 1e9
"""B with which a resistance does not change with temperature [degC]."""

START_S = 1800.0
"""Time constant from which the search starts [s]."""


@dataclass(frozen=True)
class Simpler:
    """A network of one or two bodies that the copper loss heats."""

    found: Nearest  # Its parameters.
    draws: dict[str, np.ndarray]  # The parameters by name, shape (draw,) [J/K, K/W].
    ohm: float  # Phase resistance behind the heat [ohm].
    degC: float  # Temperature that it holds for [degC].
    # Its course minus that of the model, all tests in a row [K], shape (block,).
    errors_K: np.ndarray
    colder_95_K: float  # How much colder it is at most than the model's upper 95 % limit [K].

    def bias(self) -> dict[str, Any]:
        """Return how far it is from the model at the tested loads, as plain data [K]."""
        return {
            "rms_K": float(np.sqrt(np.mean(self.errors_K**2))),
            "colder_at_most_K": max(0.0, -float(self.errors_K.min())),
            "warmer_at_most_K": max(0.0, float(self.errors_K.max())),
            "colder_than_upper_95_at_most_K": self.colder_95_K,
        }


@dataclass(frozen=True, eq=False)
class TestedRun:
    """A run with what its model says of its tests."""

    run: Run  # The run.
    name: str  # Name of the network.
    predictions: tuple[Prediction, ...]  # Of all its tests, those first that it was calibrated on.

    __test__ = False  # no class of tests

    @classmethod
    def read(cls, path: Path, network: str | None = None) -> TestedRun:
        """Read the tests of a run again.

        Args:
            path: The run folder.
            network: Name of the network; None for the last one of the run.

        Raises:
            InputError: If the folder is no run, lacks the network, a file of a test is missing or
                has changed, or no current heats the winding.
        """
        run = open_run(path)
        name = run.choose(network)
        records = [read_test_of_run(run, test) for test in run.tests]
        found = [run.predict(record, network=name) for record in records]
        whole = cls(run, name, tuple(sorted(found, key=lambda each: each.is_held_out)))
        refuse_unmeasured_current([each.test for each in found], "bodies of a drive")
        if not whole.fitted or not whole.ohm or not whole.seen.amperes:
            raise InputError(
                "no copper loss follows from this run: it lacks a phase resistance, or current in "
                "a test that it was calibrated on.",
                where=str(path),
                remedy="Write [winding] phase_resistance_ohm into the motor file and calibrate "
                "again on tests with current.",
            )
        return whole

    @property
    def fitted(self) -> list[Prediction]:
        """The tests that the run was calibrated on."""
        return [each for each in self.predictions if not each.is_held_out]

    @property
    def ohm(self) -> float:
        """Phase resistance at the motor's reference temperature [ohm]; 0 where it is unknown."""
        motor = self.run.motor
        return self.predictions[0].middle.get("Rs0", motor.phase_resistance_ohm or 0.0)

    @cached_property
    def seen(self) -> Tested:
        """The range of the tests that the run was calibrated on."""
        return tested([each.test for each in self.fitted])

    @property
    def continuous(self) -> DerivedFigure:
        """The continuous current that the run certifies, within the permitted rise where that is
        known, else within the class temperature; or why it does not.
        """
        derived = self.run.result.models[self.name].derived
        by_rise = derived.get("continuous_current_by_rise_A")
        if by_rise is not None and math.isfinite(by_rise.median):
            return by_rise
        return derived.get("continuous_current_A", DerivedFigure(refused="the run does not say"))

    def ohm_at(self, degC: float) -> float:
        """Return the phase resistance at a temperature [ohm]."""
        motor = self.run.motor
        B = motor.resistance_coefficient_degC
        return self.ohm * (B + degC) / (B + motor.reference_temperature_degC)

    def simpler(self, network: str, *, is_fed: bool, cold: float) -> Simpler:
        """Return the network that comes nearest to the model at the loads of all tests.

        It follows the model, not the readings: a held-out test is one load more.

        Args:
            network: `"first"` or `"second"`.
            is_fed: Whether the resistance rises with the temperature; else it stays at that of the
                loaded winding.
            cold: As `heatrun.runs.replica.nearest`.
        """
        motor, seen = self.run.motor, self.seen
        degC = motor.reference_temperature_degC if is_fed else seen.loaded_winding_degC
        ohm = self.ohm_at(degC)
        model = Model(
            form=network_named(network).with_main_sink(motor.sink),
            kind="map",
            phases=motor.phases,
            reference_temperature=degC,
            coefficient=motor.resistance_coefficient_degC if is_fed else CONSTANT,
        )
        R = (seen.loaded_winding_degC - seen.sink_degC) / (motor.phases * ohm * seen.amperes**2)
        R = max(R, 1e-6)
        start = {"Ceq": START_S / R, "Req": R}
        if network == "second":
            start = {"Ceq_w": 0.1 * START_S / R, "Ceq_sr": START_S / R,
                     "Req_w": 0.4 * R, "Req_sr": 0.6 * R}  # fmt: skip
        follow = [self._followed(model, each, ohm) for each in self.predictions]
        found = nearest(model, start, follow, cold=cold)
        errors = np.concatenate([f.error_K(model, found.parameters) for f in follow])
        node = self.predictions[0].model.form.measured_node
        above = np.concatenate([p.nodes_95[node][1] - p.nodes[node] for p in self.predictions])
        apart = np.concatenate([p.draws - p.median for p in self.predictions], axis=1)
        colder = max(0.0, float(np.max(above - errors)))
        return Simpler(found, found.moved(apart), ohm, degC, errors, colder)

    def write(
        self, places: Iterable[Path], files: Mapping[str, bytes], *, is_replacing: bool
    ) -> dict[str, Any]:
        """Write files of this run as `write_export`; return what is said of them as plain data."""
        inputs = tuple(Path(entry["path"]) for entry in self.run.manifest["inputs"])
        written = write_export(places, files, inputs, is_replacing=is_replacing)
        return {
            "files": [str(path) for path in written],
            "run": str(self.run.path),
            "order": self.name,
            "title": self.predictions[0].model.title,
            "findings": [],
        }

    def _followed(self, model: Model, each: Prediction, ohm: float) -> Followed:
        """Return a test that only its current heats."""
        test = each.test
        idle = replace(test, means={**test.means, "losses": np.zeros_like(test.means["losses"])})
        form = each.model.form
        of_node = dict(form.starts)
        winding = each.middle[of_node[form.measured_node]]
        starts = {name: each.middle.get(of_node.get(node, ""), winding)
                  for node, name in model.form.starts}  # fmt: skip
        return Followed(idle, each.nodes[form.measured_node], {**EXACT, **starts, "Rs0": ohm})


def figures(simpler: Simpler) -> Iterator[tuple[str, float, tuple[float, float], str]]:
    """Yield name, value, 95 % interval and unit of what describes a network of one or two bodies.

    The time constants of the bodies are their capacities times their resistances; those of the
    network are its eigenvalues.
    """
    unit = {"C": "J/K", "R": "K/W", "t": "s", "s": "1"}
    middle = _derived({name: np.array(v) for name, v in simpler.found.parameters.items()})
    for name, draws in _derived(simpler.draws).items():
        low, high = np.quantile(draws, [0.025, 0.975]).tolist()
        yield name, float(middle[name]), (low, high), unit[name[0]]


def _derived(q: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the neutral figures by name from those of the network, shapes as they are."""
    if "Req" in q:
        return {"R": q["Req"], "C": q["Ceq"], "tau": q["Req"] * q["Ceq"]}
    rates = 1.0 / (q["Req_w"] * q["Ceq_w"]), 1.0 / (q["Req_w"] * q["Ceq_sr"])
    out = 1.0 / (q["Req_sr"] * q["Ceq_sr"])
    half = 0.5 * (sum(rates) + out)
    root = np.sqrt(half**2 - rates[0] * out)
    return {
        "R_winding": q["Req_w"],
        "R_housing": q["Req_sr"],
        "C_winding": q["Ceq_w"],
        "C_housing": q["Ceq_sr"],
        "tau_winding": 1.0 / rates[0],
        "tau_housing": 1.0 / out,
        "tau_fast": 1.0 / (half + root),
        "tau_slow": 1.0 / (half - root),
        "share_winding": q["Req_w"] / (q["Req_w"] + q["Req_sr"]),
    }


FILE = "motor.xml"


def export_mujoco(
    run: Path,
    *,
    folder: Path | None = None,
    network: str | None = None,
    motor_constant: float | None = None,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Write a model of MuJoCo with the motor as its actuator.

    Args:
        run: The run folder.
        folder: Where the file goes; None for a folder `mujoco` in the run, numbered where that
            holds another export.
        network: Name of the network; None for the last one of the run.
        motor_constant: Torque per rms ampere [N m/A]; None for 1, which is said.
        is_replacing: Whether another export in `folder` is replaced.

    Returns:
        As plain data: the files, network (`order`, `title`), attributes of the actuator, its
        distance from the model (`bias`), notes and findings.

    Raises:
        InputError: As `TestedRun.read` and `write_export`.
        UsageError: If the motor constant is not above 0.
    """
    if motor_constant is not None and not 0.0 < motor_constant < math.inf:
        raise UsageError(f"expected --motor-constant above 0 N m/A, got {motor_constant:g}")
    read = TestedRun.read(run, network)
    body = read.simpler("first", is_fed=True, cold=1.0)
    motor, bias = read.run.motor, body.bias()
    (_, R, R_95, _), (_, C, C_95, _), _ = figures(body)
    alpha = 1.0 / (motor.resistance_coefficient_degC + motor.reference_temperature_degC)
    thermal = [R, C, 0.0, alpha, body.degC, read.seen.sink_degC]
    attributes = {
        "motorconst": motor_constant or 1.0,
        "resistance": motor.phases * body.ohm,
        "thermal": thermal,
    }
    notes = []
    if motor_constant is None:
        notes.append("motorconst is 1 N m/A, a placeholder: no thermal test tells it. Pass "
                     "--motor-constant.")  # fmt: skip
    text = filled_template("motor.xml", {
        "model": quoteattr(in_comment(motor.name)),
        "source": quoteattr(f"run {in_comment(read.run.path.resolve().name)}, SHA-256 of fit.json "
                            f"{read.run.manifest['files']['fit.json']}"),
        "phases": str(motor.phases),
        "R_low": f"{R_95[0]:.4g}", "R_high": f"{R_95[1]:.4g}",
        "C_low": f"{C_95[0]:.4g}", "C_high": f"{C_95[1]:.4g}",
        "rms": f"{bias['rms_K']:.1f}",
        "colder": f"{bias['colder_at_most_K']:.1f}",
        "warmer": f"{bias['warmer_at_most_K']:.1f}",
        "placeholder": "" if motor_constant else ", here a placeholder: no thermal test tells it",
        "motor_constant": repr(float(attributes["motorconst"])),
        "ohm": repr(float(attributes["resistance"])),
        "thermal": " ".join(f"{value:.9g}" for value in thermal),
    })  # fmt: skip
    places = [folder] if folder else numbered(run / "mujoco")
    written = read.write(places, {FILE: text.encode("ascii")}, is_replacing=is_replacing)
    return {**written, "attributes": attributes, "bias": bias, "notes": notes}
