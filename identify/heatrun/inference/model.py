"""The calibration models: which parameters they have, and the physics they stand for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

from lptn import CopperLosses, Inputs, Network, Sensor, Trace, block_means, simulate
from lptn.effects import AbstractEffect, build_all
from lptn.effects.time_shift import TimeShift

from ..bench.blocks import Blocks, Observation
from ..bench.channels.schema import BODIES, body_name
from ..errors import InputError
from ..motor import Adequacy, Motor
from .catalogue import effects_named
from .effect_needs import (
    refuse_lacking,
    refuse_unmeasured_sink,
    refuse_unmeasured_speed,
    refuse_unplaced,
)
from .effect_parameters import effect_names, effect_parameters, qualified
from .instruments import (
    BODY_PARTS,
    CURRENT_GAIN,
    INSTRUMENTS,
    body_errors,
    second_sink_error,
    shaft_errors,
    timing_error,
    torque_error,
)
from .networks import BUILT_IN, NetworkForm, network_named
from .networks.masses import Masses
from .networks.scale import scale_of_tests, scaled
from .parameters import Parameter, ParameterSet, check_names, collect, override

Values = Mapping[str, Float[Array, ""]]

COLD_START_K = 2.0
"""Start within this of the sink [K] and at rest: stator and winding count as one temperature."""

OF_ALL_NETWORKS = (
    "Rs0", "current_gain", "power_gain", "torque_offset", "sensor_gain", "sensor_offset",
    "ambient_offset", "load_timing", "shaft_power_gain", "shaft_power_offset",
    "second_sink_offset",
)  # fmt: skip
"""Parameters that do not belong to the network itself."""


@dataclass(frozen=True)
class Model:
    """A network with its nuisances; hashable, so that it keys a compilation.

    Attributes:
        form: The network: nodes, links, where losses enter, what sensors read.
        kind: What the loss channel means.
        phases: Number of phases [1].
        reference_temperature: Temperature that Rs0 holds for [degC].
        coefficient: B of the winding's material [degC].
        effects: Effects that extend the network, in order.
        adequacy: How far the network is trusted.
        change_sd: Standard deviation of the logarithm by which capacities and resistances change
            from test to test [1]; 0 where they are the same in all.
    """

    form: NetworkForm
    kind: Literal["balance", "map"]
    phases: int
    reference_temperature: float
    coefficient: float
    effects: tuple[type[AbstractEffect], ...] = ()
    adequacy: Adequacy = field(default_factory=Adequacy)
    change_sd: float = 0.0

    @classmethod
    def of(
        cls,
        network: str | NetworkForm,
        motor: Motor,
        effects: tuple[type[AbstractEffect], ...] = (),
    ) -> Model:
        """Return the model of a motor, with effects beyond the network if wanted.

        Args:
            network: Name of a built-in network, a TOML file, or the network itself; its own
                effects come first.
            motor: The machine.
            effects: Effects beyond it, in order.

        Raises:
            InputError: If there is no such network, or its sink is not the motor's.
        """
        form = network_named(network).with_main_sink(motor.sink)
        if form.sink == "coolant" != motor.sink:
            raise InputError(
                "the sink of the network is the coolant, that of the motor file is not.",
                where=form.title,
                remedy='Write sink = "coolant" into [motor], or another sink into the network.',
            )
        form = form.with_sensors(motor.sensors)
        own = effects_named(form.effects, form.name)
        return cls(
            form=form,
            kind=motor.losses,
            phases=motor.phases,
            reference_temperature=motor.reference_temperature_degC,
            coefficient=motor.resistance_coefficient_degC,
            effects=(*own, *(kind for kind in effects if kind not in own)),
            adequacy=motor.adequacy,
        )

    def scaled(self, motor: Motor, tests: Sequence[Blocks]) -> Model:
        """Return the model with default priors of its network that suit the tests.

        Args:
            motor: The machine.
            tests: The reduced records that it will be fitted to.
        """
        copper = 0.0
        if self.kind == "map":
            copper = self.phases * (motor.phase_resistance_ohm or 0.0)
        masses = Masses(motor.mass_kg, motor.conductor_mass_kg, motor.resistance_coefficient_degC)
        return replace(self, form=scaled(self.form, scale_of_tests(tests, copper), masses))

    @property
    def name(self) -> str:
        """Name of the network, such as `"second"`."""
        return self.form.name

    @property
    def title(self) -> str:
        """The network in a sentence, such as `"second order"`."""
        return self.form.title

    @property
    def words(self) -> str:
        """The network as the subject of a sentence, such as `"second-order network"`."""
        is_order = self.title.endswith(" order")
        return f"{self.title.replace(' order', '-order')} network" if is_order else self.title

    def network(self, values: Values) -> Network:
        """Return the network for values by name; a change in the test is part of its values."""
        if self.change_sd:
            values = {
                name: value * jnp.exp(values[change_name(name)])
                if change_name(name) in values
                else value
                for name, value in values.items()
            }
        return self.form.build(values)

    def in_general(self, values: Values) -> dict[str, Float[Array, ""]]:
        """Return values without what changed in one test: those of the machine in general."""
        changes = {change_name(parameter.name) for parameter in self.form.parameters}
        return {name: value for name, value in values.items() if name not in changes}

    def topology(self) -> Network:
        """Return the network with all parameters 1: for questions that need no values."""
        return self.network({p.name: jnp.asarray(1.0) for p in self.form.parameters})

    def refuse_unusable(
        self, tests: Sequence[Blocks], searched: Sequence[type[AbstractEffect]] = ()
    ) -> None:
        """Refuse effects that the network has no place for, or the tests no channel.

        Args:
            tests: The reduced records that the model is to explain or to predict.
            searched: Effects of the model that a search has looked at already.

        Raises:
            InputError: With the effect, and the channel and the test or the links of the network;
                or with the test that lacks the temperature of a sink, or the speed.
        """
        refuse_unmeasured_sink(self.form.second_sink, tests, self.title)
        refuse_unmeasured_speed([loss.kind for loss in self.form.by_speed], tests, self.title)
        kinds = [kind for kind in self.effects if kind not in searched]
        refuse_lacking(kinds, tests)
        refuse_unplaced(kinds, self.topology(), self.title)

    @property
    def needs_resistance(self) -> bool:
        """Whether the phase resistance enters: not in one node under a measured balance."""
        splits = any(kind.card.id == "winding_node" for kind in self.effects)
        return self.kind == "map" or len(self.form.nodes) > 1 or splits

    def losses(self, values: Values) -> CopperLosses:
        """Return copper loss and meaning of the loss channel for values by name."""
        return CopperLosses(
            Rs0=values.get("Rs0", jnp.asarray(0.0)),
            reference_temperature=self.reference_temperature,
            coefficient=self.coefficient,
            phases=self.phases,
            kind=self.kind,
            power_gain=values["power_gain"],
            torque_offset=values.get("torque_offset", 0.0),
            ambient_offset=values["ambient_offset"],
            current_gain=values.get("current_gain", 0.0),
            shaft_power_gain=values.get("shaft_power_gain", 0.0),
            shaft_power_offset=values.get("shaft_power_offset", 0.0),
            second_sink_offset=values.get("second_sink_offset", 0.0),
        )

    def sensor(self, values: Values) -> Sensor:
        """Return the winding sensor for values by name."""
        return Sensor(
            node=self.form.measured_node,
            gain=values["sensor_gain"],
            offset=values["sensor_offset"],
        )

    def body_sensors(self, values: Values, channels: Sequence[str]) -> tuple[Sensor, ...]:
        """Return the sensors of measured bodies for values by name.

        Args:
            values: Parameters by name.
            channels: Their channels; each belongs to a node.
        """
        sensors = []
        for channel in channels:
            node, name = self.form.sensed(channel), body_name(channel)
            assert node is not None
            gain, offset, lag = (values[f"{name}_{part}"] for part in BODY_PARTS)
            sensors.append(Sensor(node, gain, offset, lag))
        return tuple(sensors)

    def with_bodies(self, test: Blocks) -> Blocks:
        """Return a test with the rows of those measured bodies that are nodes of the network."""
        own = [b.channel for b in test.bodies if self.form.sensed(b.channel) is not None]
        return test.with_bodies(own)

    def start(self, values: Values) -> dict[str, Float[Array, ""]]:
        """Return the start temperatures by node [degC]."""
        return {node: values[name] for node, name in self.form.starts}

    def built_effects(self, values: Values) -> tuple[AbstractEffect, ...]:
        """Return the effects for values by name, with the network's own losses by speed."""
        wanted = [
            (kind, {name: values[qualified(kind, name)] for name in kind.card.parameters})
            for kind in self.effects
        ]
        effects = build_all(wanted, self.network(values))
        by_speed = [part for loss in self.form.by_speed for part in loss.build(values)]
        late = [TimeShift(values["load_timing"])] if "load_timing" in values else []
        return (*by_speed, *effects, *late)

    def block_means(self, values: Values, test: Observation) -> Float[Array, " row"]:
        """Return the modelled means over the blocks of a test [degC], in its rows."""
        return block_means(
            self.network(values),
            self.losses(values),
            test.inputs,
            self.start(values),
            weight=test.weight,
            position=test.position,
            effects=self.built_effects(values),
            sensor=self.sensor(values),
            also=self.body_sensors(values, test.fitted),
        )

    def simulate(self, values: Values, inputs: Inputs) -> Trace:
        """Return temperatures, reading, flows and losses at full detail."""
        return simulate(
            self.network(values),
            self.losses(values),
            inputs,
            self.start(values),
            effects=self.built_effects(values),
            sensor=self.sensor(values),
        )


def parameters(
    model: Model,
    motor: Motor,
    tests: Sequence[Blocks],
    searched: Sequence[type[AbstractEffect]] = (),
) -> ParameterSet:
    """Return all parameters of a model over tests, with priors and the motor file's overrides.

    Args:
        model: Network with effects.
        motor: The machine.
        tests: The reduced records.
        searched: Effects of the model that may be absent, as `effect_parameters`.

    Raises:
        InputError: If the phase resistance is needed and not given, an override is wrong, or an
            effect lacks its channel or its place.
    """
    model.refuse_unusable(tests, searched)
    check_names((*override_names(model.form), *effect_names(model.effects)), motor)
    shared = [*model.form.parameters, *_resistance(model, motor, tests), *INSTRUMENTS]
    shared += body_errors(tests)
    shared += shaft_errors(motor, tests)
    if model.form.second_sink:
        shared.append(second_sink_error(model.form.second_sink))
    if "torque_offset" in motor.parameters:
        shared.append(torque_error(motor, tests))
    by_test = [
        override(
            [
                *shared,
                *timing_error(test),
                *_start(model, test),
                *(_changes(model, motor) if model.change_sd else ()),
                *effect_parameters(model.effects, test.duration_s, searched),
            ],
            motor,
        )
        for test in tests
    ]
    return collect([test.name for test in tests], by_test)


def change_name(name: str) -> str:
    """Return the name of the change of a parameter in a test."""
    return f"{name}_change"


def changing(model: Model, motor: Motor) -> list[Parameter]:
    """Return the parameters that may change from test to test: free capacities and resistances."""
    free = override(model.form.parameters, motor).values()
    return [p for p in free if p.unit in ("J/K", "K/W") and p.fixed is None and not p.per_test]


def _changes(model: Model, motor: Motor) -> list[Parameter]:
    return [
        Parameter(
            change_name(each.name), "1", f"change of ln {each.name} in this test", "change",
            "linear", 0.0, model.change_sd, "as the tests differ from each other", per_test=True,
        )
        for each in changing(model, motor)
    ]  # fmt: skip


def override_names(*networks: NetworkForm) -> tuple[str, ...]:
    """Return every name that a motor file may override beside those of effects.

    Args:
        networks: Networks beyond the built-in ones.
    """
    forms = [*(network_named(name) for name in BUILT_IN), *networks]
    names = [name for form in forms for name in form.names]
    of_bodies = [f"{body_name(channel)}_{part}" for channel in BODIES for part in BODY_PARTS]
    return tuple(dict.fromkeys([*names, *OF_ALL_NETWORKS, *of_bodies]))


def _resistance(model: Model, motor: Motor, tests: Sequence[Blocks]) -> list[Parameter]:
    """Return Rs0 and the error of the current where the copper loss enters."""
    has_current = any(bool(jnp.any(test.inputs.current_squared > 0.0)) for test in tests)
    if not model.needs_resistance or not has_current:
        return []
    said = motor.parameters.get("Rs0")
    given = motor.phase_resistance_ohm
    if given is None and (said is None or (said.value is None and said.fixed is None)):
        raise InputError(
            "the phase resistance is not given, and the copper loss of the "
            f"{model.words} needs it.",
            where=motor.path or motor.name,
            remedy="Give [winding] phase_resistance_ohm, or a guess to be estimated with "
            "[parameters.Rs0] value = ... and relative_sd = 0.2; or calibrate with --model first.",
        )
    return [
        Parameter(
            "Rs0", "ohm", "phase resistance at the reference temperature", "resistance", "log",
            1.0 if given is None else given, 0.01,
            "four-wire measurement, winding temperature known to 2 K (0.4 %/K)",
        ),
        CURRENT_GAIN,
    ]  # fmt: skip


def _start(model: Model, test: Blocks) -> list[Parameter]:
    return [
        Parameter(
            name, "degC", f"{node} temperature at the start", "start", "linear",
            *_start_prior(model, node, test), per_test=True,
        )
        for node, name in model.form.starts
    ]  # fmt: skip


def _start_prior(model: Model, node: str, test: Blocks) -> tuple[float, float, str]:
    """Return centre and standard deviation [degC] of a node's start, and what they rest on."""
    rise = test.start_degC - float(test.inputs.ambient[0])
    if node == model.form.measured_node:
        return test.start_degC, 2.0, "first readings, with the sensor's lag and rounding"
    for body in test.bodies:
        if node == model.form.sensed(body.channel):
            return body.start_degC, 2.0, f"first readings of {body.channel}"
    if abs(rise) < COLD_START_K:
        return test.start_degC, 1.0, "cold start: the machine has soaked at one temperature"
    return (
        test.start_degC - 0.35 * rise,
        max(5.0, 0.2 * abs(rise)),
        f"warm start, {node} not measured: between sink and winding, nearer the winding",
    )
