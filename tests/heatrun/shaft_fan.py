"""An effect of a user's own: a fan on the shaft, with the exponent that its maker gives."""

from jaxtyping import Array, Float

from lptn.effects import EffectCard, HeatEffect, Quantity, power, require


class ShaftFan(HeatEffect):
    """The conductance to the sink rises with the speed of a fan on the shaft."""

    g: Float[Array, ""]  # Gain of conductance at rated speed [1].

    card = EffectCard(
        id="shaft_fan",
        family="cooling",
        law="1/Req,sr -> (1/Req,sr)(1 + g s^0.75)",
        needs=("speed",),
        signature="cooler at speed than the network says",
        separating_test="two cool-downs, with the fan and without",
        parameters={"g": Quantity("1", 0.0, 0.0, 5.0, 0.5, "gain of conductance at rated speed")},
    )

    def apply(self, terms, temperature, drive):
        """As `HeatEffect.apply`."""
        speed = require(drive.speed, "shaft_fan", "speed_rpm")
        return terms.scale_conductance(("stator", "ambient"), 1.0 + self.g * power(speed, 0.75))
