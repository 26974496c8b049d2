"""Energy, power and efficiency of a machine by how hard it worked: ranges of its shaft power."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from heatrun.bench.checks.samples import samples
from heatrun.bench.record import Record
from heatrun.motor import Motor

from .drive import electrical_power, has, with_powers
from .integrate import bridged_steps, integrate

NO_LOAD = 0.02
"""Share of the largest shaft power below which the machine delivers nothing [1]: the zero of a
torque transducer."""

SHARES = (NO_LOAD, 0.25, 0.5, 0.75, 1.0)
"""Ends of the ranges over the largest shaft power [1]; quarters, as the load points of IEC
60034-2-1."""


@dataclass(frozen=True)
class OperatingRange:
    """What a machine did while its shaft power lay in a range.

    Attributes:
        name: Of the range.
        duration_s: How long [s].
        drawn_W: Mean electrical power [W], negative where it was fed back.
        peak_W: The electrical power of the largest magnitude [W].
        shaft_W: Mean shaft power [W].
        efficiency: Output over input energy [1]; None without load.
    """

    name: str
    duration_s: float
    drawn_W: float
    peak_W: float
    shaft_W: float
    efficiency: float | None


@dataclass(frozen=True)
class ShaftEnergy:
    """Energy at the shaft, and what became of it.

    Attributes:
        largest_W: Largest magnitude of the shaft power, which ranges are shares of [W].
        out_J: Delivered as a motor [J].
        in_J: Taken as a generator [J].
        efficiency_motor: Of the time as a motor [1]; None if there was none.
        efficiency_generator: Of the time as a generator [1]; None likewise.
        ranges: From generator to the largest shaft power; those that were never met left out.
    """

    largest_W: float
    out_J: float
    in_J: float
    efficiency_motor: float | None
    efficiency_generator: float | None
    ranges: tuple[OperatingRange, ...]


def shaft_energy(record: Record, motor: Motor) -> ShaftEnergy | None:
    """Return energies and efficiencies at the shaft; None where its power was not measured.

    Energies are summed over a range before they are divided, by trapezoids over the record's own
    time axis, gaps left out.

    Args:
        record: With electrical power.
        motor: Gives the number of phases.

    Raises:
        InputError: If no electrical power was recorded.
    """
    full = with_powers(record, motor)
    power = electrical_power(record, motor)
    if not has(full, "mechanical_power_W"):
        return None
    made = Record(record.name, {**full.channels, "power": power.values})
    time_s, drawn, shaft = samples(made, "power", "mechanical_power_W")
    if time_s.size < 2:
        return None
    steps = bridged_steps(time_s)
    weight = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    whole, largest = integrate(time_s, shaft), float(np.max(np.abs(shaft)))
    share = shaft / largest if largest > 0.0 else shaft
    spans = [("as a generator", share < -NO_LOAD), ("no load", np.abs(share) <= NO_LOAD)]
    spans += [
        (f"{100 * low:.0f} … {100 * high:.0f} %", (share > low) & (share <= high))
        for low, high in pairwise(SHARES)
    ]

    def of_range(name: str, inside: np.ndarray) -> OperatingRange:
        part = weight * inside
        efficiency = _ratio(drawn, shaft, part) if name == "as a generator" else None
        if name not in ("as a generator", "no load"):
            efficiency = _ratio(shaft, drawn, part)
        return OperatingRange(
            name,
            float(np.sum(part)),
            float(part @ drawn / np.sum(part)),
            float(drawn[inside][np.argmax(np.abs(drawn[inside]))]),
            float(part @ shaft / np.sum(part)),
            efficiency,
        )

    return ShaftEnergy(
        largest,
        whole.positive,
        -whole.negative,
        _ratio(shaft, drawn, weight * ((drawn > 0.0) & (shaft > 0.0))),
        _ratio(drawn, shaft, weight * ((drawn < 0.0) & (shaft < 0.0))),
        tuple(of_range(name, span) for name, span in spans if np.sum(weight * span) > 0.0),
    )


def _ratio(output: np.ndarray, given: np.ndarray, weight: np.ndarray) -> float | None:
    """Return an energy over another that was given for it [1]; None where they differ in sign."""
    out_J, given_J = float(np.sum(output * weight)), float(np.sum(given * weight))
    return out_J / given_J if out_J * given_J > 0.0 else None
