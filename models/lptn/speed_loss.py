"""A part of the losses that follows the speed alone and heats a node of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from .effects.base import EffectCard, HeatEffect, Quantity, Terms, require
from .inputs import Drive

REFERENCE = 1000.0 * math.pi / 30.0
"""Speed that the watts hold at [rad/s]: 1000 rpm, whatever the rated speed of a machine is."""


class SpeedLoss(HeatEffect):
    r"""Iron or friction loss as a law of the speed, apart from the other losses.

    $$ P = P_1 s + P_2 s^2, \quad s = |n|/1000\,\text{rpm} $$

    The linear term is hysteresis or the friction of bearings, the square one eddy currents or
    windage. Under a measured balance the sum of all losses is known: what this part heats its
    node with is taken out of the other losses, and those are what remains. Under a map it comes on
    top of them.

    It belongs to a network and is none of the effects that a search may find, so that it is not
    in `lptn.EFFECTS`.

    Attributes:
        linear: P1, the part that grows with the speed, at 1000 rpm [W].
        square: P2, the part that grows with its square, at 1000 rpm [W].
        node: Node that it heats.

    Valid for: losses that the load does not change; iron losses at a flux that is held.
    Reference: J. Pyrhonen, T. Jokinen, V. Hrabovcova, Design of Rotating Electrical Machines,
        2nd ed., 2014, sections 9.1 (hysteresis, eddy currents) and 9.3 (friction, windage).
    """

    linear: Float[Array, ""]
    square: Float[Array, ""]
    node: str = eqx.field(static=True, default="rotor")

    card: ClassVar[EffectCard] = EffectCard(
        id="speed_loss",
        family="total loss",
        law="node += P1 s + P2 s^2; under a balance the other losses are what remains",
        needs=("speed_rad",),
        signature="the node warms with the speed at no load",
        separating_test="no load at three speeds of 40 minutes each",
        parameters={
            "linear": Quantity("W", 0.0, 0.0, 1e6, 100.0, "loss that grows with the speed"),
            "square": Quantity("W", 0.0, 0.0, 1e6, 100.0, "loss that grows with its square"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        speed = abs(require(drive.speed_rad, "a loss by speed", "speed_rpm")) / REFERENCE
        watts = self.linear * speed + self.square * speed**2
        if terms.losses.kind == "balance":
            terms = replace(terms.add_other(-watts), other=terms.other - watts)
        return terms.add_heat(self.node, watts)
