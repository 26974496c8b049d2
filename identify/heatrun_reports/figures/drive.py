"""Figures of the general and the energy report: courses over time, torque-speed plane."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heatrun.bench.checks.samples import samples
from heatrun.bench.record import Record
from heatrun.motor import Motor

from ..analysis.drive import electrical_power, has, with_powers
from ..analysis.integrate import bridged_steps
from ..analysis.operating_map import OperatingMap
from .plot import WIDTH_IN, finish, line, stacked, unit, wording

PANELS = (
    ("vehicle_speed_km_per_h",),
    ("speed_rpm",),
    ("torque_Nm",),
    ("dc_power_W", "electrical_power_W", "mechanical_power_W", "losses_W"),
    ("dc_voltage_V", "u_d_V", "u_q_V"),
    ("dc_current_A", "phase_current_A", "i_d_A", "i_q_A"),
    (
        "winding_degC", "stator_degC", "yoke_degC", "tooth_degC", "end_winding_degC",
        "housing_degC", "rotor_degC", "magnet_degC", "bearing_degC", "controller_degC",
        "coolant_degC", "coolant_out_degC", "ambient_degC",
    ),
    ("coolant_flow_L_per_min",),
    ("fan",),
)  # fmt: skip
"""Which channels share a panel, from drive to temperatures."""

QUANTITY = {
    "rpm": "speed", "N m": "torque", "W": "power", "V": "voltage", "A": "current",
    "°C": "temperature", "km/h": "road speed", "L/min": "coolant flow", "1": "fan",
}  # fmt: skip
"""What a panel shows, by the unit of its signals."""


def courses(record: Record, motor: Motor) -> Figure:
    """Return all signals of a record over time, like with like."""
    full = with_powers(record, motor)
    panels = [[c for c in names if has(full, c)] for names in PANELS]
    panels = [names for names in panels if names]
    figure, axes = stacked([1.9 if n[0].endswith("_degC") else 1.15 for n in panels])
    for axis, names in zip(axes, panels, strict=True):
        for number, name in enumerate(names):
            line(axis, *samples_or_nan(full, name), wording(name), number)
        symbol = unit(names[0])
        axis.set_ylabel(f"{QUANTITY[symbol]}\n[{symbol}]", fontsize=8)
    finish(axes)
    return figure


def energy_course(record: Record, motor: Motor) -> Figure:
    """Return power and energy drawn so far, with and without regeneration.

    Raises:
        InputError: If no electrical power was recorded.
    """
    power = electrical_power(record, motor)
    made = Record(record.name, {"time_s": record.time_s, "power": power.values})
    time_s, values = samples(made, "power")
    steps = bridged_steps(time_s)

    def so_far(course: np.ndarray) -> np.ndarray:
        means = 0.5 * (course[1:] + course[:-1])
        return np.concatenate(([0.0], np.cumsum(means * steps))) / 3600.0

    figure, (top, bottom) = stacked([1.5, 1.7])
    line(top, time_s, values / 1000.0, "electrical power")
    top.axhline(0.0, color="0.6", lw=0.6)
    top.set_ylabel("power [kW]", fontsize=8)
    line(bottom, time_s, so_far(values), "energy", 0)
    line(bottom, time_s, so_far(np.maximum(values, 0.0)), "without regeneration", 1)
    bottom.set_ylabel("energy so far [Wh]", fontsize=8)
    finish([top, bottom])
    return figure


def plane(record: Record, found: OperatingMap | None) -> Figure:
    """Return the torque-speed plane: operating points, and power and efficiency where known."""
    num_panels = 1 if found is None else 3
    figure = Figure(figsize=(WIDTH_IN, 2.7 if num_panels == 3 else 3.2), layout="constrained")
    panels = figure.subplots(1, num_panels, sharey=True, squeeze=False)[0]
    time_s, speed, torque = samples(record, "speed_rpm", "torque_Nm")
    order = np.linspace(0, time_s.size - 1, min(time_s.size, 4000)).astype(int)
    points = panels[0].scatter(
        speed[order], torque[order], c=time_s[order] / 60.0, s=3, cmap="viridis", rasterized=True
    )
    _colour_bar(figure, panels[0], points, "time [min]")
    panels[0].set_ylabel("torque [N m]", fontsize=8)
    panels[0].set_title("operating points", fontsize=8, loc="left")
    if found is not None:
        power = panels[1].pcolormesh(
            found.speed_rpm, found.torque_Nm, found.power_W / 1000.0, cmap="cividis"
        )
        _colour_bar(figure, panels[1], power, "mean power [kW]")
        panels[1].set_title("electrical power", fontsize=8, loc="left")
        share = panels[2].pcolormesh(
            found.speed_rpm, found.torque_Nm, 100.0 * found.efficiency, cmap="viridis",
            vmin=max(0.0, 100.0 * _low(found.efficiency)), vmax=100.0,
        )  # fmt: skip
        _colour_bar(figure, panels[2], share, "efficiency [%]")
        panels[2].set_title("efficiency", fontsize=8, loc="left")
    for axis in panels:
        axis.set_xlabel("speed [rpm]", fontsize=8)
    finish(list(panels), is_over_time=False)
    return figure


def samples_or_nan(record: Record, channel: str) -> tuple[np.ndarray, np.ndarray]:
    """Return time and values for drawing: what is no measurement is left out, gaps stay open."""
    time_s, values = samples(record, channel)
    gaps = np.flatnonzero(bridged_steps(time_s) == 0.0)
    middle = 0.5 * (time_s[gaps] + time_s[gaps + 1])
    return np.insert(time_s, gaps + 1, middle), np.insert(values, gaps + 1, np.nan)


def _low(efficiency: np.ndarray) -> float:
    known = efficiency[np.isfinite(efficiency)]
    return float(np.quantile(known, 0.1)) - 0.05 if known.size else 0.0


def _colour_bar(figure: Figure, axis: Axes, drawn, label: str) -> None:
    bar = figure.colorbar(drawn, ax=axis, location="bottom", shrink=0.9, pad=0.02)
    bar.set_label(label, fontsize=7)
    bar.ax.tick_params(labelsize=7)
