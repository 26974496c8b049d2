"""Residuals of many machines side by side, and their derivatives by the scores."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.inference.problem import Structure
from lptn import CopperLosses

from .late import late_means
from .machines import Group, Lane, Machines
from .march import SLOPE, march

OF_SLOPE = ("Rs0", "current_gain")
OF_READING = ("sensor_gain", "sensor_offset", "load_timing")


class Means(NamedTuple):
    """Residuals of a group of tests and their derivatives.

    Attributes:
        residual: Measured minus modelled block means [K], shape (block, lane).
        jacobian: Their derivative [K per score], shape (block, parameter, lane).
    """

    residual: Float[Array, "block lane"]
    jacobian: Float[Array, "block parameter lane"]


class Free(NamedTuple):
    """A free parameter as the tests of a group see it.

    Attributes:
        positions: Its place in the scores, for each test.
        per_score: Derivative of its value by the score, shape (lane,).
    """

    positions: tuple[int, ...]
    per_score: Lane


def values_of_group(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"], group: Group
) -> tuple[dict[str, Lane], dict[str, Free]]:
    """Return the values of all parameters by name, and which are free; by lane."""
    found: dict[str, list[Any]] = {}
    for test in group.tests:
        for position, (name, transform, owner) in enumerate(structure.form):
            if owner is None or owner == test:
                sd, centre = machines.sd[position], machines.centre[position]
                shift = sd * z[position]
                value = centre * jnp.exp(shift) if transform == "log" else centre + shift
                per_score = sd * value if transform == "log" else sd
                found.setdefault(name, []).append((position, value, per_score))
    values, free = dict(group.fixed), {}
    for name, parts in found.items():
        positions, own, per_score = zip(*parts, strict=True)
        values[name] = jnp.concatenate(own)
        free[name] = Free(positions, jnp.concatenate(per_score))
    return values, free


def residuals_of_group(
    structure: Structure,
    machines: Machines,
    z: Float[Array, "parameter machine"],
    group: Group,
    worst: float,
) -> Means:
    """Return the residuals of a group of tests, and their Jacobian.

    Args:
        structure: What is compiled: a bare network, read by one sensor.
        machines: The numbers.
        z: Scores.
        group: The tests.
        worst: What a residual counts that is larger or not finite [K].
    """
    values, slots = values_of_group(structure, machines, z, group)
    losses = structure.model.losses(values)
    quantities = {name: v for name, v in values.items() if name not in (*OF_SLOPE, *OF_READING)}
    if "Rs0" in values:
        quantities[SLOPE] = losses.slope(jnp.asarray(1.0))
    free = sorted(name for name in quantities if name in slots)
    if any(name in slots for name in OF_SLOPE) and SLOPE in quantities:
        free = sorted([*free, SLOPE])

    gain, offset = values["sensor_gain"], values["sensor_offset"]
    seen = jnp.sum(group.weight, axis=1)
    late: dict[str, Array] = {}
    if "load_timing" in values:
        means = late_means(structure.model, group, quantities, free, values["load_timing"])
        mean, slopes = means.temperature, means.slopes
        rise = means.rise - values["ambient_offset"] * seen
        late["load_timing"] = means.temperature_by_time + gain * means.rise_by_time
    else:
        mean, slopes = march(structure.model, group, quantities, free)
        rise = mean - group.sensed_ambient - values["ambient_offset"] * seen
    reading = mean + gain * rise + offset * seen

    by_name: dict[str, Array] = {"sensor_gain": rise, "sensor_offset": seen} | late
    for name in free:
        slope = (1.0 + gain) * slopes[name]
        if name == "ambient_offset":
            slope = slope - gain * seen
        for own, per_own in _acting_through(name, losses).items():
            by_name[own] = slope * per_own
    columns = [[jnp.zeros_like(part) for part in group.by_test(mean)]
               for _ in range(structure.num_parameters)]  # fmt: skip
    for name, (positions, per_score) in slots.items():
        parts = group.by_test(by_name[name] * per_score)
        for test, (position, part) in enumerate(zip(positions, parts, strict=True)):
            columns[position][test] = -part

    difference = jnp.where(group.is_observed, group.measured - reading, 0.0)
    is_sound = jnp.abs(difference) < worst
    jacobian = jnp.stack([jnp.concatenate(parts, axis=-1) for parts in columns], axis=1)
    jacobian = jnp.where((group.is_observed & is_sound)[:, None], jacobian, 0.0)
    return Means(jnp.where(is_sound, difference, worst), jacobian)


def _acting_through(name: str, losses: CopperLosses) -> dict[str, Any]:
    """Return the parameters that act through a quantity, with its derivative by each."""
    if name != SLOPE:
        return {name: 1.0}
    slope = losses.slope(jnp.asarray(1.0))
    return {"Rs0": slope / losses.Rs0, "current_gain": 2.0 * slope / (1.0 + losses.current_gain)}
