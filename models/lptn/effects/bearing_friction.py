"""Bearing friction: early heat that fades when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class BearingFriction(HeatEffect):
    r"""Grease is stiff when cold: friction heats the stator early and fades as it warms.

    $$ P_{sr} \mathrel{+}= T_f\,\omega\,e^{-\kappa (T_{sr}-T_0)} $$

    Attributes:
        T_f: Friction torque of the cold bearings [N m].
        kappa: Fall of the friction with temperature [1/K].
        node: Node that it acts on.

    T_f holds all of what reaches the stator: a share c of it could not be told from its size.

    Valid for: friction that the losses do not hold, so it adds heat, under a map and where the
        balance leaves it out.
    """

    T_f: Float[Array, ""]
    kappa: Float[Array, ""]
    node: str = eqx.field(static=True, default="stator")

    card: ClassVar[EffectCard] = EffectCard(
        id="bearing_friction",
        family="total loss",
        law="sr += Tf omega exp(-kappa (Tsr - T0)): adds heat",
        needs=("speed_rad",),
        signature="early heat that fades within 10 to 30 minutes",
        separating_test="a cold start at rated speed without load for 30 minutes, and the same "
        "again warm",
        parameters={
            "T_f": Quantity("N m", 0.0, 0.005, 1.0, 0.1, "friction torque of the cold bearings"),
            "kappa": Quantity(
                "1/K", None, 0.02, 0.04, 0.03, "fall of the friction with temperature"
            ),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = abs(require(drive.speed_rad, "bearing_friction", "speed_rpm"))
        fading = jnp.exp(-self.kappa * (temperature[self.node] - terms.sink))
        return terms.add_heat(self.node, self.T_f * speed * fading)
