"""Effects of the sink: it is not at the temperature that the bench records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from ..inputs import Drive
from ..network import Network
from .base import EffectCard, HeatEffect, Quantity, Terms, require


class CoolantSink(HeatEffect):
    r"""Part of the heat goes to the coolant instead of the ambient.

    $$ T_0 \to (1-a)\,T_0 + a\,T_{coolant} $$

    Attributes:
        a: Share of the coolant in the sink [1].

    Valid for: one path to the sink that air and coolant share.
    """

    a: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="coolant_sink",
        family="sink",
        law="sink temperature -> (1 - a) T0 + a Tcoolant",
        needs=("coolant",),
        signature="the residual is the lagged coolant temperature",
        separating_test="a constant load while the coolant is stepped by 15 K and held for 40 "
        "minutes",
        parameters={
            "a": Quantity("1", 0.0, 0.0, 1.0, 0.5, "share of the coolant in the sink", 1.0),
        },
    )

    @classmethod
    def fits(cls, network: Network) -> bool:
        """Whether the network has one sink: with two of them each has its own resistance."""
        return not network.second_boundary

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        coolant = require(drive.coolant, "coolant_sink", "coolant_degC")
        return terms.with_sink(terms.sink + self.a * (coolant - terms.sink))


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


class AmbientRecirculation(HeatEffect):
    r"""The machine breathes its own warm air: the sink rises with the losses at once.

    $$ T_0 \to T_0 + r\,P $$

    Attributes:
        r: Rise of the intake per watt of losses [K/W].

    Valid for: air paths that are short against the slow time constant.
    """

    r: Float[Array, ""]

    card: ClassVar[EffectCard] = EffectCard(
        id="ambient_recirculation",
        family="sink",
        law="T0 -> T0 + r P, P all losses",
        needs=(),
        signature="it behaves as a larger Req,sr that has no lag",
        separating_test="a step of load with a second ambient sensor at the intake, 10 minutes "
        "before and after",
        parameters={
            "r": Quantity("K/W", 0.0, 0.0, 0.05, 0.01, "rise of the intake per watt of losses"),
        },
    )

    def apply(
        self, terms: Terms, temperature: Mapping[str, Float[Array, "..."]], drive: Drive
    ) -> Terms:
        """As `HeatEffect.apply`."""
        total = terms.copper + terms.other
        return terms.with_sink(terms.sink + self.r * total)
