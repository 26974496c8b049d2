"""Effects of the sensor: what it reads is not the winding's temperature at that time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Inputs
from ..network import lagged
from .base import EffectCard, Quantity, SensorEffect, power


class SensorLag(SensorEffect):
    r"""A potted sensor follows the winding with a first-order lag.

    $$ \tau_s \dot T_m = T_w - T_m $$

    Solved exactly for a reading that is linear between edges, so that a lag much shorter than
    the interval is as stable as a long one. It starts in equilibrium.

    Valid for: a sensor that is small against the winding (it takes no heat away).
    """

    tau: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="sensor_lag",
        family="sensor",
        law="tau_s dTm/dt = Tw - Tm",
        needs=(),
        signature="a spike at every step of the current",
        separating_test="temperature by resistance right after a current step, beside the sensor",
        parameters={"tau": Quantity("s", 0.0, 1.0, 60.0, 10.0, "time constant of the sensor")},
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return lagged(reading, self.tau, jnp.diff(inputs.edges()))


class SensorContact(SensorEffect):
    r"""The sensor sits between winding and stator, or at a spot hotter than the mean.

    $$ T_m = (1-k)\,T_w + k\,T_{sr} $$

    Valid for: a sensor that is small against both.
    """

    k: Float[Array, ""]  # Negative at a hot spot.
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="sensor_contact",
        family="sensor",
        law="Tm = (1 - k) Tw + k Tsr",
        needs=(),
        signature="the fast part of the response to a step of current is too small, or too large",
        separating_test="temperature by resistance right after a step of current, by the sensor",
        parameters={
            "k": Quantity("1", 0.0, -0.2, 0.5, 0.15, "share of the stator in the reading", 1.0)
        },
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return reading + self.k * (temperature[self.node] - temperature["winding"])


class SensorGain(SensorEffect):
    r"""The sensor reads the rise wrong by a factor.

    $$ T_m = T_0 + (1+g)\,(T_w - T_0) $$

    Valid for: an error in proportion to the rise above the sink.
    """

    g: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="sensor_gain",
        family="sensor",
        law="Tm = T0 + (1 + g)(Tw - T0)",
        needs=(),
        signature="hardly anything: it looks like another coefficient of the copper",
        separating_test="the sensor in a bath at two known temperatures",
        parameters={"g": Quantity("1", 0.0, -0.03, 0.03, 0.02, "relative error of the rise")},
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        return reading + self.g * (reading - inputs.ambient_at_edges())


class SensorPickup(SensorEffect):
    r"""The sensor's line picks up the current: what it reads moves at once with the load.

    $$ T_m = T_w + p\,|I/I_N|^n $$

    Ground loops and direct current in the leads go with the current (n = 1), interference of the
    inverter comes as it switches (n towards 0), what an amplifier rectifies goes with the power of
    it (n = 2). An interval in which the current steps holds what comes before and after it, in the
    shares that its mean square tells; the edges take the mean of the intervals beside them.

    Valid for: a filter of the sensor that is fast against the intervals.
    """

    p: Float[Array, ""]
    n: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="sensor_pickup",
        family="sensor",
        law="Tm = Tw + p |I/IN|^n",
        needs=(),
        signature="the reading jumps at every step of the current, and back",
        separating_test="the load switched off for a second: no winding cools by kelvins in it",
        parameters={
            "p": Quantity("K", 0.0, -10.0, 10.0, 2.0, "what the current adds, rated"),
            "n": Quantity("1", None, 0.05, 2.0, 1.0, "exponent of the current"),
        },
        is_at_once=True,
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        square = inputs.drive().current_ratio_squared
        padded = jnp.concatenate([square[:1], square, square[-1:]])
        before, after = padded[:-2], padded[2:]
        law = power(square, 0.5 * self.n)
        from_law, to_law = power(before, 0.5 * self.n), power(after, 0.5 * self.n)
        share = (square - before) / jnp.where(after == before, 1.0, after - before)
        is_step = (after != before) & (share > 0.0) & (share < 1.0)
        law = jnp.where(is_step, from_law + share * (to_law - from_law), law)
        return reading + self.p * _at_edges(law)


def _at_edges(means: Float[Array, " time"]) -> Float[Array, " edge"]:
    """Return what is held at the edges of intervals of one length, by their means.

    It runs straight on from both sides, as far as the next mean: true at bends of straight lines,
    and at a jump between the two.
    """
    first, last = _ahead(means[:3][::-1]), _ahead(means[-3:])
    padded = jnp.concatenate([first[::-1], means, last])
    now, then = padded[1:-2], padded[2:-1]
    low, high = jnp.minimum(now, then), jnp.maximum(now, then)
    from_before = jnp.clip(now + 0.5 * (now - padded[:-3]), low, high)
    from_after = jnp.clip(then - 0.5 * (padded[3:] - then), low, high)
    return 0.5 * (from_before + from_after)


def _ahead(means: Float[Array, " time"]) -> Float[Array, "2"]:
    """Return two means past the last: straight on, or as the last where it has just jumped."""
    steps = jnp.diff(means[-3:], prepend=means[:1]) if means.size < 3 else jnp.diff(means)
    smaller = jnp.min(jnp.abs(steps)) * jnp.sign(steps[-1])
    slope = jnp.where(jnp.all(steps * steps[-1] > 0.0), smaller, 0.0)
    return means[-1] + slope * jnp.arange(1.0, 3.0)


class TimeShift(SensorEffect):
    r"""The temperature is recorded late: another logger, a filter, a slow bus.

    $$ T_m(t) = T_w(t - d) $$

    Straight lines between the edges; before the start the first temperature holds.

    Valid for: one delay throughout the tests.
    """

    d: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="time_shift",
        family="sensor",
        law="Tm(t) = Tw(t - d)",
        needs=(),
        signature="spikes of zero mean at all steps of the inputs",
        separating_test="a steep step of current, with current and temperature on one logger",
        parameters={"d": Quantity("s", 0.0, 0.0, 60.0, 9.0, "delay of the temperature")},
    )

    def observe(
        self,
        reading: Float[Array, " edge"],
        temperature: Mapping[str, Float[Array, " edge"]],
        inputs: Inputs,
    ) -> Float[Array, " edge"]:
        """As `SensorEffect.observe`."""
        delay = self.d + 1e-9  # puts d = 0 on the side from which the slope by d is true
        if not inputs.is_uniform:
            edges = inputs.edges()
            return jnp.interp(edges - delay, edges, reading)
        # a search among the edges would take as long as the march
        late = delay / inputs.step
        whole = jnp.floor(late)
        places = jnp.arange(reading.size) - whole.astype(int)
        later, earlier = (
            reading[jnp.clip(each, 0, reading.size - 1)] for each in (places, places - 1)
        )
        return later + (late - whole) * (earlier - later)
