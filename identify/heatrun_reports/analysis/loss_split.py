"""The losses of a record split into those of the winding and all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.bench.record import Record
from heatrun.errors import InputError
from heatrun.motor import Motor

from .drive import has


@dataclass(frozen=True)
class LossSplit:
    """Losses over the time of a record.

    Attributes:
        joule_W: P_Js of the winding [W], shape (time,).
        other_W: P_ol, iron, magnets, friction [W], shape (time,).
        formula: For the report.
    """

    joule_W: Float[np.ndarray, " time"]
    other_W: Float[np.ndarray, " time"]
    formula: str


def split_losses(record: Record, motor: Motor) -> LossSplit:
    r"""Split the losses by the measured winding temperature.

    $$ P_{Js} = m I_s^2 R_{s0} \frac{B + T_w}{B + T_{ref}}, \quad P_{ol} = P_d - P_{Js} $$

    Where the motor file calls the losses a map, they are P_ol already.

    Args:
        record: With `phase_current_A`, `losses_W` and `winding_degC`.
        motor: Gives the phase resistance and what the losses are.

    Raises:
        InputError: If a channel or the phase resistance is missing.
    """
    needed = ("phase_current_A", "losses_W", "winding_degC")
    missing = [channel for channel in needed if not has(record, channel)]
    if missing:
        raise InputError(
            f"The losses cannot be split without {' and '.join(missing)}.",
            where=record.name,
            remedy=f'Map it in the motor file: [columns] {missing[0]} = "name in the file [unit]".',
        )
    if motor.phase_resistance_ohm is None:
        raise InputError(
            "The losses cannot be split without the phase resistance.",
            where=motor.path or motor.name,
            remedy="Give [winding] phase_resistance_ohm.",
        )
    B, T_ref = motor.resistance_coefficient_degC, motor.reference_temperature_degC
    joule = motor.copper_loss_W(record["phase_current_A"], record["winding_degC"])
    formula = (
        f"P_Js = {motor.phases}·Is²·{motor.phase_resistance_ohm:g} Ω·({B:g} + Tw)/"
        f"({B:g} + {T_ref:g}), "
    )
    if motor.losses == "map":
        return LossSplit(joule, record["losses_W"], formula + "P_ol = losses_W, from a map")
    return LossSplit(joule, record["losses_W"] - joule, formula + "P_ol = Pd − P_Js")
