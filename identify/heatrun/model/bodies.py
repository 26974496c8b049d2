"""Measured bodies beside the winding, and errors of the bench's instruments as parameters.

The errors are type B uncertainties with their priors. Each body stands for a node of the network.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from ..record.balance_errors import SHAFT_GAIN_SD, SHAFT_OFFSET_SHARE, Told
from ..record.blocks import Blocks
from ..record.channels import BODIES, body_name
from ..record.motor import Motor
from ..record.samples import SLOW_LOGGER_S
from .network_form import NetworkForm
from .parameters import Parameter, Transform

INSTRUMENTS = (
    Parameter("power_gain", "1", "relative error of the losses", "instrument", "linear", 0.0, 0.01,
              "losses as input minus output with instruments of class 0.1 at 90 % efficiency: 1 %"),
    Parameter("sensor_gain", "1", "relative error of the measured rise", "instrument", "linear",
              0.0, 0.005, "class 2 thermocouple (IEC 60584-1: 0.75 % at the limit, k = 1.7)"),
    Parameter("sensor_offset", "K", "offset of the winding sensor", "instrument", "linear", 0.0,
              0.5, "thermocouple and cold junction, agreement at rest within 1 K"),
    Parameter("ambient_offset", "K", "offset of the sink temperature", "instrument", "linear", 0.0,
              0.5, "one point of the room or duct stands for the whole sink"),
)  # fmt: skip
"""Type B uncertainties: temperatures alone cannot tell them, so they enter C and R."""

BY_RESISTANCE = "winding by resistance: meter, reference resistance, leads"


def instruments(tests: Sequence[Blocks]) -> list[Parameter]:
    """Return `INSTRUMENTS`, with the errors of a winding temperature by resistance where it is."""
    known = [test.sensor_sd for test in tests if test.sensor_sd is not None]
    if not known:
        return list(INSTRUMENTS)
    offset, gain = (max(each) for each in zip(*known, strict=True))
    sd = {"sensor_gain": gain, "sensor_offset": offset}
    return [
        replace(each, sd=sd[each.name], basis=BY_RESISTANCE) if each.name in sd else each
        for each in INSTRUMENTS
    ]


CURRENT_GAIN = Parameter(
    "current_gain", "1", "relative error of the current", "instrument", "linear", 0.0, 0.005,
    "current transducers of class 0.5",
)  # fmt: skip
"""Likewise, where the copper loss enters: it goes with its square."""

BODY_ERRORS: tuple[tuple[str, str, str, Transform, float, float, str], ...] = (
    ("gain", "1", "relative error of the rise", "linear", 0.0, 0.02,
     "one point stands for the mean of a body: 2 % of the rise"),
    ("offset", "K", "offset", "linear", 0.0, 0.5,
     "thermocouple and cold junction, agreement at rest within 1 K"),
    ("lag", "s", "time constant", "log", 10.0, 1.0,
     "a sensor glued or bolted on: some seconds to a minute"),
)  # fmt: skip
"""Errors of the sensor of a body: name, unit, meaning, prior and what it rests on."""

BODY_PARTS = tuple(part for part, *_ in BODY_ERRORS)


def body_errors(tests: Sequence[Blocks]) -> list[Parameter]:
    """Return the errors of the sensors of measured bodies."""
    channels = [channel for channel in BODIES if any(channel in test.fitted for test in tests)]
    return [
        Parameter(f"{body_name(channel)}_{part}", unit, f"{meaning} of the {body_name(channel)} "
                  "sensor", "instrument", transform, centre, sd, basis)
        for channel in channels
        for part, unit, meaning, transform, centre, sd, basis in BODY_ERRORS
    ]  # fmt: skip


def second_sink_error(sink: str) -> Parameter:
    """Return the error of the temperature of a second sink."""
    return Parameter(
        "second_sink_offset", "K", f"offset of the {sink} temperature", "instrument", "linear", 0.0,
        0.5, "one point of the room or duct stands for the whole sink",
    )  # fmt: skip


def shaft_errors(motor: Motor, tests: Sequence[Blocks]) -> list[Parameter]:
    """Return the errors of the mechanical power, where a balance was made with it.

    They are no share of the losses: where the machine turns from motor to generator, they change
    their sign. A wrong zero of the torque does nothing at standstill; it stands for an offset of
    the power where all tests tell the speed.

    Raises:
        InputError: If the motor file asks for an error that the tests do not have.
    """
    powers = [test.means["shaft_power"] for test in tests if "shaft_power" in test.means]
    largest_W = max((float(np.max(np.abs(power))) for power in powers), default=0.0)
    speeds = [test.means["speed"] for test in tests if "speed" in test.means]
    fastest = max((float(np.max(np.abs(speed))) for speed in speeds), default=0.0)
    is_told = len(speeds) == len(tests) and fastest > 0.0
    is_balance, asked = motor.losses == "balance", "torque_offset" in motor.parameters
    if asked and not (is_balance and len(speeds) == len(tests)):
        raise InputError(
            "[parameters.torque_offset] needs losses from a balance and a speed in every test.",
            where=motor.path or motor.name,
            remedy="Map speed_rpm, or drop the section.",
        )
    has_power = is_balance and largest_W > 0.0
    found = []
    if has_power:
        found.append(Parameter(
            "shaft_power_gain", "1", "relative error of the mechanical power", "instrument",
            "linear", 0.0, SHAFT_GAIN_SD,
            "torque and electrical power of class 0.5 to 1 against each other",
        ))  # fmt: skip
    if has_power and ("shaft_power_offset" in motor.parameters or not (asked or is_told)):
        found.append(Parameter(
            "shaft_power_offset", "W", "offset of the mechanical power", "instrument",
            "linear", 0.0, SHAFT_OFFSET_SHARE * largest_W,
            "zero of the torque: 0.1 % of the largest mechanical power",
        ))  # fmt: skip
    if asked or (has_power and is_told):
        sd, basis = 0.1, "0.1 % of a 100 N m transducer"
        if has_power and is_told:
            sd = SHAFT_OFFSET_SHARE * largest_W / fastest
            basis = "0.1 % of the largest mechanical power, at the highest speed"
        found.append(Parameter("torque_offset", "N m", "offset of the torque transducer",
                               "instrument", "linear", 0.0, sd, basis))  # fmt: skip
    return found


OWN = {
    "shaft_power_gain": ("1", "relative error of the mechanical power in this test"),
    "shaft_power_offset": ("W", "offset of the mechanical power in this test"),
    "torque_offset": ("N m", "offset of the torque transducer in this test"),
}
"""Unit and meaning of what the inputs of a test may tell by themselves."""


def own_name(name: str) -> str:
    """Return the name of an error of an instrument that is a test's own."""
    return f"own_{name}"


def own_errors(errors: Sequence[Told]) -> list[Parameter]:
    """Return the errors that the inputs of a test tell, held-out tests included.

    In this test they stand in place of those that all tests share.

    Args:
        errors: As `heatrun.record.balance_errors.together` has them.
    """
    return [
        Parameter(
            own_name(told.name), *OWN[told.name], "instrument", "linear", told.mean, told.sd,
            "the test's own inputs contradict the prior; no temperature used", per_test=True,
        )
        for told in errors
    ]  # fmt: skip


def corrected_losses(test: Blocks) -> np.ndarray:
    """Return the losses of a test without what its own errors add [W], shape (step,)."""
    own = {told.name: told.mean for told in test.told}
    beside = {"shaft_power_gain": "shaft_power", "torque_offset": "speed"}
    errors = [own[name] * test.means.get(beside.get(name, ""), np.ones(1)) for name in own]
    return test.means["losses"] - sum(errors)


def own_or_shared(values: Mapping[str, Any], name: str) -> Any:
    """Return a test's own error of an instrument, else the one of all tests, 0 where neither is."""
    return values.get(own_name(name), values.get(name, 0.0))


def timing_error(test: Blocks) -> list[Parameter]:
    """Return the moment of the load steps, where the logger is too slow to tell it.

    Samples are joined by straight lines, so a step that falls on a sample comes half a period
    early.
    """
    if test.sample_s < SLOW_LOGGER_S:
        return []
    return [
        Parameter(
            "load_timing", "s", "load later than halfway between two samples", "instrument",
            "linear", 0.0, test.sample_s / math.sqrt(12.0),
            f"samples every {test.sample_s:.3g} s: anywhere between two of them", per_test=True,
        )
    ]  # fmt: skip


STANDS_FOR = {
    "tooth_degC": ("stator",),
    "yoke_degC": ("stator",),
    "housing_degC": ("stator",),
    "rotor_degC": ("stator",),
    "magnet_degC": ("rotor", "stator"),
}
"""Nodes that a body is held against where the network has none of its own, the first that it has:
the stator node of the second order stands for stator and rotor."""


@dataclass(frozen=True)
class BodyCourse:
    """A measured body, and what a model says of it, block by block."""

    channel: str  # Its channel.
    node: str  # The node that it is compared with.
    # Whether its readings were fitted, with the errors of its sensor; if not, the node's own
    # temperature stands here.
    is_fitted: bool
    # Mean reading of each block [degC], shape (block,); NaN where nothing was read.
    measured: Float[np.ndarray, " block"]
    median: Float[np.ndarray, " block"]  # What the model says [degC], shape (block,).
    # The 95 % limits [degC], with noise where it is fitted.
    limits_95: tuple[np.ndarray, np.ndarray]

    @property
    def residual(self) -> np.ndarray:
        """Measured minus median [K], shape (block,); NaN where nothing was read."""
        return self.measured - self.median

    @property
    def error(self) -> np.ndarray:
        """The residuals of the blocks that hold a reading [K]."""
        return self.residual[np.isfinite(self.measured)]

    def coverage_95(self) -> float:
        """Return the share of readings inside the 95 % limits [1]."""
        seen = np.isfinite(self.measured)
        low, high = self.limits_95
        return float(np.mean(((self.measured >= low) & (self.measured <= high))[seen]))


def told_bodies(values: Mapping[str, object], test: Blocks) -> list[str]:
    """Return the channels of a test's bodies for whose sensors there are values of parameters."""
    return [b.channel for b in test.bodies if f"{body_name(b.channel)}_{BODY_PARTS[0]}" in values]


def node_of(form: NetworkForm, channel: str) -> str | None:
    """Return the node that a body is compared with, None if the network has none for it."""
    own = form.sensed(channel)
    for node in (own, body_name(channel), *STANDS_FOR.get(channel, ())):
        if node in form.nodes:
            return node
    return None


def body_courses(
    form: NetworkForm,
    test: Blocks,
    fitted: Mapping[str, tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]],
    nodes: Mapping[str, np.ndarray],
    nodes_95: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> tuple[BodyCourse, ...]:
    """Return the bodies of a test against what a model says.

    Args:
        form: The network.
        test: A reduced record.
        fitted: Median and 95 % limits of the reading by channel, where its sensor is in the model.
        nodes: Median of each node [degC].
        nodes_95: Its 95 % limits [degC].
    """
    rows = []
    for body in test.bodies:
        node = node_of(form, body.channel)
        if node is None or node not in nodes:
            continue
        is_fitted = body.channel in fitted
        median, limits = fitted[body.channel] if is_fitted else (nodes[node], nodes_95[node])
        rows.append(BodyCourse(body.channel, node, is_fitted, body.measured, median, limits))
    return tuple(rows)
