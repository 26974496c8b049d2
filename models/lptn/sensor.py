"""What the temperature sensor reads of the nodes."""

from __future__ import annotations

import equinox as eqx
from jaxtyping import Array, Float


class Sensor(eqx.Module):
    """A thermometer in one node with a scale and an offset error.

    Attributes:
        node: Node that it sits in.
        gain: Relative error of the rise above the sink [1].
        offset: Constant error [K].
    """

    node: str = eqx.field(static=True, default="winding")
    gain: Float[Array, ""] | float = 0.0
    offset: Float[Array, ""] | float = 0.0

    def read(
        self, temperature: Float[Array, "..."], ambient: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Return the reading [degC], T + gain (T - T0) + offset, shape as `temperature`.

        Args:
            temperature: Temperature of the node [degC].
            ambient: Sink temperature T0 at the same times [degC].
        """
        return temperature + self.gain * (temperature - ambient) + self.offset
