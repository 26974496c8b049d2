"""An effect of a user's own, as it is given with `heatrun discover --effects`."""

from jaxtyping import Array, Float

from lptn.effects import EffectCard, HeatEffect, Quantity


class CabinetHeater(HeatEffect):
    """A heater in the cabinet, on all the time."""

    P: Float[Array, ""]  # Heat of the heater [W].

    card = EffectCard(
        id="cabinet_heater",
        family="total loss",
        law="sr += P",
        needs=(),
        signature="warm at rest",
        separating_test="an hour at rest with the heater off",
        parameters={"P": Quantity("W", 0.0, 0.0, 100.0, 10.0, "heat of the heater")},
    )

    def apply(self, terms, temperature, drive):
        """As `HeatEffect.apply`."""
        return terms.add_heat("stator", self.P)
