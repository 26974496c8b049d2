"""A step of the cooling: a kink and a new slow constant when it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..inputs import Drive
from .base import EffectCard, HeatEffect, Quantity, Terms

WIDTH_S = 15.0
"""Width of the logistic course of the change [s]."""


class CoolingStep(HeatEffect):
    r"""From some moment on the conductance to the sink is another.

    $$ 1/R_{eq,sr} \to k/R_{eq,sr} \quad (t > t^*) $$

    The change takes about a minute, so that the moment can be fitted.

    Attributes:
        k: Conductance after the moment over before [1].
        t_star: The moment [s].
        link: Link that it acts on.

    Valid for: one change within a test: a door, a pump, a cover, a filter.
    """

    k: Float[Array, ""]
    t_star: Float[Array, ""]
    link: tuple[str, str] = eqx.field(static=True, default=("stator", "ambient"))

    card: ClassVar[EffectCard] = EffectCard(
        id="cooling_step",
        family="event",
        law="1/Req,sr -> k/Req,sr for t > t*",
        needs=(),
        signature="the slope kinks at one moment and another slow constant holds after it",
        separating_test="the same load held for 40 minutes before and after the moment, with the "
        "cooling watched",
        parameters={
            "k": Quantity("1", 1.0, 0.3, 3.0, 1.5, "conductance after the moment over before"),
            "t_star": Quantity("s", None, 0.0, 14400.0, 1800.0, "the moment"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        after = 0.5 * (1.0 + jnp.tanh(0.5 * (drive.time - self.t_star) / WIDTH_S))
        return terms.scale_conductance(self.link, 1.0 + (self.k - 1.0) * after)
