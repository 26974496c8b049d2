"""Sensor lag: a spike at every step of the current when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Inputs
from ..sensor import lagged
from .base import EffectCard, Quantity, SensorEffect


class SensorLag(SensorEffect):
    r"""A potted sensor follows the winding with a first-order lag.

    $$ \tau_s \dot T_m = T_w - T_m $$

    Solved exactly for a reading that is linear between edges, so that a lag much shorter than
    the interval is as stable as a long one. It starts in equilibrium.

    Attributes:
        tau: Time constant of the sensor [s].

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
