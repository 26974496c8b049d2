"""Stray load loss: heat with I^2 s^1.5 when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, power, require


class StrayLoadLoss(HeatEffect):
    r"""Loss that only a loaded machine has, with the square of the current and a power of speed.

    $$ k\,(I/I_r)^2 s^{1.5} $$

    Attributes:
        k: Stray loss at rated current and speed [W].

    Valid for: load-dependent losses beyond copper and no-load iron.
    """

    k: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="stray_load_loss",
        family="copper split",
        law="k i^2 s^1.5: under a balance it moves from the other losses to the winding, under a "
        "map it adds to the other losses",
        needs=("speed",),
        signature="a residual that grows with load and speed together, opposite to speed cooling",
        separating_test="the same current at low and at rated speed, 30 minutes each, with a "
        "cool-down at speed between",
        parameters={
            "k": Quantity("W", 0.0, 2.0, 3000.0, 200.0, "stray loss at rated current and speed"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "stray_load_loss", "speed_rpm")
        watts = self.k * drive.current_ratio_squared * power(speed, 1.5)
        is_balance = terms.losses.kind == "balance"
        return terms.add_copper(watts) if is_balance else terms.add_other(watts)
