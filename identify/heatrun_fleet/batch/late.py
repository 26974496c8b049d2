"""Readings that come late, for machines side by side: `lptn.TimeShift`, lane by lane.

A logger of the load that is too slow to tell when a step came moves the whole reading by a time of
its own in each test, straight between the edges of the steps. Here it moves by a step at most: then
a shifted edge needs its two neighbours alone, and the march is still made once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.inference.model import Model

from .machines import Group, Lane
from .march import Values, moving

SIDE_S = 1e-9
"""Puts no shift on the side from which `lptn.TimeShift` has its slope [s]."""


class LateMeans(NamedTuple):
    """Block means of what is read late.

    Attributes:
        temperature: Of the measured node [degC], shape (block, lane).
        rise: Its rise above the sink, as the channel has it [K], likewise.
        slopes: Derivatives of the temperature by quantity, likewise.
        temperature_by_time: Derivative of the temperature by the time [K/s], likewise.
        rise_by_time: Of the rise, likewise.
    """

    temperature: Float[Array, "block lane"]
    rise: Float[Array, "block lane"]
    slopes: dict[str, Float[Array, "block lane"]]
    temperature_by_time: Float[Array, "block lane"]
    rise_by_time: Float[Array, "block lane"]


class _Shift(NamedTuple):
    """How much of its neighbours an edge takes on.

    Attributes:
        back: Of the one before [1].
        ahead: Of the one after [1].
        step: Length of a step [s].
    """

    back: Lane
    ahead: Lane
    step: Lane

    @classmethod
    def of(cls, late_s: Lane, step: Lane) -> _Shift:
        """Return that of readings so late [s]."""
        steps = (late_s + SIDE_S) / step
        return cls(jnp.maximum(steps, 0.0), jnp.maximum(-steps, 0.0), step)

    def edge(self, before: Array, now: Array, after: Array) -> Array:
        """Return what is read in place of an edge."""
        return now + self.back * (before - now) + self.ahead * (after - now)

    def by_time(self, before: Array, now: Array, after: Array) -> Array:
        """Return the derivative of that by the time."""
        return jnp.where(self.ahead > 0.0, now - after, before - now) / self.step


def late_means(
    model: Model, rows: Group, quantities: Values, free: list[str], late_s: Lane
) -> LateMeans:
    """Return the block means of tests whose readings are late.

    Args:
        model: As `march.moving`.
        rows: Likewise.
        quantities: Likewise.
        free: Likewise.
        late_s: How late [s]; longer than a step of the march, the straight line is prolonged.
    """
    march = moving(model, rows, quantities, free)
    shift = _Shift.of(late_s, rows.step)
    num = rows.weight.shape[0] * rows.weight.shape[1]
    # an edge is read when the one after it is known: one step is made before the first is read
    once = jax.tree.map(lambda values: values.reshape(num, -1)[0], march.inputs)
    following = jax.tree.map(_one_ahead, march.inputs)
    is_last = (jnp.arange(1, num + 1)[:, None] >= _num_steps(rows)).reshape(rows.weight.shape)
    second = march.advance(march.first, once)
    begin, then = march.read(march.first), march.read(second)

    def edges(before, now, after):
        own = [shift.edge(*each) for each in zip(before, now, after, strict=True)]
        return [*own, shift.by_time(before[0], now[0], after[0])]

    def advance(before, x):
        state, last, read, totals = before
        inputs, weight, position, is_last = x
        after = march.advance(state, inputs)
        now, ahead = march.read(state), march.read(after)
        ahead = [jnp.where(is_last, here, there) for here, there in zip(now, ahead, strict=True)]
        here = edges(last, now, ahead)
        ends = zip(totals, read, here, strict=True)
        totals = [t + weight * (a + position * (b - a)) for t, a, b in ends]
        return (after, now, here, totals), None

    def block(before, x):
        nothing = [jnp.zeros_like(rows.step) for _ in range(2 + len(march.names))]
        (*after, totals), _ = jax.lax.scan(advance, (*before, nothing), x)
        return tuple(after), totals

    start = second, begin, edges(begin, begin, then)
    xs = following, rows.weight, rows.position, is_last
    found: Any = jax.lax.scan(block, start, xs)[1]
    temperature, *slopes, by_time = found
    sink, sink_by_time = _sink(rows, shift)
    temperature = temperature - model.coefficient * jnp.sum(rows.weight, axis=1)
    return LateMeans(
        temperature,
        temperature - sink,
        dict(zip(march.names, slopes, strict=True)),
        by_time,
        by_time - sink_by_time,
    )


def _sink(rows: Group, shift: _Shift) -> tuple[Array, Array]:
    """Return block means of the sink read late [degC], and their derivatives by the time."""
    steps = rows.ambient.reshape(-1, rows.ambient.shape[-1])
    before, after = jnp.concatenate([steps[:1], steps]), jnp.concatenate([steps, steps[-1:]])
    is_inside = jnp.arange(before.shape[0])[:, None] < _num_steps(rows)
    # at an edge between two steps, their mean
    edges = jnp.where(is_inside, 0.5 * (before + after), before)
    back = jnp.concatenate([edges[:1], edges[:-1]])
    ahead = jnp.where(is_inside, jnp.concatenate([edges[1:], edges[-1:]]), edges)
    return (
        _means(shift.edge(back, edges, ahead), rows),
        _means(shift.by_time(back, edges, ahead), rows),
    )


def _means(edges: Float[Array, "edge lane"], rows: Group) -> Float[Array, "block lane"]:
    before, after = (each.reshape(rows.weight.shape) for each in (edges[:-1], edges[1:]))
    return jnp.sum(rows.weight * (before + rows.position * (after - before)), axis=1)


def _one_ahead(values: Float[Array, "block step lane"]) -> Float[Array, "block step lane"]:
    """Return the inputs of the next step in place of each; the last one stays."""
    steps = values.reshape(-1, values.shape[-1])
    return jnp.concatenate([steps[1:], steps[-1:]]).reshape(values.shape)


def _num_steps(rows: Group) -> Lane:
    """Return the steps of each test without the padding."""
    return rows.num_blocks * rows.weight.shape[1]
