r"""The worksheet behind a published calibration: from measured losses to equivalent DC quantities.

The estimator that the sheet feeds was made for DC tests. The losses of an AC test are therefore
written as the current and the voltage that would put the same power into a fictitious winding,
$R_{eq} = R_{o,rif}\,(B + T_w)/(B + T_{o,rif})$, once for the total $P$ and once for its copper
part $P_{js}$:

$$ I_{eq} = \sqrt{P / R_{eq}}, \qquad V_{eq} = \sqrt{P\,R_{eq}} $$

The copper part is $P_{js} = 3 I_s^2 R_s$ with $R_s = R_{s0}\,(B + T_w)/(B + T_{ref})$, the rest is
$P_{ol} = P - P_{js}$. In the first row the sheet puts the mean ambient temperature in the place of
the sensor's reading ("Tw mod"): the test starts cold, whatever the sensor says.

Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di Torino,
2022/2023, Figure 7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

PHASES = 3  # the sheet is written for a three-phase winding: Pjs = 3 Is^2 Rs


@dataclass(frozen=True)
class WorksheetConstants:
    """The head of the worksheet.

    Attributes:
        ambient_mean_degC: Mean ambient temperature of the test, "Tamb med" [degC].
        phase_resistance_ohm: Phase resistance at its reference temperature, "Rs" [ohm].
        phase_reference_degC: Temperature that the phase resistance holds for, "Ts" [degC].
        equivalent_resistance_ohm: Resistance of the fictitious DC winding, "Ro rif" [ohm].
        equivalent_reference_degC: Temperature that it holds for, "To rif" [degC].
        resistance_coefficient_degC: B of R(T) = R (B + T)/(B + Tref) [degC]; 234.5 is copper.
    """

    ambient_mean_degC: float
    phase_resistance_ohm: float
    phase_reference_degC: float = 25.0
    equivalent_resistance_ohm: float = 1.0
    equivalent_reference_degC: float = 20.0
    resistance_coefficient_degC: float = 234.5

    def __post_init__(self) -> None:
        coefficient = self.resistance_coefficient_degC
        for name in ("phase_resistance_ohm", "equivalent_resistance_ohm"):
            if not 0.0 < (value := getattr(self, name)) < math.inf:
                raise InputError(
                    f"Expected a finite resistance above 0 ohm, got {value} ohm.",
                    where=name,
                    remedy="Give the resistance of the winding in ohm.",
                )
        for name in ("ambient_mean_degC", "phase_reference_degC", "equivalent_reference_degC"):
            if not -coefficient < (value := getattr(self, name)) < math.inf:
                raise InputError(
                    f"Expected a finite temperature above {-coefficient} degC, where the law of "
                    f"the resistance ends, got {value} degC.",
                    where=name,
                    remedy="Give the temperature in degC.",
                )


@dataclass(frozen=True)
class Worksheet:
    """The computed columns of the sheet, each of shape (time,).

    Attributes:
        winding_used_degC: Winding temperature that the row is computed with [degC].
        equivalent_resistance_ohm: "Req DC", resistance of the fictitious winding [ohm].
        total_current_A: "Ieq DC" of the total losses [A].
        total_voltage_V: "Veq DC" of the total losses [V].
        phase_resistance_ohm: "Rs", phase resistance at the winding temperature [ohm].
        copper_loss_W: "Pjs", Joule losses of the stator winding [W].
        other_loss_W: "Pol", all other losses [W]; negative where the copper losses that belong
            to the measured current exceed the measured total.
        copper_current_A: "Ieq DC" of the copper losses [A].
        copper_voltage_V: "Veq DC" of the copper losses [V].
    """

    winding_used_degC: NDArray[np.float64]
    equivalent_resistance_ohm: NDArray[np.float64]
    total_current_A: NDArray[np.float64]
    total_voltage_V: NDArray[np.float64]
    phase_resistance_ohm: NDArray[np.float64]
    copper_loss_W: NDArray[np.float64]
    other_loss_W: NDArray[np.float64]
    copper_current_A: NDArray[np.float64]
    copper_voltage_V: NDArray[np.float64]


def fill_worksheet(
    constants: WorksheetConstants,
    winding_degC: ArrayLike,
    losses_W: ArrayLike,
    phase_current_A: ArrayLike,
    *,
    cold_start: bool = True,
) -> Worksheet:
    """Return the computed columns of the worksheet.

    Args:
        constants: Head of the sheet.
        winding_degC: Measured winding temperature, "Tw" [degC], shape (time,).
        losses_W: Measured total losses, "P": electrical in minus mechanical out [W], shape (time,).
        phase_current_A: Phase current, rms, "Is" [A], shape (time,).
        cold_start: The first row is computed with the mean ambient temperature instead of the
            sensor's reading, as the published sheet does.

    Returns:
        The columns, as many rows as came in.

    Raises:
        InputError: If the columns differ in length, are empty or hold a value that is not finite,
            a winding below the end of the resistance law, or losses below zero, which no current
            could make.

    Example:
        >>> head = WorksheetConstants(ambient_mean_degC=19.3577, phase_resistance_ohm=0.0062)
        >>> sheet = fill_worksheet(head, [22.0, 22.0], [521.843, 517.107], [74.18, 74.18])
        >>> round(float(sheet.equivalent_resistance_ohm[1]), 9)
        1.007858546
    """
    winding, losses, current = _columns(winding_degC, losses_W, phase_current_A)
    if cold_start:
        winding = np.concatenate([[constants.ambient_mean_degC], winding[1:]])
    coefficient = constants.resistance_coefficient_degC
    _refuse(winding <= -coefficient, winding, f"a winding above {-coefficient} degC", "degC", "Tw")
    _refuse(losses < 0.0, losses, "losses of 0 W or more", "W", "P")

    equivalent_resistance = constants.equivalent_resistance_ohm * (
        (coefficient + winding) / (coefficient + constants.equivalent_reference_degC)
    )
    phase_resistance = constants.phase_resistance_ohm * (
        (coefficient + winding) / (coefficient + constants.phase_reference_degC)
    )
    copper_loss = PHASES * current**2 * phase_resistance
    return Worksheet(
        winding_used_degC=winding,
        equivalent_resistance_ohm=equivalent_resistance,
        total_current_A=np.sqrt(losses / equivalent_resistance),
        total_voltage_V=np.sqrt(losses * equivalent_resistance),
        phase_resistance_ohm=phase_resistance,
        copper_loss_W=copper_loss,
        other_loss_W=losses - copper_loss,
        copper_current_A=np.sqrt(copper_loss / equivalent_resistance),
        copper_voltage_V=np.sqrt(copper_loss * equivalent_resistance),
    )


def _columns(
    winding_degC: ArrayLike, losses_W: ArrayLike, phase_current_A: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    winding, losses, current = (
        np.asarray(column, dtype=np.float64) for column in (winding_degC, losses_W, phase_current_A)
    )
    if winding.ndim != 1 or winding.size == 0 or not winding.shape == losses.shape == current.shape:
        raise InputError(
            "Expected three columns of one length, got Tw "
            f"{winding.shape}, P {losses.shape} and Is {current.shape}.",
            where="worksheet",
            remedy="Cut the columns to the same samples.",
        )
    for name, column, unit in (("Tw", winding, "degC"), ("P", losses, "W"), ("Is", current, "A")):
        _refuse(~np.isfinite(column), column, "a number", unit, name)
    return winding, losses, current


def _refuse(
    is_bad: NDArray[np.bool_], column: NDArray[np.float64], expected: str, unit: str, name: str
) -> None:
    if is_bad.any():
        first = int(np.argmax(is_bad))
        raise InputError(
            f"Expected {expected}, got {column[first]:g} {unit} "
            f"({int(is_bad.sum())} of {column.size} rows).",
            where=f"worksheet, column {name}, data row {first + 1}",
            remedy="Leave these rows out, or average the record into longer blocks first.",
        )
