"""Drift of the sink: a slow ramp when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms


class AmbientDrift(HeatEffect):
    r"""The true sink drifts away from the sensor that stands for it.

    $$ T_0 \to T_0 + d\,t $$

    Attributes:
        d: Drift of the sink [K/h].

    Valid for: a steady drift from the start of each test.
    """

    d: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="ambient_drift",
        family="sink",
        law="T0 -> T0 + d t",
        needs=(),
        signature="a slow ramp, delayed by the slow time constant",
        separating_test="an hour at rest with a second ambient sensor at the intake of the "
        "cooling air",
        parameters={
            "d": Quantity("K/h", 0.0, -5.0, 5.0, 2.0, "drift of the sink"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        return terms.with_sink(terms.sink + self.d * drive.time / 3600.0)
