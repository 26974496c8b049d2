"""What the temperature sensor reads of the nodes."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class Sensor(eqx.Module):
    """A thermometer in one node with a scale and an offset error, and a lag if it has one.

    Attributes:
        node: Node that it sits in.
        gain: Relative error of the rise above the sink [1].
        offset: Constant error [K].
        lag: Time constant of a first-order lag [s]; None for a sensor that follows at once. It
            starts in equilibrium.
    """

    node: str = eqx.field(static=True, default="winding")
    gain: Float[Array, ""] | float = 0.0
    offset: Float[Array, ""] | float = 0.0
    lag: Float[Array, ""] | float | None = None

    def read(
        self, temperature: Float[Array, "..."], ambient: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the reading [degC], T + gain (T - T0) + offset, shape as `temperature`.

        Args:
            temperature: Temperature of the node [degC].
            ambient: Sink temperature T0 at the same times [degC].
        """
        return temperature + self.gain * (temperature - ambient) + self.offset

    def follow(
        self,
        sensed: Float[Array, "..."],
        before: Float[Array, "..."],
        after: Float[Array, "..."],
        step: Float[Array, ""],
    ) -> Float[Array, "..."]:
        """Return what the sensor shows at the end of an interval [degC].

        Exact where the reading without the lag runs straight over the interval.

        Args:
            sensed: What it showed at the beginning [degC].
            before: Reading without the lag at the beginning [degC].
            after: The same at the end [degC].
            step: Length of the interval [s].
        """
        if self.lag is None:
            return after
        return _follow(sensed, before, after, *_weights(self.lag, step))


def lagged(
    reading: Float[Array, " edge"], lag: Float[Array, ""] | float, step: Float[Array, " time"]
) -> Float[Array, " edge"]:
    """Return a reading with a first-order lag that starts in equilibrium [degC], shape (edge,).

    Exact where the reading runs straight between edges, so that a lag much shorter than the
    interval is as stable as a long one.

    Args:
        reading: Reading without the lag at the edges of the intervals [degC].
        lag: Time constant [s].
        step: Length of each interval [s].
    """

    def advance(sensed, x):
        sensed = _follow(sensed, *x)
        return sensed, sensed

    rows = (reading[:-1], reading[1:], *_weights(lag, step))
    _, sensed = jax.lax.scan(advance, reading[0], rows)
    return jnp.concatenate([reading[:1], sensed])


def _weights(lag, step):
    """Return the decay over an interval, and its mean over it [1]."""
    # the summand keeps value and one-sided gradient finite at no lag
    ratio = step / (lag + 1e-9 * step)
    return jnp.exp(-ratio), -jnp.expm1(-ratio) / ratio


def _follow(sensed, before, after, decay, mean):
    """Return the response to a ramp from `before` to `after`."""
    return decay * sensed + (mean - decay) * before + (1.0 - mean) * after
