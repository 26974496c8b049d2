"""What the scalars of a file mean, and whether they agree with the motor file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...motor import Motor
from ..record import Finding

MEANINGS: Mapping[str, str] = {
    "B": "B of the R(T) law [degC]",
    "Rrif": "3 times the phase resistance at Trif [ohm]",
    "Trif": "temperature that Rrif holds for [degC]",
    "Ceqw": "Ceq_w [J/K]",
    "Ceqsr": "Ceq_sr [J/K]",
    "Reqw": "Req_w [K/W]",
    "Reqsr": "Req_sr [K/W]",
    "Two": "winding temperature at the start [degC]",
    "Tso": "stator temperature at the start [degC]",
}
"""The scalars of the thesis' `prova.mat`."""

TOLERANCE = 0.01
"""Two statements of one resistance may differ by this share: more is no rounding any longer."""


def constant_notes(constants: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each scalar of a file.

    Args:
        constants: Name to value, in the file's unit.
    """
    return tuple(
        f"Constant of the file: {name} = {value:g}"
        + (f", {MEANINGS[name]}." if name in MEANINGS else ".")
        for name, value in constants.items()
    )


def resistance_conflict(
    constants: Mapping[str, float], motor: Motor | None, where: str
) -> tuple[Finding, ...]:
    """Return a finding if a file and the motor file give another phase resistance.

    Args:
        constants: Name to value; compared if `Rrif` and `Trif` are there.
        motor: The machine; its resistance is brought to the temperature `Trif`.
        where: The file.
    """
    if motor is None or motor.phase_resistance_ohm is None:
        return ()
    if "Rrif" not in constants or "Trif" not in constants:
        return ()
    in_file = constants["Rrif"] / 3.0
    ratio = float(motor.resistance_ratio(np.asarray(constants["Trif"])))
    expected = motor.phase_resistance_ohm * ratio
    if abs(in_file - expected) <= TOLERANCE * expected:
        return ()
    return (
        Finding(
            id="resistance_conflict",
            severity="warning",
            message=f"Rrif/3 is {in_file:.4g} ohm at {constants['Trif']:g} degC; the motor file "
            f"gives {expected:.4g} ohm there, which is used.",
            where=where,
            remedy="Check phase_resistance_ohm in [winding].",
            values={"file_ohm": in_file, "motor_ohm": expected},
        ),
    )
