"""What can be hidden: one function per cause, which sets it up at an amplitude.

An amplitude of 1 is a strong but plausible case; the study scales it. The laws differ from the
catalogue's on purpose: other exponents, thresholds, extra lags.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .plant import HALF_S, Array, Course, Plant


@dataclass
class Load:
    """The inputs of one test, every half second; a cause may read them.

    Attributes:
        index: Place of the test among all.
        time_s: Times [s].
        current: Phase current [A].
        speed: Speed [rpm].
        ambient: Ambient temperature [degC].
        coolant: Coolant temperature [degC], or None.
        fan: Fan in parts of its full speed [1], or None.
        event_test: Place of the test that an event happens in.
    """

    index: int
    time_s: Array
    current: Array
    speed: Array
    ambient: Array
    coolant: Array | None = None
    fan: Array | None = None
    event_test: int = 0


Cause = Callable[[Plant, Load, float, np.random.Generator], None]
Reading = Callable[[Course, Load, float, Array], Array]


def lagged(values: Array, time_s: float) -> Array:
    """Return a series behind a first-order lag."""
    decay = float(np.exp(-HALF_S / time_s))
    out, state = np.empty_like(values), float(values[0])
    for i, value in enumerate(values.tolist()):
        state = decay * state + (1.0 - decay) * value
        out[i] = state
    return out


def _ratio(plant: Plant, load: Load) -> Array:
    return np.abs(load.speed) / plant.machine.rated_speed_rpm


def _losses(plant: Plant) -> float:
    """Return the other losses at rated load [W], the yardstick of added heat."""
    m = plant.machine
    return float(m.hysteresis_W + m.eddy_W + m.stray_W)


def radiation(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Grey body, view factor 0.9; the walls follow a tenth of the stator's rise."""
    area = a * 0.6 / plant.machine.Req_sr / 8.6

    def heat(_: float, stator: float, sink: float) -> float:
        wall = sink + 0.1 * (stator - sink)
        return -0.9 * 5.67e-8 * area * ((stator + 273.15) ** 4 - (wall + 273.15) ** 4)

    plant.stator_heat = heat


def natural_convection(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Exponent 0.3 above a difference of 5 K, nothing below."""
    share = min(a, 1.0)

    def surface(stator: float, sink: float) -> float:
        return 1.0 - share + share * (max(abs(stator - sink), 5.0) / 40.0) ** 0.3

    plant.surface = surface


def speed_cooling(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Exponent drawn around 0.75; the air follows the speed within 8 s."""
    exponent = rng.uniform(0.65, 0.85)
    plant.conductance = 1.0 + 1.5 * a * lagged(_ratio(plant, load) ** exponent, 8.0)


def fan_cooling(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The gain saturates a little at full fan."""
    assert load.fan is not None
    plant.conductance = 1.0 + 1.2 * a * lagged(load.fan**0.85, 5.0)


def cooling_step(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """A change within two minutes, in one test alone."""
    moment = rng.uniform(0.3, 0.7) * load.time_s[-1]
    if load.index == load.event_test:
        ramp = np.clip((load.time_s - moment) / 120.0, 0.0, 1.0)
        plant.conductance = 1.0 + 0.8 * a * ramp


def coolant_sink(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The sink lies between air and coolant, half a minute behind the latter."""
    assert load.coolant is not None
    share = min(a, 1.0)
    plant.sink = (1.0 - share) * load.ambient + share * lagged(load.coolant, 30.0)


def ambient_drift(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The true sink drifts, a little faster at first."""
    hours = load.time_s / 3600.0
    plant.sink = load.ambient + 5.0 * a * (hours - 0.04 * hours**2)


def ambient_recirculation(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Own warm air comes back at once."""
    plant.recirculation = 0.3 * a * plant.machine.Req_sr


def neighbour_body(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """A flange with a little loss of its own to the air."""
    conductance = 0.5 * a / plant.machine.Req_sr
    plant.neighbour = (
        conductance, 0.8 * plant.machine.Ceq_sr, 0.03 / plant.machine.Req_sr
    )  # fmt: skip


def rotor_node(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The rotor takes its share of the losses and hands it on."""
    share = min(0.35 * a, 0.6)
    plant.rotor = (share, 0.25 * plant.machine.Ceq_sr, 2.5 * plant.machine.Req_sr)


def end_winding_node(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Half of the winding hangs over; the sensor sits in it."""
    plant.overhang = (0.45, 0.5 * a * plant.machine.Req_w)


def ac_copper_loss(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Exponent 1.9, falling with the square of the resistivity."""
    plant.ac = 1.0 * a * _ratio(plant, load) ** 1.9


def iron_loss_in_winding(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Part of the losses in the teeth reaches the winding first."""
    plant.winding_share = min(0.4 * a, 0.6)


def external_loss(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Mechanical loss that stays in the bearings and the coupling."""
    plant.outside = np.minimum(0.35 * a * _ratio(plant, load) ** 1.2, 0.6)


def bearing_friction(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """After Petroff: viscosity falls with temperature, friction a little less than with speed."""
    strength = 0.25 * a * _losses(plant)
    ratio = (_ratio(plant, load) ** 0.95).tolist()

    def heat(time_s: float, stator: float, sink: float) -> float:
        return strength * ratio[round(time_s / HALF_S)] * float(np.exp(-0.028 * (stator - sink)))

    plant.stator_heat = heat


def stray_load_loss(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Exponent 1.6 of the speed."""
    ratio = load.current / plant.machine.rated_current_A
    plant.extra_stator = 0.4 * a * _losses(plant) * ratio**2 * _ratio(plant, load) ** 1.6


def standby_loss(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The inverter switches all the time."""
    plant.extra_stator = np.full(load.time_s.size, 0.15 * a * _losses(plant))


def insulation_conductivity(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Conductivity that levels off when hot."""
    plant.path = lambda winding, time_s: 1.0 / (1.0 + 0.006 * a * (winding - 60.0)
                                                / (1.0 + 0.001 * abs(winding - 60.0)))  # fmt: skip


def contact_drift(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The contact gets worse and levels off over hours."""
    plant.path = lambda winding, time_s: 1.0 + 0.3 * a * (1.0 - float(np.exp(-time_s / 9000.0)))


def copper_coefficient(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Another material than the motor file says."""
    plant.true_coefficient = 234.5 + 14.0 * a


def winding_resistance(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """A gross error of the motor file: up to three halves."""
    plant.true_resistance = 1.0 + 0.5 * a


def loss_gain(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """The loss channel is off by a factor."""
    plant.notes["loss_gain"] = 0.1 * a


def _mean_winding(course: Course) -> Array:
    return course.winding_degC


def sensor_lag(course: Course, load: Load, a: float, reading: Array) -> Array:
    """A potted sensor: its own lag and a short second one of the potting."""
    return lagged(lagged(reading, 40.0 * a), 3.0)


def sensor_contact(course: Course, load: Load, a: float, reading: Array) -> Array:
    """Between winding and stator, the latter felt with a little delay."""
    return (1.0 - 0.4 * a) * reading + 0.4 * a * lagged(course.stator_degC, 10.0)


def sensor_gain(course: Course, load: Load, a: float, reading: Array) -> Array:
    """Too much or too little of the rise."""
    return reading + 0.025 * a * (reading - load.ambient)


def sensor_pickup(course: Course, load: Load, a: float, reading: Array) -> Array:
    """A loop of earth in the leads, through the filter of an input card."""
    return reading + 6.0 * a * lagged(load.current / np.max(load.current), 0.3)


def time_shift(course: Course, load: Load, a: float, reading: Array) -> Array:
    """Another logger's clock."""
    return np.interp(load.time_s - 50.0 * a, load.time_s, reading)


def heat_step(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Heat from outside for a spell, in one test."""
    begin = rng.uniform(0.25, 0.5)
    inside = (load.time_s > begin * load.time_s[-1]) & (
        load.time_s < (begin + rng.uniform(0.12, 0.25)) * load.time_s[-1]
    )
    if load.index == 0:
        plant.extra_stator = 0.4 * a * _losses(plant) * inside


def periodic_source(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """A neighbouring machine that runs in its own rhythm."""
    period, phase = rng.uniform(1500.0, 3000.0), rng.uniform(0.0, 6.28)
    plant.extra_stator = (
        0.3
        * a
        * _losses(plant)
        * np.sin(2 * np.pi * load.time_s / period + phase + 2.0 * load.index)
    )


def thermostat(plant: Plant, load: Load, a: float, rng: np.random.Generator) -> None:
    """Cooling that switches on when the core is hot, with hysteresis, and is not recorded."""
    upper = plant.notes.get("switch_degC", 60.0)
    lower = upper - 8.0

    def switch(stator: float, on: bool) -> tuple[float, bool]:
        on = stator > lower if on else stator > upper
        return (1.0 + 1.5 * a if on else 1.0), on

    plant.switch = switch


def sensor_wander(course: Course, load: Load, a: float, reading: Array) -> Array:
    """A contact that comes and goes: slow waves of an irregular period."""
    t = load.time_s + 1700.0 * load.index
    wave = np.sin(2 * np.pi * t / 2300.0) + 0.7 * np.sin(2 * np.pi * t / 1430.0 + 1.0)
    return reading + 2.0 * a * wave


HEAT: dict[str, Cause] = {
    f.__name__: f
    for f in (
        radiation, natural_convection, speed_cooling, fan_cooling, cooling_step, coolant_sink,
        ambient_drift, ambient_recirculation, neighbour_body, rotor_node, end_winding_node,
        ac_copper_loss, iron_loss_in_winding, external_loss, bearing_friction, stray_load_loss,
        standby_loss, insulation_conductivity, contact_drift, copper_coefficient,
        winding_resistance, loss_gain,
    )
}  # fmt: skip
"""Causes in the machine, by the id of the catalogue's effect."""

SENSOR: dict[str, Reading] = {
    f.__name__: f for f in (sensor_lag, sensor_contact, sensor_gain, sensor_pickup, time_shift)
}
"""Causes in the reading."""

UNKNOWN_HEAT: dict[str, Cause] = {
    f"unknown:{f.__name__}": f for f in (heat_step, periodic_source, thermostat)
}
"""Causes in the machine that are in no catalogue."""

UNKNOWN_SENSOR: dict[str, Reading] = {"unknown:sensor_wander": sensor_wander}
"""Causes in the reading that are in no catalogue."""

FROM_A_MAP = ("bearing_friction", "stray_load_loss", "standby_loss")
"""Causes that a measured balance would hold: their losses come from a map."""
