"""The variables of `prova.mat`, under the names of the thesis and in its shapes.

Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di
    Torino, 2023, sections 4.3 to 4.5 and figure 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..model.bodies import own_name
from ..record.motor import Motor
from ..record.record import Record
from ..simulation import SCALARS

UNITS: Mapping[str, str] = {
    "B": "degC",
    "Ceqsr": "J/K",
    "Ceqw": "J/K",
    "Is": "A",
    "Pd": "W",
    "Reqsr": "K/W",
    "Reqw": "K/W",
    "Rrif": "ohm",
    "Te": "degC",
    "Trif": "degC",
    "Tso": "degC",
    "Two": "degC",
    "Tw_m": "degC",
    "t": "s",
}
"""Every variable of the file with its unit, in the order of the thesis."""


@dataclass(frozen=True)
class Shaft:
    """What the shaft does at the samples, where a correction needs it."""

    speed_rpm: np.ndarray | None = None  # Speed [rpm], shape (time,).
    power_W: np.ndarray | None = None  # Mechanical power [W], shape (time,).


@dataclass(frozen=True)
class Corrections:
    """Errors of instruments that a run allows for and `prova.mat` has no variables for."""

    current_gain: float = 0.0  # Relative correction of the current [1].
    power_gain: float = 0.0  # Relative correction of the losses [1].
    torque_offset: float = 0.0  # Correction of the torque [N m].
    ambient_offset: float = 0.0  # Correction of the sink temperature [K].
    sensor_gain: float = 0.0  # Relative error of the measured rise [1].
    sensor_offset: float = 0.0  # Offset of the winding sensor [K].
    # How much later the load comes than its samples, joined by straight lines, say [s].
    load_timing: float = 0.0
    shaft_power_gain: float = 0.0  # Relative correction of the mechanical power [1].
    shaft_power_offset: float = 0.0  # Correction of the mechanical power [W].
    second_sink_offset: float = 0.0  # Correction of the temperature of a second sink [K].

    @classmethod
    def of(cls, values: Mapping[str, float]) -> Corrections:
        """Return the corrections among values by parameter name."""
        names = cls.__dataclass_fields__
        own = {name: values[own_name(name)] for name in names if own_name(name) in values}
        return cls(**{name: values[name] for name in names if name in values} | own)

    @property
    def needs_shaft_power(self) -> bool:
        """Whether the mechanical power is corrected."""
        return self.shaft_power_gain != 0.0 or self.shaft_power_offset != 0.0

    def applied(self, variables: Mapping[str, np.ndarray], shaft: Shaft) -> dict[str, np.ndarray]:
        """Return the variables with current, losses, sink and timing as the run has them.

        `Tw_m` stays the reading: it drives nothing, and an offset would take the rounding away
        by which its noise is judged.

        Args:
            variables: From `thesis_variables`.
            shaft: Speed and power at the samples.
        """
        sink = variables["Te"] + self.ambient_offset
        current = (1.0 + self.current_gain) * variables["Is"]
        losses = (1.0 + self.power_gain) * variables["Pd"]
        if self.torque_offset and shaft.speed_rpm is not None:
            losses = losses - self.torque_offset * shaft.speed_rpm[:, None] * (np.pi / 30.0)
        if self.needs_shaft_power and shaft.power_W is not None:
            missing = self.shaft_power_gain * shaft.power_W + self.shaft_power_offset
            losses = losses - missing[:, None]
        time = variables["t"]
        if not self.load_timing:
            return {**variables, "Is": current, "Pd": losses, "Te": sink}
        current = np.sqrt(self.later(time, current**2))  # its square is what heats
        later = {"Pd": self.later(time, losses), "Te": self.later(time, sink)}
        return {**variables, "Is": current, **later}

    def words(self) -> str:
        """Return the corrections of what drives a network, in words."""
        units = {"current_gain": "", "power_gain": "", "torque_offset": " N m",
                 "ambient_offset": " K", "load_timing": " s", "shaft_power_gain": "",
                 "shaft_power_offset": " W", "second_sink_offset": " K"}  # fmt: skip
        given = {name: getattr(self, name) for name in units}
        return ", ".join(f"{n} = {v:.3g}{units[n]}" for n, v in given.items() if v) or "by nothing"

    def later(self, time: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return a signal as much later as the load is, shape (time, 1).

        Args:
            time: Time of the samples [s], shape (time, 1).
            values: Signal at the samples, shape (time, 1).
        """
        at = time.ravel()
        return np.interp(at - self.load_timing, at, values.ravel())[:, None]


def thesis_variables(
    record: Record, values: Mapping[str, float], motor: Motor, network: str
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the variables of `prova.mat` and sentences on what is in them.

    Args:
        record: The test, which `heatrun.record.reduction.reduce` accepts; its own samples are used.
        values: Parameters by name; `Rs0` may be missing in the first order, which has no use
            for it.
        motor: Phases, material and reference temperature of the winding, and the sink.
        network: `"first"` or `"second"`; the first order has no `Ceqsr`, `Reqsr` and `Tso`.

    Returns:
        Float64 columns of shape (time, 1) and scalars of shape (1, 1), sorted as in the thesis;
        and notes. NaN stands in `Tw_m` where nothing was read, and nowhere else.

    Raises:
        InputError: If the losses come from a map, whose Pol is no Pd.
    """
    if motor.losses == "map":
        raise InputError(
            "Pd in prova.mat is the measured total of the losses, electrical in minus mechanical "
            'out; this motor has losses = "map", the other losses alone.',
            where=motor.path or motor.name,
            remedy="Map a measured balance, or simulate with `heatrun simulate`.",
        )
    notes: list[str] = []
    sink = f"{motor.sink}_degC"
    columns = {
        "Is": bridged(record, "phase_current_A", notes, power=2),
        "Pd": bridged(record, "losses_W", notes),
        "Te": bridged(record, sink, notes),
        "Tw_m": record["winding_degC"],
        "t": record.time_s,
    }
    unread = int(np.sum(~np.isfinite(record["winding_degC"])))
    if unread:
        notes.append(f"Tw_m is NaN at {unread} samples without a reading.")
    if motor.sink != "ambient":
        notes.append(f"Te holds {sink}, the sink of this motor.")
    scalars = {name: values[parameter] for name, parameter in SCALARS[network].items()}
    scalars["B"] = motor.resistance_coefficient_degC
    scalars["Trif"] = motor.reference_temperature_degC
    resistance = values.get("Rs0", motor.phase_resistance_ohm)
    if resistance is None:
        notes.append("Rrif is left out: the phase resistance is not known, and not needed here.")
    else:
        scalars["Rrif"] = motor.phases * resistance
    if motor.phases != 3 and resistance is not None:
        notes.append(f"Rrif is {motor.phases} times the phase resistance: {motor.phases} phases.")
    variables = {name: np.asarray(value, float)[:, None] for name, value in columns.items()}
    variables |= {name: np.full((1, 1), float(value)) for name, value in scalars.items()}
    return {name: variables[name] for name in UNITS if name in variables}, tuple(notes)


def bridged(record: Record, channel: str, notes: list[str], power: int = 1) -> np.ndarray:
    """Return a channel without gaps, bridged as the reduction to blocks bridges them.

    There the straight line is drawn through the square of the current, since that is what heats.

    Args:
        record: The test.
        channel: Name of the channel.
        notes: Gets a sentence where something was bridged.
        power: Power of the values through which the line is straight [1].
    """
    values = record[channel]
    is_read = np.isfinite(values)
    if np.all(is_read):
        return values
    line = np.interp(record.time_s, record.time_s[is_read], values[is_read] ** power)
    notes.append(
        f"{int(np.sum(~is_read))} missing samples of {channel} were interpolated linearly"
        f"{' in its square' if power == 2 else ''}, as in the run."
    )
    return np.where(is_read, values, line ** (1.0 / power))
