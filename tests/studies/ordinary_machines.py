"""Ordinary machines on ordinary benches, by code that knows nothing of the packages under test.

Six kinds at random, each with two to four imperfections at once at their usual sizes. Four nodes
(winding, stator with housing, rotor, neighbour) are integrated by RK4 in lanes: the machine beside
itself without each of its imperfections, so that the kelvins that each makes alone are known. The
same march, driven by what the bench reads, is fitted to it: what the true structure would predict.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.signal import lfilter

COIL = "dry transformer or coil"
STEP_S, FINE = 2.0, 8
"""Step of the march [s], and how many parts of it loads are held for: they change at any moment."""

BLOCK_S = 20.0
"""Means over which errors are counted [s], as the commands count them."""

NUM_PRIORS = 3
"""Fits of the true structure, each with priors about other figures."""

PER_KELVIN, STEFAN, KELVIN = 0.00393, 5.670374e-8, 273.15
"""Copper at 20 °C [1/K], Stefan and Boltzmann's constant [W/(m² K⁴)], 0 °C [K]."""

Range = tuple[float, float]
Physics = dict[str, Any]
"""Figures of a machine by name, numbers or one for each lane."""


class Kind(NamedTuple):
    kW: Range  # at the shaft; of a coil its losses
    efficiency: Range
    kg: Range  # at 1 kW, and the power of the kilowatts that it grows with
    losses: tuple[float, float, float, float]  # copper, iron, friction, rotor at rated load [1]
    rise_K: Range  # stator above its sink at rated load
    winding_K: Range  # winding above the stator likewise
    winding: Range  # share of the heat capacity
    rpm: tuple[float, ...]
    lag_s: Range
    always: tuple[str, ...]
    others: tuple[str, ...]
    on_rotor: Range = (0.0, 0.0)  # share of the surface, where the rotor is a body of its own


KINDS = {
    "enclosed induction motor": Kind(
        (0.75, 11.0), (0.78, 0.89), (14.0, 0.8), (0.48, 0.22, 0.10, 0.20), (35.0, 60.0),
        (8.0, 22.0), (0.06, 0.11), (950.0, 1440.0, 2900.0), (12.0, 40.0), ("fan",),
        ("lag", "rotor", "surface", "drift", "torque", "stray", "iron"),
    ),
    "water-jacketed PMSM": Kind(
        (20.0, 120.0), (0.93, 0.96), (1.9, 0.75), (0.60, 0.26, 0.07, 0.07), (15.0, 32.0),
        (14.0, 30.0), (0.07, 0.13), (4000.0, 6000.0, 9000.0), (5.0, 25.0), (),
        ("lag", "rotor", "drift", "torque", "stray", "iron"),
    ),
    "servo on a flange": Kind(
        (0.4, 5.0), (0.86, 0.92), (4.2, 0.75), (0.66, 0.20, 0.09, 0.05), (38.0, 65.0),
        (10.0, 28.0), (0.08, 0.14), (2000.0, 3000.0, 4500.0), (8.0, 30.0), ("neighbour",),
        ("lag", "rotor", "surface", "drift", "torque", "stray", "iron"),
    ),
    "hub motor": Kind(
        (0.25, 4.0), (0.82, 0.90), (5.0, 0.8), (0.62, 0.25, 0.08, 0.05), (32.0, 55.0),
        (8.0, 24.0), (0.09, 0.15), (300.0, 500.0, 900.0), (8.0, 30.0), ("fan",),
        ("lag", "rotor", "neighbour", "surface", "torque", "stray", "iron"), (0.6, 0.85),
    ),
    "drone outrunner": Kind(
        (0.3, 4.0), (0.80, 0.88), (0.45, 0.9), (0.62, 0.26, 0.08, 0.04), (25.0, 45.0),
        (12.0, 26.0), (0.16, 0.26), (5000.0, 7000.0, 9000.0), (5.0, 12.0), ("fan",),
        ("lag", "rotor", "neighbour", "torque", "stray", "iron"), (0.3, 0.6),
    ),
    COIL: Kind(
        (0.06, 0.8), (0.0, 0.0), (100.0, 1.0), (0.80, 0.20, 0.0, 0.0), (35.0, 55.0),
        (12.0, 30.0), (0.25, 0.42), (0.0,), (10.0, 40.0), (),
        ("lag", "surface", "drift", "neighbour", "stray"),
    ),
}  # fmt: skip

FREE = {
    "": ("C_w", "C_s", "G_ws", "G_rest"), "fan": ("G_fan",), "lag": ("lag_s",),
    "rotor": ("C_r", "G_sr", "rotor_W"), "surface": ("eA", "nat"), "drift": ("drift_K",),
    "torque": ("offset_Nm",), "neighbour": ("C_b", "G_sb", "G_ba"), "stray": ("stray_W",),
    "iron": ("iron_W",),
}  # fmt: skip
"""Figures that belong to an imperfection, and those of the network alone."""

NAMES = {
    "fan": {"speed_cooling"}, "lag": {"sensor_lag"}, "rotor": {"rotor_node"},
    "surface": {"radiation", "natural_convection"}, "drift": {"ambient_drift"},
    "neighbour": {"neighbour_body"}, "stray": {"stray_load_loss", "ac_copper_loss"},
    "iron": {"iron_loss_in_winding"}, "torque": {"shaft_power_offset", "torque_offset"},
}  # fmt: skip
"""Ids that say what is there. Twins are not in here: who cannot tell them apart names a set."""

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Machine:
    """A machine: its kind, figures, imperfections and rated load; `is_fed` at varied speed."""

    kind: str
    physics: Physics
    drawn: tuple[str, ...]
    rated: dict[str, float]
    is_fed: bool

    @property
    def is_coil(self) -> bool:
        return self.kind == COIL

    @property
    def phases(self) -> int:
        return 1 if self.is_coil else 3

    @property
    def present(self) -> tuple[str, ...]:
        """Its imperfections, the little natural convection too that nearly all have."""
        beside = () if "surface" in self.drawn or not self.physics["nat"] else ("surface",)
        return (*self.drawn, *beside)

    @property
    def rise_K(self) -> float:
        watts = sum(self.rated[f"{name}_W"] for name in ("copper", "iron", "friction", "rotor"))
        return 0.8 * watts * resistance(self.physics, 40.0, float(not self.is_coil), 0.0)

    def names(self, cause: str) -> set[str]:
        if cause == "rotor" and self.physics["phi"]:
            return {"rotor_node", "housing_node"}  # its shell stands between stator and air
        if cause == "stray" and self.is_coil:
            return {"winding_resistance"}  # at one frequency, eddies are resistance
        if cause == "surface" and not self.physics["eA"]:
            return {"natural_convection"}
        if cause == "torque":  # torque that reads too high hides heat; too low, it invents some
            hides = self.physics["offset_Nm"] > 0.0
            return NAMES[cause] | {"loss_gain", "bearing_friction" if hides else "external_loss"}
        return NAMES[cause]

    def instruments(self, cause: str) -> dict[str, float]:
        """Return parameters of instruments that say the same, with the sign that they then have."""
        if cause == "stray" and self.is_coil:
            return {"Rs0": 1.0, "current_gain": 1.0}
        sign = float(np.sign(self.physics["offset_Nm"])) if cause == "torque" else 0.0
        shaft = dict.fromkeys(("shaft_power_offset", "shaft_power_gain", "torque_offset"), -sign)
        return shaft | {"power_gain": sign} if sign else {}


def drawn_machine(kind: str, rng: np.random.Generator) -> Machine:
    usual = KINDS[kind]

    def within(limits: Range) -> float:
        return float(rng.uniform(*limits))

    kW = float(np.exp(within((np.log(usual.kW[0]), np.log(usual.kW[1])))))
    efficiency = within(usual.efficiency)
    watts = 1e3 * kW * (1.0 / efficiency - 1.0 if efficiency else 1.0)
    varied = np.array(usual.losses) * rng.uniform(0.75, 1.3, 4)
    copper, iron, friction, of_rotor = (float(w) for w in watts * varied / varied.sum())
    chosen = rng.permutation(usual.others)[: int(rng.integers(2, 5)) - len(usual.always)]
    drawn = (*usual.always, *(str(each) for each in chosen))
    whole = 450.0 * usual.kg[0] * kW ** usual.kg[1] * within((0.75, 1.35))
    running = watts / within(usual.rise_K)
    rest = running / (within((1.5, 3.0)) if "fan" in drawn else 1.0)
    rpm = float(rng.choice(usual.rpm)) * within((0.97, 1.03))
    Nm = 1e3 * kW / (rpm * np.pi / 30.0) if rpm else 0.0
    is_calm, on_plate = kind in ("servo on a flange", COIL), "neighbour" in usual.always
    by_light, sign = within((0.2, 0.5)) * rest, float(rng.choice([-1.0, 1.0]))
    on_rotor, to_plate = (
        within(usual.on_rotor),
        within((0.5, 1.4) if on_plate else (0.2, 0.6)) * rest,
    )
    p: Physics = dict.fromkeys([name for names in FREE.values() for name in names], 0.0) | {
        "C_w": within(usual.winding) * whole, "C_r": within((0.15, 0.30)) * whole,
        "C_b": within((0.6, 2.4) if on_plate else (0.15, 0.6)) * whole, "phi": 0.0,
        **dict.fromkeys(INSTRUMENTS, 0.0),
        "G_ws": copper / within(usual.winding_K), "G_rest": rest, "G_fan": running - rest,
        "nat": 0.0 if "jacket" in kind else within((0.04, 0.10)),
    }  # fmt: skip
    p["C_s"] = whole - p["C_w"] - ("rotor" in drawn) * p["C_r"]
    gap = within((1.5, 4.0)) * running if on_rotor else of_rotor / within((8.0, 25.0))
    imperfect: dict[str, Physics] = {
        "fan": {}, "rotor": {"phi": on_rotor, "rotor_W": of_rotor, "G_sr": gap},
        "surface": {"G_rest": rest - by_light, "nat": within((0.4, 0.8) if is_calm else (0.1, 0.3)),
                    "eA": by_light / (4.0 * STEFAN * (60.0 + KELVIN) ** 3)},
        "neighbour": {"G_sb": to_plate, "G_ba": within((0.2, 0.8)) * to_plate},
        "stray": {"stray_W": within((0.06, 0.18)) * copper},
        "iron": {"iron_W": within((0.15, 0.40)) * iron},
        "drift": {"drift_K": within((1.0, 3.5)) * sign}, "lag": {"lag_s": within(usual.lag_s)},
        "torque": {"offset_Nm": within((0.0015, 0.004)) * Nm * float(rng.choice([-1.0, 1.0]))},
    }  # fmt: skip
    for cause in drawn:
        p |= imperfect[cause]
    is_low = kind in ("hub motor", "drone outrunner", COIL)
    amps = 1e3 * kW / within((24.0, 60.0) if is_low else (250.0, 500.0))
    p["ohm"] = copper / ((3 if rpm else 1) * amps**2 * (1.0 + PER_KELVIN * 70.0))
    is_induction = "induction" in kind
    rated = {"rpm": rpm, "Nm": Nm, "A": amps, "copper_W": copper, "iron_W": iron,
             "rotor_W": of_rotor, "friction_W": friction,
             "slip": is_induction * of_rotor / (1e3 * kW)}  # fmt: skip
    is_fed = bool(rpm) and (not is_induction or rng.random() < 0.5)
    return Machine(kind, p, drawn, rated, is_fed)


def loads(machine: Machine, test: str, rng: np.random.Generator) -> np.ndarray:
    """Return the loads of a test: seconds, torque and speed over rated, shape (load, 3)."""
    p = machine.physics
    slow = (p["C_w"] + p["C_s"]) / (p["G_rest"] + p["G_fan"])
    whole = float(np.clip(4.5 * slow, 4500.0, 9600.0)) * rng.uniform(0.9, 1.12)
    cool = rng.uniform(0.15, 0.3) * whole
    holds, self_cooled = machine.kind == "servo on a flange", machine.kind == "drone outrunner"

    def one(seconds: float, torque: float, is_still: bool = False) -> tuple[float, float, float]:
        if self_cooled:  # a propeller takes torque with the square of the speed
            return seconds, torque, float(np.sqrt(torque))
        varied = rng.uniform(0.35, 1.1) if machine.is_fed and test != "S1" else 1.0
        still = is_still or machine.is_coil
        return seconds, torque * (0.75 if is_still else 1.0), 0.0 if still else varied

    if test == "staircase":
        torques = rng.permutation(np.linspace(0.3, 1.15, int(rng.integers(5, 7))))
        each = (whole - cool) / torques.size
        rows = [one(each * rng.uniform(0.8, 1.2), torque) for torque in torques]
        rows[2] = one(each, 0.9, is_still=True) if holds else rows[2]
    elif test == "S3":
        period, on, rows = float(np.clip(0.3 * slow, 120.0, 600.0)), rng.uniform(0.4, 0.6), []
        for cycle in range(int((0.95 * whole - cool) / period)):
            torque = rng.uniform(0.8, 1.0) / np.sqrt(on) * (0.8 if self_cooled else 0.95)
            rows.append(one(on * period, torque, is_still=holds and cycle % 3 == 1))
            rows.append(((1.0 - on) * period, 0.0, 0.0))
    else:
        rows, cool = [one(0.65 * whole, rng.uniform(0.9, 1.05))], 0.35 * whole
    return np.array([(90.0, 0.0, 0.0), *rows, (cool, 0.0, 0.0)])


INPUTS = ("current2", "stray", "iron", "rotor", "cooling", "known", "friction", "sink", "omega",
          "drift", "electric", "shaft")  # fmt: skip
"""What drives a march; `known` are watts beside copper and friction, or the measured balance, and
`electric` and `shaft` what errors of their instruments act on."""

INSTRUMENTS = {"ohm_off": 0.014, "watts_off": 0.01, "shaft_off": 0.01, "zero_off": 1e-3,
               "read_off": 0.005, "read_K": 0.5, "sink_K": 0.5}  # fmt: skip
"""Widths of heatrun's priors of instruments: shares (a zero of the rated torque), K. The
resistance stands for the current too."""

OHM_OF_COIL = 0.05
"""Width of that of a coil, whose copper loss eddies may raise [1]."""

OF_THE_SINK = {"sink_K": 0.4}
"""What is free where the instruments are known."""


def driven(machine: Machine, course: Columns) -> dict[str, np.ndarray]:
    rated = machine.rated
    speed = course["rpm"] / rated["rpm"] if rated["rpm"] else np.zeros_like(course["rpm"])
    load = course["amps"] / rated["A"]
    on = 1.0 * (load > 0.02)
    flux = 1.0 - 0.03 * np.minimum(load, 1.5) ** 2
    is_induction = rated["slip"] > 0.0
    torque = np.abs(course["torque"]) / rated["Nm"] if rated["Nm"] else load
    return {
        "current2": course["amps"] ** 2,
        "stray": load**2 * (1.0 if machine.is_coil else speed**1.5),
        "iron": on if machine.is_coil else speed**1.3 * flux**2,
        "rotor": torque**2 * (speed > 0.0) if is_induction
        else speed**1.6 * (0.4 + 0.6 * torque**2),
        "cooling": speed**0.8,
        "omega": course["rpm"] * np.pi / 30.0,
        "drift": 1.0 - np.exp(-course["time"] / 5400.0),
        "sink": course["sink"],
        "electric": course.get("watts", 0.0 * load),
        "shaft": course["torque"] * course["rpm"] * np.pi / 30.0,
    }  # fmt: skip


def surface(degC: Any, sink: Any, cooling: Any, p: Physics) -> Any:
    """Return what the whole surface loses at one temperature [W]."""
    rise = degC - sink
    free = 1.0 - p["nat"] + p["nat"] * np.sqrt(np.sqrt(np.abs(rise) / 40.0))
    light = p["eA"] * STEFAN * ((degC + KELVIN) ** 4 - (sink + KELVIN) ** 4)
    return (p["G_rest"] * free + p["G_fan"] * cooling) * rise + light


def march(
    machine: Machine, each: Sequence[Physics], drives: Sequence[Columns], step_s: float,
    starts: Sequence[float] = (), *, is_balance: bool = False,
) -> np.ndarray:  # fmt: skip
    """Return temperatures [degC], shape (time, node, test, lane), before sensors that lag.

    Args:
        machine: The machine.
        each: Its figures, and those of its variants, in lanes.
        drives: `INPUTS` of each test, held over each step.
        step_s: Length of a step [s].
        starts: Temperature at the start of each test [degC]; that of the sink if not given.
        is_balance: Whether `known` holds the copper too.
    """
    size = max(drive["sink"].size for drive in drives)
    padded = [
        [np.pad(d[name], (0, size - d[name].size), "edge") for name in INPUTS] for d in drives
    ]
    inputs = np.repeat(np.array(padded).transpose(2, 1, 0), len(each), axis=2)
    begin = np.array(starts or [drive["sink"][0] for drive in drives])
    p = {name: np.array([q[name] for _ in drives for q in each]) for name in each[0]}
    ohms = machine.phases * p["ohm"] * (1.0 + p["ohm_off"])
    share = np.array([1.0 - p["phi"], p["phi"]])
    G_ws, G_sr, G_sb, G_ba = (p[name] for name in ("G_ws", "G_sr", "G_sb", "G_ba"))
    capacity = np.array([p[name] for name in ("C_w", "C_s", "C_r", "C_b")])

    def slope(T: np.ndarray, now: np.ndarray) -> np.ndarray:
        current2, stray, iron, rotor, cooling, known, friction, sink, omega, drift = now[:10]
        electric, shaft = now[10:]
        sink = sink + p["drift_K"] * drift + p["sink_K"]
        copper = ohms * (1.0 + PER_KELVIN * (T[0] - 20.0)) * current2
        in_winding, in_rotor = p["stray_W"] * stray + p["iron_W"] * iron, p["rotor_W"] * rotor
        known = known + p["watts_off"] * electric - p["shaft_off"] * shaft - p["zero_off"] * omega
        other = known + p["offset_Nm"] * omega - in_winding - in_rotor
        other = other - copper if is_balance else other + friction * stiffness(T[1])
        lost = share * surface(T[1:3], sink, cooling, p)
        ws, sr, sb = G_ws * (T[0] - T[1]), G_sr * (T[1] - T[2]), G_sb * (T[1] - T[3])
        heat = (copper + in_winding - ws, other + ws - sr - sb - lost[0],
                in_rotor + sr - lost[1], sb - G_ba * (T[3] - sink))  # fmt: skip
        return np.array(heat) / capacity

    T = np.empty((size + 1, 4, len(drives) * len(each)))
    T[0] = np.repeat(begin, len(each))
    for place, now in enumerate(inputs):
        a = slope(T[place], now)
        b = slope(T[place] + 0.5 * step_s * a, now)
        c = slope(T[place] + 0.5 * step_s * b, now)
        d = slope(T[place] + step_s * c, now)
        T[place + 1] = T[place] + step_s / 6.0 * (a + 2.0 * (b + c) + d)
    return T.reshape(size + 1, 4, len(drives), len(each))


def stiffness(stator_degC: Any) -> Any:
    """Return the friction of bearings over that at 25 °C [1]."""
    return 0.6 + 0.4 * np.exp((25.0 - stator_degC) / 35.0)


def lagged(degC: np.ndarray, lag_s: float, step_s: float) -> np.ndarray:
    """Return what a first-order lag makes of samples that are joined by straight lines."""
    if lag_s < 0.05 * step_s:
        return degC
    keep, mean = np.exp(-step_s / lag_s), lag_s / step_s * -np.expm1(-step_s / lag_s)
    taps = [1.0 - mean, mean - keep]
    state = [degC[0] * (1.0 - taps[0])]
    return lfilter(taps, [1.0, -keep], degC, zi=state)[0]


def without(machine: Machine, cause: str, rise_K: float) -> Physics:
    """Return the figures of a machine without an imperfection, else as alike as can be."""
    p = machine.physics
    path = p["G_sb"] * p["G_ba"] / max(p["G_sb"] + p["G_ba"], 1e-9)
    gone = dict.fromkeys(FREE[cause], 0.0)
    if cause == "fan":
        return p | gone | {"G_rest": p["G_rest"] + p["G_fan"]}
    if cause == "rotor":
        whole = float(surface(25.0 + rise_K, 25.0, 1.0, p)) / rise_K
        scale = (1.0 / resistance(p, rise_K, 1.0, 0.0) - path) / whole
        alike = {name: scale * p[name] for name in ("G_rest", "G_fan", "eA")}
        return p | alike | {"G_sr": 0.0, "rotor_W": 0.0, "phi": 0.0, "C_s": p["C_s"] + p["C_r"]}
    if cause == "surface":
        return p | gone | {"G_rest": float(surface(25.0 + rise_K, 25.0, 0.0, p)) / rise_K}
    if cause == "neighbour":
        return p | {"G_sb": 0.0, "G_ba": 0.0, "G_rest": p["G_rest"] + path}
    return p | gone


def resistance(p: Physics, rise_K: float, speed: float, rotor_W: float) -> float:
    """Return the rise of the stator over all heat that leaves, at equilibrium [K/W]."""
    hot, sink, cooling = 25.0 + rise_K, 25.0, speed**0.8
    shell = hot
    for _ in range(60 if p["phi"] else 0):
        gone = p["phi"] * float(surface(shell, sink, cooling, p)) / (shell - sink)
        shell = (p["G_sr"] * hot + gone * sink + rotor_W) / (p["G_sr"] + gone)
    path = p["G_sb"] * p["G_ba"] / max(p["G_sb"] + p["G_ba"], 1e-9)
    lost = (1.0 - p["phi"]) * float(surface(hot, sink, cooling, p)) + path * rise_K
    return float(rise_K / (lost + p["phi"] * float(surface(shell, sink, cooling, p))))


@dataclass(frozen=True)
class Case:
    machine: Machine  # The machine.
    tests: dict[str, Columns]  # What was read, by name of the test; the last is held out.
    courses: dict[str, Columns]  # What was true in each.
    # What each imperfection makes of the winding's reading over the fitted tests [K].
    alone_K: dict[str, float]
    bench: dict[str, float]  # Errors of the instruments.

    def truth(self) -> dict[str, float | None]:
        """Return what a network of two nodes has in its place, at stated conditions.

        Where rotor or neighbour are bodies of their own, no one capacity is that of the stator.
        """
        machine, p = self.machine, self.machine.physics
        fitted = [self.courses[name] for name in list(self.tests)[:-1]]
        rise, amps, rpm = (
            np.concatenate([each[n] for each in fitted]) for n in ("rise", "amps", "rpm")
        )
        load, speed = amps > 0.2 * machine.rated["A"], rpm / (machine.rated["rpm"] or 1.0)
        loaded, often = float(np.mean(rise[load])), float(np.median(speed[load]))
        at_rest = float(np.mean(rise[(speed < 0.02) & (rise > 0.1 * loaded)]))
        has_bodies = {"rotor", "neighbour"} & set(machine.drawn)
        return {
            "Ceq_w": p["C_w"], "Ceq_sr": None if has_bodies else p["C_s"],
            "Req_w": float(1.0 / p["G_ws"]),
            "Req_sr_rated": resistance(p, loaded, 0.0 if machine.is_coil else 1.0, p["rotor_W"]),
            "Req_sr_loaded": resistance(p, loaded, often, p["rotor_W"]),
            "Req_sr_rest": resistance(p, at_rest, 0.0, 0.0), "loaded_speed": often,
            "C_s": p["C_s"], "C_r": p["C_r"] if p["G_sr"] else 0.0,
            "C_b": p["C_b"] if p["G_sb"] else 0.0,
        }  # fmt: skip


def make(kind: str, seed: int, *, is_plain: bool = False) -> Case:
    rng = np.random.default_rng(seed)
    machine = drawn_machine(kind, rng)
    machine = plain(machine) if is_plain else machine
    p = machine.physics
    first = str(rng.choice(["staircase", "S3"]))
    others = [str(n) for n in rng.permutation([n for n in ("staircase", "S3", "S1") if n != first])]
    tests = [first, *others] if rng.random() < 0.7 else [first, others[-1]]
    courses = {name: course_of(machine, loads(machine, name, rng), rng) for name in tests}
    variants = [p | {"offset_Nm": 0.0}]  # it is in the readings, not in the machine
    for cause in machine.present:
        offset = -p["offset_Nm"] if cause == "torque" else 0.0
        variants.append(without(machine, cause, machine.rise_K) | {"offset_Nm": offset})
    seen = run_courses(machine, variants, list(courses.values()))
    apart = {cause: [each[place] - each[0] for each in seen]
             for place, cause in enumerate(machine.present, 1)}  # fmt: skip
    alone = {
        cause: float(np.sqrt(np.mean(np.concatenate(each[:-1]) ** 2)))
        for cause, each in apart.items()
    }
    bench = bench_of(machine, rng)
    read = {name: read_by(machine, course, bench, rng) for name, course in courses.items()}
    return Case(machine, read, courses, alone, bench)


def plain(machine: Machine) -> Machine:
    for cause in machine.present:
        machine = replace(machine, physics=without(machine, cause, machine.rise_K))
    return replace(machine, drawn=())


def run_courses(
    machine: Machine, variants: Sequence[Physics], courses: Sequence[Columns]
) -> list[list[np.ndarray]]:
    """Put into each course what is true of the first variant: nodes, sensor and losses.

    Returns:
        What the sensor of each variant shows after each step [degC], by course and variant.
    """
    p, rated = machine.physics, machine.rated
    fine = [driven(machine, course) for course in courses]
    for drive in fine:
        drive["friction"] = rated["friction_W"] * drive["cooling"] ** (1.7 / 0.8)
        drive["known"] = rated["iron_W"] * drive["iron"] + rated["rotor_W"] * drive["rotor"]
        drive["known"] = drive["known"] + p["stray_W"] * drive["stray"]
    drives = [{name: _means(each, FINE) for name, each in drive.items()} for drive in fine]
    marched, found = march(machine, variants, drives, STEP_S), []
    for test, (course, drive) in enumerate(zip(courses, fine, strict=True)):
        T = marched[: course["time"].size // FINE + 1, :, test]
        seen = [lagged(T[:, 0, lane], q["lag_s"], STEP_S) for lane, q in enumerate(variants)]
        course["winding"], course["stator"], course["sensor"] = (
            np.interp(course["time"], STEP_S * np.arange(len(T)), each)
            for each in (T[:, 0, 0], T[:, 1, 0], seen[0])
        )
        course["rise"] = course["stator"] - course["sink"]
        warm = 1.0 + PER_KELVIN * (course["winding"] - 20.0)
        losses = machine.phases * p["ohm"] * warm * drive["current2"] + drive["known"]
        course["losses"] = losses + drive["friction"] * stiffness(course["stator"])
        found.append(seen)
    return found


def course_of(machine: Machine, rows: np.ndarray, rng: np.random.Generator) -> Columns:
    edges = np.concatenate([[0.0], np.cumsum(rows[:, 0])])
    time = np.arange(int(edges[-1] / STEP_S) * FINE) * STEP_S / FINE
    held = np.minimum(np.searchsorted(edges, time, side="right") - 1, len(rows) - 1)
    _, torque, speed = rows[held].T
    rated = machine.rated
    if rated["slip"]:
        idle = 0.45
        load = np.sqrt(idle**2 + (1.0 - idle**2) * torque**2) * (speed > 0.0)
        speed = speed * (1.0 + rated["slip"] * (1.0 - torque))
    else:
        field = 0.8 * np.maximum(speed - 0.75, 0.0) * ("jacket" in machine.kind)
        load = np.hypot(torque * (1.0 + 0.06 * torque**2), field * (speed > 0.0))
    hours, swing = time / 3600.0, rng.uniform(0.2, 0.8)
    sink = rng.uniform(17.0, 29.0) + swing * np.sin(2.0 * np.pi * (hours + rng.random()))
    if "jacket" in machine.kind:  # a heat exchanger that hunts, and somebody who turns its knob
        knob = rng.uniform(-6.0, 6.0) * (time > rng.uniform(0.3, 0.7) * time[-1])
        hunt = rng.uniform(1.0, 3.0) * np.sin(2.0 * np.pi * hours / rng.uniform(0.2, 0.5))
        sink = rng.uniform(35.0, 62.0) + lagged(knob, 240.0, STEP_S / FINE) + hunt - hunt[0]
    return {"time": time, "torque": torque * rated["Nm"], "rpm": speed * rated["rpm"],
            "amps": load * rated["A"], "sink": sink}  # fmt: skip


def bench_of(machine: Machine, rng: np.random.Generator) -> dict[str, float]:
    """Return instruments of usual classes: 0.3 % of current, 0.1 % of power, 0.2 % of torque."""
    sd = {"amps": 0.0015, "watts": 0.0006, "torque": 0.0008, "zero_Nm": 3e-4 * machine.rated["Nm"],
          "ohm": 0.005, "gain": 0.003, "offset_K": 0.25, "sink_K": 0.25}  # fmt: skip
    bench = {name: float(rng.normal(0.0, value)) for name, value in sd.items()}
    fast_s = machine.physics["C_w"] / machine.physics["G_ws"]  # what a slow logger must not miss
    return bench | {
        "noise_K": float(rng.uniform(0.05, 0.2)), "noise_s": float(rng.uniform(20.0, 90.0)),
        "digit_K": float(rng.choice([0.1, 0.1, 0.01])), "logger": float(rng.integers(len(LOGGERS))),
        "sample_s": float(rng.choice([1.0, *(s for s in (2.0, 5.0) if s < fast_s / 15.0)])),
    }  # fmt: skip


def read_by(
    machine: Machine, course: Columns, bench: dict[str, float], rng: np.random.Generator
) -> Columns:
    time = np.arange(0.0, course["time"][-1], bench["sample_s"])
    place = (time * FINE / STEP_S).astype(int)
    rated = machine.rated

    def noise(share: float) -> np.ndarray:
        return 1.0 + share * rng.standard_normal(time.size)

    keep = np.exp(-bench["sample_s"] / bench["noise_s"])
    white = rng.standard_normal(time.size + 400)
    slow = np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white))[400:]
    sensor, sink = (np.interp(time, course["time"], course[n]) for n in ("sensor", "sink"))
    sensor = sensor + bench["gain"] * (sensor - 20.0) + bench["offset_K"] + bench["noise_K"] * slow
    torque, omega = course["torque"][place], course["rpm"][place] * np.pi / 30.0
    watts = torque * omega + course["losses"][place]
    columns = {
        "time": time,
        "amps": np.maximum(course["amps"][place] * (1.0 + bench["amps"]) * noise(1e-3), 0.0),
        "watts": watts * (1.0 + bench["watts"]) * noise(3e-4),
        "rpm": course["rpm"][place] * noise(1e-4),
        "torque": torque * (1.0 + bench["torque"]) + bench["zero_Nm"]
        + machine.physics["offset_Nm"] + 3e-4 * rated["Nm"] * rng.standard_normal(time.size),
        "winding": bench["digit_K"] * np.rint(sensor / bench["digit_K"]),
        "sink": np.round(sink + bench["sink_K"] + 0.05 * rng.standard_normal(time.size), 1),
    }  # fmt: skip
    return {n: c for n, c in columns.items() if not (machine.is_coil and n in ("rpm", "torque"))}


LOGGERS = (
    (",", ".", {"time": "Time [s]", "amps": "I_phase [A]", "watts": "P_el [W]", "rpm": "n [rpm]",
                "torque": "Torque [Nm]", "winding": "T_winding [degC]", "sink": "T_sink [degC]"}),
    (";", ",", {"time": "Zeit [s]", "amps": "Strom L1 [A]", "watts": "Wirkleistung [W]",
                "rpm": "Drehzahl [rpm]", "torque": "Drehmoment [Nm]", "winding": "T_Wicklung [°C]",
                "sink": "T_Kühlung [°C]"}),
    ("\t", ".", {"time": "t [s]", "amps": "I_fase [A]", "watts": "P_in [W]", "rpm": "giri [rpm]",
                 "torque": "coppia [Nm]", "winding": "PT100 avv [°C]", "sink": "T_rif [°C]"}),
)  # fmt: skip
"""How loggers write: separator, decimal sign, headings."""


def write_case(case: Case, folder: Path) -> list[Path]:
    """Write motor file and tests as a bench has them; return the paths, the held-out test last."""
    machine = case.machine
    separator, decimal, names = LOGGERS[int(case.bench["logger"])]
    paths = []
    for name, columns in case.tests.items():
        paths.append(folder / f"{name}.csv")
        table = pd.DataFrame(columns).rename(columns=names)
        table.to_csv(paths[-1], sep=separator, decimal=decimal, index=False, float_format="%.7g")
    sink = "coolant" if "jacket" in machine.kind else "ambient"
    channels = {"time": "time_s", "amps": "phase_current_A", "rpm": "speed_rpm",
                "torque": "torque_Nm", "winding": "winding_degC", "sink": f"{sink}_degC",
                "watts": "losses_W" if machine.is_coil else "electrical_power_W"}  # fmt: skip
    rated = "" if machine.is_coil else f"rated_speed_rpm = {machine.rated['rpm']:.0f}\n"
    ohm = machine.physics["ohm"] * (1.0 + case.bench["ohm"])
    text = (
        f'[motor]\nname = "{machine.kind}"\nphases = {machine.phases}\nsink = "{sink}"\n{rated}'
        f"[winding]\nphase_resistance_ohm = {ohm:.5g}\nreference_temperature_degC = 20.0\n"
        "[columns]\n"
    )
    for name in next(iter(case.tests.values())):
        text += f'{channels[name]} = "{names[name].rsplit(" [", 1)[0]}"\n'
    (folder / "motor.toml").write_text(text, encoding="utf-8")
    return paths


STEPS_AT_MOST = 1.5
"""Step of the march in a fit over the fastest time constant of the true figures [1]."""


def fastest_s(p: Physics) -> float:
    """Return the shortest time constant of a machine's nodes at rated speed [s]."""
    out = p["G_rest"] + p["G_fan"]
    conductance = {"C_w": p["G_ws"], "C_s": p["G_ws"] + p["G_sr"] + p["G_sb"] + out,
                   "C_r": p["G_sr"] + p["phi"] * out, "C_b": p["G_sb"] + p["G_ba"]}  # fmt: skip
    return min(p[name] / each for name, each in conductance.items() if each)


def structure_fitted(case: Case, seed: int) -> dict[str, Any]:
    """Return what the true structure, fitted to the same tests, leaves of them and predicts.

    `refit_K` is what it leaves more without an imperfection, all else fitted anew: the kelvins of
    it that the rest of the network cannot take over. Its priors lie about the true figures, so
    that it hits what the tests leave open; those of `holdout_unknowing_K` lie about figures that
    are off by a draw from them, median of `NUM_PRIORS`. `holdout_instruments_K` knows the machine's
    resistance and instruments as well as heatrun does (`INSTRUMENTS`), and no better.
    """
    machine = case.machine
    step = 20.0 if machine.is_coil else 10.0
    while step > STEPS_AT_MOST * fastest_s(machine.physics):  # from 2.8 on the march is unstable
        step /= 2.0
    drives, reads = zip(
        *(_blocks(machine, test, step) for test in case.tests.values()), strict=True
    )

    def errors(each: Sequence[Physics], num: int) -> list[list[np.ndarray]]:
        starts = [read[:3].mean() for read in reads[:num]]
        with np.errstate(over="ignore", invalid="ignore"):  # where a step goes much too far
            T = march(machine, each, drives[:num], step, starts, is_balance=True)[:, 0]
        rows: list[list[np.ndarray]] = [[] for _ in each]
        for test, read in enumerate(reads[:num]):
            for lane, q in enumerate(each):
                ends = lagged(T[: read.size + 1, test, lane], q["lag_s"], step)
                seen = 0.5 * (ends[1:] + ends[:-1]) * (1.0 + q["read_off"]) + q["read_K"]
                rows[lane].append(seen - read)
        return rows

    def fit(
        base: Physics, causes: Sequence[str], most: int, rng: np.random.Generator | None = None,
        widths: Physics = OF_THE_SINK,
    ) -> tuple[float, float]:  # fmt: skip
        names = [n for c in ("", *causes) for n in FREE[c] if base[n]]
        num = len(names)
        units = np.eye(num + len(widths))  # factors, and errors of instruments
        centre = np.zeros(len(units))
        if rng is not None:
            centre[:num] = rng.standard_normal(num)

        def figures(x: np.ndarray) -> Physics:
            factors = np.exp(np.clip(x[:num], -4.0, 4.0))
            off = {n: sd * y for (n, sd), y in zip(widths.items(), x[num:], strict=True)}
            return base | {n: base[n] * f for n, f in zip(names, factors, strict=True)} | off

        def stacked(rows: Sequence[np.ndarray]) -> np.ndarray:  # in units of 0.3 K
            return np.clip(np.nan_to_num(np.concatenate(rows), nan=1e3), -1e3, 1e3) / 0.3

        def residuals(x: np.ndarray) -> np.ndarray:
            return np.concatenate([stacked(errors([figures(x)], len(reads) - 1)[0]), x - centre])

        def slopes(x: np.ndarray) -> np.ndarray:
            each = [figures(x), *(figures(x + 1e-4 * unit) for unit in units)]
            flat = np.array([stacked(row) for row in errors(each, len(reads) - 1)])
            return np.vstack([(flat[1:] - flat[0]).T / 1e-4, units])

        found = least_squares(residuals, np.zeros(len(units)), jac=slopes, x_scale=0.3,  # pyright: ignore
                              max_nfev=most, ftol=1e-5, xtol=1e-4)  # fmt: skip
        rows = errors([figures(found.x)], len(reads))[0]
        squares = [np.mean(_means(row, round(BLOCK_S / step)) ** 2) for row in rows]
        return float(np.sqrt(np.mean(squares[:-1]))), float(np.sqrt(squares[-1]))

    stated = machine.physics | {"ohm": machine.physics["ohm"] * (1.0 + case.bench["ohm"])}
    widths = INSTRUMENTS | {"zero_off": INSTRUMENTS["zero_off"] * machine.rated["Nm"]}
    widths |= {"ohm_off": OHM_OF_COIL} if machine.is_coil else {}
    rmse, held_out = fit(machine.physics, machine.present, 15)
    _, instruments = fit(stated, machine.present, 15, widths=widths)
    rng = np.random.default_rng(seed)
    unknowing = [fit(machine.physics, machine.present, 15, rng)[1] for _ in range(NUM_PRIORS)]
    refit = {}
    for cause in machine.present:
        rest = [each for each in machine.present if each != cause]
        left, _ = fit(without(machine, cause, machine.rise_K), rest, 8)
        refit[cause] = float(np.sqrt(max(left**2 - rmse**2, 0.0)))
    return {"rmse_K": rmse, "holdout_rmse_K": held_out,
            "holdout_unknowing_K": float(np.median(unknowing)),
            "holdout_instruments_K": instruments, "refit_K": refit}  # fmt: skip


def _means(values: np.ndarray, size: int) -> np.ndarray:
    return values[: values.size // size * size].reshape(-1, size).mean(axis=1)


def _blocks(machine: Machine, test: Columns, step_s: float) -> tuple[Columns, np.ndarray]:
    size = round(step_s / (test["time"][1] - test["time"][0]))
    still = np.zeros_like(test["time"])
    course = {"rpm": still, "torque": still} | test
    drive = driven(machine, course)
    shaft = course["torque"] * course["rpm"] * np.pi / 30.0
    drive |= {"known": test["watts"] - shaft, "friction": still}
    means = {name: _means(column, size) for name, column in drive.items()}
    return means, _means(test["winding"], size)
