"""The free parameters of a model over tests, with their priors.

Whether records have what a network and its known effects need is told before anything is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..record.balance_errors import together
from ..record.blocks import Blocks
from ..record.channels import BODIES, body_name
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.reduction import reduce
from .bodies import (
    BODY_PARTS,
    CURRENT_GAIN,
    body_errors,
    instruments,
    own_errors,
    second_sink_error,
    shaft_errors,
    timing_error,
)
from .catalogue import known_effects, refuse_lacking
from .model import Model, change_name
from .network_form import NetworkForm
from .network_text import BUILT_IN, network_named, networks_of
from .parameters import (
    CATALOGUE,
    Parameter,
    ParameterSet,
    Size,
    check_names,
    collect,
    effect_names,
    effect_parameters,
    override,
)
from .scale import one_node

if TYPE_CHECKING:
    from lptn.effects import AbstractEffect


COLD_START_K = 2.0
"""Start within this of the sink [K] and at rest: stator and winding count as one temperature."""

SD_FOUR_WIRE, MOST_EDDIES = 0.01, 0.2
"""Prior standard deviation of ln Rs0, and what eddies add at most to the copper loss of a coil or
transformer on alternating current [1]: without a speed no effect of the catalogue tells them."""

OF_ALL_NETWORKS = (
    "Rs0", "current_gain", "power_gain", "torque_offset", "sensor_gain", "sensor_offset",
    "ambient_offset", "load_timing", "shaft_power_gain", "shaft_power_offset",
    "second_sink_offset",
)  # fmt: skip
"""Parameters that do not belong to the network itself."""


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
    names = override_names(model.form)
    if not set(names) >= set(motor.parameters):  # the effects' own are looked up last: slow to load
        check_names((*names, *effect_names(model.effects)), motor)
    shared = [*model.form.parameters, *_resistance(model, motor, tests), *instruments(tests)]
    shared += body_errors(tests)
    shared += shaft_errors(motor, tests)
    if model.form.second_sink:
        shared.append(second_sink_error(model.form.second_sink))
    size = machine_size(model, motor, tests)
    by_test = [
        override(
            [
                *shared,
                *timing_error(test),
                *own_errors(own),
                *_start(model, test),
                *(_changes(model, motor) if model.change_sd else ()),
                *effect_parameters(model.effects, test.duration_s, searched, size),
            ],
            motor,
        )
        for test, own in zip(tests, together([test.told for test in tests]), strict=True)
    ]
    return collect([test.name for test in tests], by_test)


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
    """Return every name that a motor file may override beside those of effects."""
    forms = [*(network_named(name) for name in BUILT_IN), *networks]
    names = [name for form in forms for name in form.names]
    of_bodies = [f"{body_name(channel)}_{part}" for channel in BODIES for part in BODY_PARTS]
    return tuple(dict.fromkeys([*names, *OF_ALL_NETWORKS, *of_bodies]))


def machine_size(model: Model, motor: Motor, tests: Sequence[Blocks]) -> Size:
    """Return the size of a machine, as its tests show it."""
    speeds = [float(test.means["rated_speed"]) for test in tests]
    found = one_node(tests, model.unmeasured_copper_ohm(motor)) or (
        CATALOGUE.capacity, CATALOGUE.resistance,
    )  # fmt: skip
    return Size(*found, speed=max(speeds, default=0.0) or CATALOGUE.speed)


def _resistance(model: Model, motor: Motor, tests: Sequence[Blocks]) -> list[Parameter]:
    """Return Rs0 and the error of the current where the copper loss enters."""
    has_current = any(np.any(test.means["current_squared"] > 0.0) for test in tests)
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
    more = room_for_eddies(motor, tests) if motor.phases == 1 and given is not None else 0.0
    return [
        Parameter(
            "Rs0", "ohm", "phase resistance at the reference temperature", "resistance", "log",
            1.0 if given is None else given * (1.0 + 0.5 * more),
            math.hypot(SD_FOUR_WIRE, 0.25 * more),
            "four-wire measurement, winding temperature known to 2 K (0.4 %/K)" if not more
            else f"one phase: alternating current may meet up to {100.0 * more:.0f} % more; for "
            "direct current state value and relative_sd = 0.01 under [parameters.Rs0]",
        ),
        CURRENT_GAIN,
    ]  # fmt: skip


def room_for_eddies(motor: Motor, tests: Sequence[Blocks]) -> float:
    """Return by how much eddies may raise the copper loss of a coil at most, over itself [1].

    Under a measured balance what they add is among the losses: no more than what these leave.
    """
    if motor.losses != "balance":
        return MOST_EDDIES
    copper = losses = 0.0
    for test in (each.winding for each in tests):
        squared, watts = (test.by_block(test.means[n]) for n in ("current_squared", "losses"))
        seen = np.isfinite(test.measured)
        loss = motor.copper_loss_W(np.sqrt(squared[seen]), test.measured[seen])
        copper, losses = copper + float(np.sum(loss)), losses + float(np.sum(watts[seen]))
    return float(np.clip(losses / max(copper, 1e-12) - 1.0, 0.0, MOST_EDDIES))


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
    rise = test.start_degC - float(test.means["ambient"][0])
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


def check_model(
    networks: str | None, effects: str, motor: Motor, records: Sequence[Record]
) -> tuple[Finding, ...]:
    """Return what forbids to calibrate networks with known effects on records.

    Args:
        networks: As after `--model`; None to look at the channels of the effects alone.
        effects: Ids of known effects beside those of the motor file, with commas between.
        motor: The machine.
        records: Records without errors of their own.

    Returns:
        For each record the first reason, as an error; empty if there is none.

    Raises:
        InputError: If there is no such network or effect, or its file is wrong.
    """
    known = known_effects(motor, effects)
    if networks is None and not known:
        return ()
    models = [Model.of(form, motor, known) for form in networks_of(networks)] if networks else []
    findings = []
    for record in records:
        test = reduce(record, motor)
        try:
            refuse_lacking(known, [test])
            for model in models:
                parameters(model, motor, [test])
        except InputError as error:
            findings.append(_refusal(error, record))
    return tuple(findings)


def check_second_order(effects: str, motor: Motor, records: Sequence[Record]) -> dict[str, Finding]:
    """Return what the second order lacks, by the name of the record.

    Args:
        effects: As `check_model`.
        motor: The machine; where its file is for another network alone, nothing is lacking.
        records: Records without errors of their own.
    """
    try:
        found = check_model("second", effects, motor, records)
    except InputError:
        return {}
    return {finding.test: finding for finding in found}


def _refusal(error: InputError, record: Record) -> Finding:
    return Finding(
        id="model_refused",
        severity="error",
        message=f"This test cannot be used with the network and its effects: {error.problem}",
        where=error.where,
        remedy=error.remedy,
        test=record.name,
    )
