"""Heat capacities from the masses in the motor file: narrower priors than any test's own scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...io.quantities import rounded

COPPER, ALUMINIUM = 385.0, 897.0
"""Specific heat of the conductor [J/(kg K)] (Incropera, Fundamentals of Heat and Mass Transfer)."""

BODY = 460.0
"""Of laminations, shaft, magnets and housing together [J/(kg K)]: steel, between 440 and 480."""

BELOW_degC = 230.0
"""The coefficient B of R(T) is 234.5 °C for copper and 225 °C for aluminium: the conductor is the
latter below this."""

INSULATION = 1.15
"""Insulation and resin warm with the conductor: its capacity times this [1]."""

TAKING_PART = 0.85
"""Share of the body's capacity that follows the winding's test [1]: rotor, shields and feet lag."""

SD_WINDING, SD_BODY, SD_OF_SEVERAL = 0.2, 0.35, 0.9
"""Prior standard deviations of the logarithm: of the winding, of one body, and of each of several,
whose sum alone is known."""

Capacity = tuple[float, float, str]
"""Centre [J/K], standard deviation of the logarithm, basis in words."""


@dataclass(frozen=True)
class Masses:
    """What a motor file says of the masses of a machine.

    Attributes:
        whole: Mass of the machine [kg], or None if not known.
        conductor: Mass of the conductor [kg], or None.
        coefficient: B of its R(T) [degC].
    """

    whole: float | None = None
    conductor: float | None = None
    coefficient: float = 234.5

    def capacities(self, copper: str, others: Sequence[str]) -> dict[str, Capacity]:
        """Return what is known of the capacities of a network's nodes.

        One node alone stands for no mass: how much of the machine follows depends on the test.

        Args:
            copper: Node of the winding.
            others: The other nodes.
        """
        known: dict[str, Capacity] = {}
        if not others:
            return known
        specific = ALUMINIUM if self.coefficient < BELOW_degC else COPPER
        if self.conductor is not None:
            words = f"{rounded(self.conductor)} kg of conductor at {specific:g} J/(kg K), insulated"
            known[copper] = (INSULATION * specific * self.conductor, SD_WINDING, words)
        if self.whole is not None:
            body = self.whole - (self.conductor or 0.0)
            centre = TAKING_PART * BODY * body / len(others)
            sd = SD_BODY if len(others) == 1 else SD_OF_SEVERAL
            words = f"{rounded(body)} kg at {BODY:g} J/(kg K), of which most follows the winding"
            known |= dict.fromkeys(others, (centre, sd, words))
        return known
