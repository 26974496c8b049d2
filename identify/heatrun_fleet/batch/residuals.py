"""Residuals of many machines side by side, and their derivatives by the scores.

Lanes stand in the trailing axis. What comes after the residuals is the noise of one machine, mapped
over lanes; it is none of this file's matter.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.model.noise import Noise, gram
from heatrun.model.problem import WORST_RESIDUAL, Structure
from lptn import CopperLosses

from .march import SLOPE, Group, Lane, Machines, late_means, march

OF_SLOPE = ("Rs0", "current_gain")
OF_READING = ("sensor_gain", "sensor_offset", "load_timing")


class Means(NamedTuple):
    """Measured minus modelled block means of a group of tests [K]; their derivative per score."""

    residual: Float[Array, "block lane"]
    jacobian: Float[Array, "block parameter lane"]


def residuals_of_group(
    structure: Structure, machines: Machines, z: Float[Array, "parameter machine"], group: Group
) -> Means:
    """Return the residuals of a group of tests, and their Jacobian.

    The structure is a bare network, read by one sensor.
    """
    priors, form = machines.priors, structure.form
    by_test = [priors.values(form, z, test) for test in group.tests]
    values = {name: jnp.concatenate([own[name] for own in by_test]) for name in by_test[0]}
    free = {name for name, _, _ in form}
    losses = structure.model.losses(values)
    quantities = {name: v for name, v in values.items() if name not in (*OF_SLOPE, *OF_READING)}
    if "Rs0" in values:
        quantities[SLOPE] = losses.slope(jnp.asarray(1.0))
    moving = sorted(free & set(quantities))
    if free & set(OF_SLOPE) and SLOPE in quantities:
        moving = sorted([*moving, SLOPE])

    gain, offset = values["sensor_gain"], values["sensor_offset"]
    seen = jnp.sum(group.rows.weight, axis=1)
    late: dict[str, Array] = {}
    if "load_timing" in values:
        mean, slopes, sink, by_time, sink_by_time = late_means(
            structure.model, group, quantities, moving, values["load_timing"]
        )
        late["load_timing"] = by_time + gain * (by_time - sink_by_time)
    else:
        (mean, slopes), sink = march(structure.model, group, quantities, moving), group.sink
    rise = mean - sink - values["ambient_offset"] * seen
    reading = mean + gain * rise + offset * seen

    by_name: dict[str, Array] = {"sensor_gain": rise, "sensor_offset": seen} | late
    for name in moving:
        slope = (1.0 + gain) * slopes[name]
        if name == "ambient_offset":
            slope = slope - gain * seen
        for own, per_own in _acting_through(name, losses).items():
            by_name[own] = slope * per_own
    parts = {name: group.by_test(by_name[name]) for name in free}
    columns = []
    for position, (name, transform, owner) in enumerate(form):
        of_tests = []
        for part, test, own in zip(parts[name], group.tests, by_test, strict=True):
            per_score = priors.sd[position] * (own[name] if transform == "log" else 1.0)
            of_tests.append(-part * per_score if owner in (None, test) else jnp.zeros_like(part))
        columns.append(jnp.concatenate(of_tests, axis=-1))

    is_observed = group.rows.is_observed
    difference = jnp.where(is_observed, group.rows.measured - reading, 0.0)
    is_sound = jnp.abs(difference) < WORST_RESIDUAL
    jacobian = jnp.where((is_observed & is_sound)[:, None], jnp.stack(columns, axis=1), 0.0)
    return Means(jnp.where(is_sound, difference, WORST_RESIDUAL), jacobian)


def _acting_through(name: str, losses: CopperLosses) -> dict[str, Any]:
    """Return the parameters that act through a quantity, with its derivative by each."""
    if name != SLOPE:
        return {name: 1.0}
    slope = losses.slope(jnp.asarray(1.0))
    return {"Rs0": slope / losses.Rs0, "current_gain": 2.0 * slope / (1.0 + losses.current_gain)}


def inner_products(
    machines: Machines, means: list[Means], noise: Noise
) -> tuple[Float[Array, "product product machine"], Lane]:
    """Return what `heatrun.fit.restricted.inner_products` does of each machine."""
    size = 1 + means[0].jacobian.shape[1]
    total = jnp.zeros((size, size, *noise.sd.shape)), jnp.zeros_like(noise.sd)
    for of_group, group in zip(means, machines.groups, strict=True):
        columns = jnp.concatenate([of_group.residual[:, None], of_group.jacobian], axis=1)
        own = jax.tree.map(group.by_lane, noise)
        for found in zip(*map(group.by_test, each(gram)(columns, own, group.rows)), strict=True):
            total = jax.tree.map(jnp.add, total, found)
    return total


each = partial(jax.vmap, in_axes=-1, out_axes=-1)
"""Maps a function of one machine over lanes."""
