"""Gain of the sensor: twin of the coefficient of the copper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Inputs
from .base import EffectCard, Quantity, SensorEffect


class SensorGain(SensorEffect):
    r"""The sensor reads the rise wrong by a factor.

    $$ T_m = T_0 + (1+g)\,(T_w - T_0) $$

    Attributes:
        g: Relative error of the rise [1].

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
