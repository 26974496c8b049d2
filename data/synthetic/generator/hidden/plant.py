"""The machine with everything that a two-node network leaves out, in plain floats.

Two nodes and up to one body beside each, integrated by the classical Runge-Kutta method in steps
of one second on inputs that are given every half second. Small imperfections are always on: iron
loss falls a little as the core warms, the surface sheds heat a little better when hot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..machine import Machine

Array = NDArray[np.float64]

HALF_S = 0.5
"""Spacing of the inputs and of the record [s]."""

IRON_FALL = 2.5e-4
"""Relative fall of the iron loss per kelvin above 60 degC [1/K]: resistivity of the sheets."""

SURFACE_RISE = 2.0e-4
"""Relative rise of the surface's conductance per kelvin above a rise of 40 K [1/K]."""


@dataclass
class Plant:
    """What a cause changes; the defaults are a machine without any.

    Attributes:
        machine: The base machine.
        true_resistance: True phase resistance over that of the motor file [1].
        true_coefficient: True B of the winding [degC].
        ac: Extra copper loss over DC at each half second, at 60 degC [1]; None for none.
        winding_share: Share of the iron loss that warms the winding first [1].
        outside: Share of the other losses at each half second that never heats the stator [1].
        extra_stator: Heat added to the stator at each half second [W].
        extra_winding: Heat added to the winding at each half second [W].
        stator_heat: Heat added to the stator, of time [s], stator and sink [degC], in watts.
        conductance: Factor on the conductance to the sink at each half second [1].
        surface: Factor on that conductance, of stator and sink [degC].
        switch: Factor on it with a memory (a thermostat), of stator temperature and state.
        sink: Sink temperature at each half second [degC].
        recirculation: Rise of the sink per watt of losses [K/W].
        path: Factor on the resistance from winding to stator, of winding temperature and time.
        neighbour: Conductance [W/K] and capacity [J/K] of a body on the stator, and its own
            conductance to the sink [W/K].
        rotor: Share of the other losses [1], capacity [J/K], resistance to the stator [K/W].
        overhang: Share of the winding [1] and resistance to the slots [K/W].
    """

    machine: Machine
    true_resistance: float = 1.0
    true_coefficient: float = 234.5
    ac: Array | None = None
    winding_share: float = 0.0
    outside: Array | None = None
    extra_stator: Array | None = None
    extra_winding: Array | None = None
    stator_heat: Callable[[float, float, float], float] | None = None
    conductance: Array | None = None
    surface: Callable[[float, float], float] | None = None
    switch: Callable[[float, bool], tuple[float, bool]] | None = None
    sink: Array | None = None
    recirculation: float = 0.0
    path: Callable[[float, float], float] | None = None
    neighbour: tuple[float, float, float] | None = None
    rotor: tuple[float, float, float] | None = None
    overhang: tuple[float, float] | None = None
    notes: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Course:
    """What truly happened, every half second.

    Attributes:
        time_s: Times [s].
        winding_degC: Winding (its slots, where it is split).
        stator_degC: Stator.
        overhang_degC: Overhang; the winding where it is not split.
        copper_W: Copper loss with all its parts.
        other_W: Other losses with all their parts.
        nominal_other_W: Other losses as a map would state them.
        added_W: Heat that a cause adds to the stator from outside.
    """

    time_s: Array
    winding_degC: Array
    stator_degC: Array
    overhang_degC: Array
    copper_W: Array
    other_W: Array
    nominal_other_W: Array
    added_W: Array


def integrate(plant: Plant, current: Array, speed: Array, ambient: Array, start: float) -> Course:
    """Return the true course.

    Args:
        plant: Machine and causes.
        current: Phase current every half second, an odd number of values [A].
        speed: Speed [rpm].
        ambient: Ambient temperature [degC].
        start: Temperature of everything at the start [degC].
    """
    m = plant.machine
    k = m.copper_loss_per_kelvin(current) * plant.true_resistance
    span = (m.resistance_coefficient_degC + m.reference_temperature_degC) / (
        plant.true_coefficient + m.reference_temperature_degC
    )
    k = k * span
    nominal = m.other_loss(current, speed)
    zero = np.zeros(current.size)
    sink = ambient if plant.sink is None else plant.sink
    lists = [
        values.tolist()
        for values in (
            k, nominal, sink,
            zero if plant.ac is None else plant.ac,
            zero if plant.outside is None else plant.outside,
            zero if plant.extra_stator is None else plant.extra_stator,
            zero if plant.extra_winding is None else plant.extra_winding,
            zero + 1.0 if plant.conductance is None else plant.conductance,
        )
    ]  # fmt: skip
    rates = _rates(plant, lists)
    num = (current.size - 1) // 2
    h, on = 2.0 * HALF_S, False
    state = [start] * 4  # winding, stator, body or rotor, overhang
    course = np.empty((num + 1, 4))
    slopes = np.empty((num + 1, 4))
    for step in range(num):
        i = 2 * step
        factor = 1.0
        if plant.switch is not None:
            factor, on = plant.switch(state[1], on)
        k1 = rates(i, state, factor)
        k2 = rates(i + 1, [s + 0.5 * h * a for s, a in zip(state, k1, strict=True)], factor)
        k3 = rates(i + 1, [s + 0.5 * h * a for s, a in zip(state, k2, strict=True)], factor)
        k4 = rates(i + 2, [s + h * a for s, a in zip(state, k3, strict=True)], factor)
        course[step], slopes[step] = state, k1
        state = [
            s + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            for s, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)
        ]
    course[num], slopes[num] = state, rates(2 * num, state, 1.0)
    full = np.empty((current.size, 4))
    full[::2] = course
    # the cubic through both ends and both slopes, at the middle of the step
    full[1::2] = 0.5 * (course[:-1] + course[1:]) + h / 8.0 * (slopes[:-1] - slopes[1:])
    winding, stator = full[:, 0], full[:, 1]
    ac = zero if plant.ac is None else plant.ac
    end, part = (full[:, 3], plant.overhang[0]) if plant.overhang else (winding, 0.0)

    def copper(celsius: Array) -> Array:
        return k * (plant.true_coefficient + celsius) * (1.0 + _ac(ac, celsius))

    return Course(
        time_s=HALF_S * np.arange(current.size),
        winding_degC=winding,
        stator_degC=stator,
        overhang_degC=end,
        copper_W=(1.0 - part) * copper(winding) + part * copper(end),
        other_W=nominal * (1.0 - IRON_FALL * (stator - 60.0)),
        nominal_other_W=nominal,
        added_W=zero if plant.extra_stator is None else plant.extra_stator,
    )


def _ac(ac, winding):
    """Return the extra copper loss over DC: it falls as the copper gets more resistive."""
    return ac * ((234.5 + 60.0) / (234.5 + winding)) ** 2


def _rates(plant: Plant, lists: list[list[float]]):
    m = plant.machine
    k, nominal, sink, ac, outside, extra_stator, extra_winding, conductance = lists
    B, share = plant.true_coefficient, plant.winding_share
    G_w, G_sr = 1.0 / m.Req_w, 1.0 / m.Req_sr
    C_w, C_sr = m.Ceq_w, m.Ceq_sr
    body, rotor, overhang = plant.neighbour, plant.rotor, plant.overhang
    part = overhang[0] if overhang else 0.0

    def rates(i: int, state: list[float], factor: float) -> list[float]:
        winding, stator, beside, end = state
        copper = k[i] * (B + winding) * (1.0 + _ac(ac[i], winding))
        other = nominal[i] * (1.0 - IRON_FALL * (stator - 60.0))
        kept = other * (1.0 - outside[i])
        cold = sink[i] + plant.recirculation * (copper + other)
        G = G_sr * conductance[i] * factor * (1.0 + SURFACE_RISE * (stator - cold - 40.0))
        if plant.surface is not None:
            G *= plant.surface(stator, cold)
        resistance = 1.0 if plant.path is None else plant.path(winding, i * HALF_S)
        across = G_w / resistance * (winding - stator)
        into_winding = copper * (1.0 - part) + share * kept + extra_winding[i] - across
        into_stator = (1.0 - share) * kept + extra_stator[i] + across - G * (stator - cold)
        if plant.stator_heat is not None:
            into_stator += plant.stator_heat(i * HALF_S, stator, cold)
        beside_rate, end_rate = 0.0, 0.0
        if body is not None:
            flow = body[0] * (stator - beside)
            into_stator -= flow
            beside_rate = (flow - body[2] * (beside - cold)) / body[1]
        if rotor is not None:
            flow = (beside - stator) / rotor[2]
            into_stator += flow - rotor[0] * kept
            beside_rate = (rotor[0] * kept - flow) / rotor[1]
        if overhang is not None:
            flow = (end - winding) / overhang[1]
            heat = k[i] * (B + end) * (1.0 + _ac(ac[i], end)) * part
            into_winding += flow
            end_rate = (heat - flow) / (part * C_w)
        return [into_winding / ((1.0 - part) * C_w), into_stator / C_sr, beside_rate, end_rate]

    return rates
