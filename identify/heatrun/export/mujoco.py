"""A run as the DC motor of MuJoCo, whose winding is one body that its current heats.

Reference: MuJoCo XML reference, actuator/dcmotor, attribute `thermal`; MuJoCo DC Motor Model
    (mujoco.readthedocs.io, dcmotor.pdf). Tried with MuJoCo 4.0.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from ..errors import UsageError
from ..io.whole_files import numbered
from .c_file import filled_template, in_comment
from .simpler import TestedRun, figures

FILE = "motor.xml"


def export_mujoco(
    run: Path,
    *,
    folder: Path | None = None,
    network: str | None = None,
    motor_constant: float | None = None,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Write a model of MuJoCo with the motor as its actuator.

    Args:
        run: The run folder.
        folder: Where the file goes; None for a folder `mujoco` in the run, numbered where that
            holds another export.
        network: Name of the network; None for the last one of the run.
        motor_constant: Torque per rms ampere [N m/A]; None for 1, which is said.
        is_replacing: Whether another export in `folder` is replaced.

    Returns:
        As plain data: the files, network (`order`, `title`), attributes of the actuator, its
        distance from the model (`bias`), notes and findings.

    Raises:
        InputError: As `TestedRun.read` and `write_export`.
        UsageError: If the motor constant is not above 0.
    """
    if motor_constant is not None and not 0.0 < motor_constant < math.inf:
        raise UsageError(f"expected --motor-constant above 0 N m/A, got {motor_constant:g}")
    read = TestedRun.read(run, network)
    body = read.simpler("first", is_fed=True, cold=1.0)
    motor, bias = read.run.motor, body.bias()
    (_, R, R_95, _), (_, C, C_95, _), _ = figures(body)
    alpha = 1.0 / (motor.resistance_coefficient_degC + motor.reference_temperature_degC)
    thermal = [R, C, 0.0, alpha, body.degC, read.seen.sink_degC]
    attributes = {
        "motorconst": motor_constant or 1.0,
        "resistance": motor.phases * body.ohm,
        "thermal": thermal,
    }
    notes = []
    if motor_constant is None:
        notes.append("motorconst is 1 N m/A, a placeholder: no thermal test tells it. Pass "
                     "--motor-constant.")  # fmt: skip
    text = filled_template("motor.xml", {
        "model": quoteattr(in_comment(motor.name)),
        "source": quoteattr(f"run {in_comment(read.run.path.resolve().name)}, SHA-256 of fit.json "
                            f"{read.run.manifest['files']['fit.json']}"),
        "phases": str(motor.phases),
        "R_low": f"{R_95[0]:.4g}", "R_high": f"{R_95[1]:.4g}",
        "C_low": f"{C_95[0]:.4g}", "C_high": f"{C_95[1]:.4g}",
        "rms": f"{bias['rms_K']:.1f}",
        "colder": f"{bias['colder_at_most_K']:.1f}",
        "warmer": f"{bias['warmer_at_most_K']:.1f}",
        "placeholder": "" if motor_constant else ", here a placeholder: no thermal test tells it",
        "motor_constant": repr(float(attributes["motorconst"])),
        "ohm": repr(float(attributes["resistance"])),
        "thermal": " ".join(f"{value:.9g}" for value in thermal),
    })  # fmt: skip
    places = [folder] if folder else numbered(run / "mujoco")
    written = read.write(places, {FILE: text.encode("ascii")}, is_replacing=is_replacing)
    return {**written, "attributes": attributes, "bias": bias, "notes": notes}
