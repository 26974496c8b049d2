"""The calibration models: which parameters they have, and the physics they stand for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from ..errors import InputError
from ..record.blocks import Blocks
from ..record.channels import body_name
from ..record.motor import Adequacy, Motor
from .bodies import BODY_PARTS, OWN, own_name, own_or_shared
from .catalogue import (
    all_effects,
    effects_named,
    refuse_lacking,
    refuse_unmeasured_current,
    refuse_unmeasured_sink,
    refuse_unmeasured_speed,
    refuse_unplaced,
)
from .network_form import NetworkForm
from .network_text import network_named
from .parameters import qualified
from .scale import Masses, scale_of_tests, scaled

Values = Mapping[str, "Float[Array, '']"]

if TYPE_CHECKING:  # which parameters there are is known without JAX; physics load it
    from jaxtyping import Array, Float

    from lptn import CopperLosses, Inputs, Network, Sensor, Trace
    from lptn.effects import AbstractEffect

    from ..record.observation import Observation


@dataclass(frozen=True)
class Model:
    """A network with its nuisances; hashable, so that it keys a compilation."""

    form: NetworkForm  # The network: nodes, links, where losses enter, what sensors read.
    kind: Literal["balance", "map"]  # What the loss channel means.
    phases: int  # Number of phases [1].
    reference_temperature: float  # Temperature that Rs0 holds for [degC].
    coefficient: float  # B of the winding's material [degC].
    effects: tuple[type[AbstractEffect], ...] = ()  # Effects that extend the network, in order.
    adequacy: Adequacy = field(default_factory=Adequacy)  # How far the network is trusted.
    # Standard deviation of the logarithm by which capacities and resistances change from test to
    # test [1]; 0 where they are the same in all.
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

    def extended(self, kinds: Iterable[type[AbstractEffect]]) -> Model:
        """Return the model with further effects, all in the order of the catalogue."""
        order = {kind: number for number, kind in enumerate(all_effects())}
        joined = dict.fromkeys([*self.effects, *kinds])
        in_order = sorted(joined, key=lambda kind: order.get(kind, len(order)))
        return replace(self, effects=tuple(in_order))

    def scaled(self, motor: Motor, tests: Sequence[Blocks]) -> Model:
        """Return the model with default priors of its network that suit the tests."""
        copper = self.unmeasured_copper_ohm(motor)
        masses = Masses(motor.mass_kg, motor.conductor_mass_kg, motor.resistance_coefficient_degC)
        return replace(self, form=scaled(self.form, scale_of_tests(tests, copper), masses))

    def unmeasured_copper_ohm(self, motor: Motor) -> float:
        """Return the resistance behind the copper loss that the loss channel leaves out [ohm]."""
        return self.phases * (motor.phase_resistance_ohm or 0.0) if self.kind == "map" else 0.0

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
            import jax.numpy as jnp

            values = {
                name: value * jnp.exp(values[change_name(name)])
                if change_name(name) in values
                else value
                for name, value in values.items()
            }
        return self.form.build(values)

    def in_general(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values without what belongs to one test: those of the machine in general."""
        of_test = {change_name(parameter.name) for parameter in self.form.parameters}
        of_test |= {own_name(name) for name in OWN}
        return {name: value for name, value in values.items() if name not in of_test}

    def topology(self) -> Network:
        """Return the network with all parameters 1: for questions that need no values."""
        return self.form.build(dict.fromkeys((p.name for p in self.form.parameters), 1.0))

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
        if self.needs_resistance:
            refuse_unmeasured_current(tests, self.words)
        refuse_unmeasured_sink(self.form.second_sink, tests, self.title)
        refuse_unmeasured_speed([loss.kind for loss in self.form.by_speed], tests, self.title)
        kinds = [kind for kind in self.effects if kind not in searched]
        refuse_lacking(kinds, tests)
        if kinds:
            refuse_unplaced(kinds, self.topology(), self.title)

    @property
    def needs_resistance(self) -> bool:
        """Whether the phase resistance enters: not in one node under a measured balance."""
        splits = any(kind.card.id == "winding_node" for kind in self.effects)
        return self.kind == "map" or len(self.form.nodes) > 1 or splits

    def losses(self, values: Values) -> CopperLosses:
        """Return copper loss and meaning of the loss channel for values by name."""
        import jax.numpy as jnp

        from lptn import CopperLosses

        return CopperLosses(
            Rs0=values.get("Rs0", jnp.asarray(0.0)),
            reference_temperature=self.reference_temperature,
            coefficient=self.coefficient,
            phases=self.phases,
            kind=self.kind,
            power_gain=values["power_gain"],
            torque_offset=own_or_shared(values, "torque_offset"),
            ambient_offset=values["ambient_offset"],
            current_gain=values.get("current_gain", 0.0),
            shaft_power_gain=own_or_shared(values, "shaft_power_gain"),
            shaft_power_offset=own_or_shared(values, "shaft_power_offset"),
            second_sink_offset=values.get("second_sink_offset", 0.0),
        )

    def sensor(self, values: Values) -> Sensor:
        """Return the winding sensor for values by name."""
        from lptn import Sensor

        return Sensor(
            node=self.form.measured_node, gain=values["sensor_gain"], offset=values["sensor_offset"]
        )

    def body_sensors(self, values: Values, channels: Sequence[str]) -> tuple[Sensor, ...]:
        """Return the sensors of measured bodies for values by name.

        Args:
            values: Parameters by name.
            channels: Their channels; each belongs to a node.
        """
        from lptn import Sensor

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
        from lptn.effects.sensors import TimeShift

        effects = self._chosen_effects(values)
        by_speed = [part for loss in self.form.by_speed for part in loss.build(values)]
        late = [TimeShift(values["load_timing"])] if "load_timing" in values else []
        return (*by_speed, *effects, *late)

    def longest_step(self, values: Values) -> Float[Array, ""]:
        """Return the longest step [s] that the march takes, as `lptn.longest_step`.

        Args:
            values: Those of `network_names`, and changes of the test.
        """
        from lptn import longest_step

        return longest_step(self.network(values), self._chosen_effects(values))

    @property
    def network_names(self) -> tuple[str, ...]:
        """Names of the parameters of the network and of the effects in it."""
        own = [parameter.name for parameter in self.form.parameters]
        own += [qualified(kind, name) for kind in self.effects for name in kind.card.parameters]
        return tuple(own)

    def _chosen_effects(self, values: Values) -> tuple[AbstractEffect, ...]:
        from lptn.effects import build_all

        wanted = [
            (kind, {name: values[qualified(kind, name)] for name in kind.card.parameters})
            for kind in self.effects
        ]
        return build_all(wanted, self.network(values))

    def block_means(self, values: Values, test: Observation) -> Float[Array, " row"]:
        """Return the modelled means over the blocks of a test [degC], in its rows."""
        from lptn import block_means

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
        from lptn import simulate

        return simulate(
            self.network(values),
            self.losses(values),
            inputs,
            self.start(values),
            effects=self.built_effects(values),
            sensor=self.sensor(values),
        )


def change_name(name: str) -> str:
    """Return the name of the change of a parameter in a test."""
    return f"{name}_change"
