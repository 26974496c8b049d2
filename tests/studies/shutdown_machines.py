"""Machines that are switched off, by a code that shares nothing with heatrun: SciPy's integrator,
and its matrix exponential for machines of two nodes.

Five nodes (slot part, end winding, teeth, yoke with housing, rotor), losses that follow the
resistance, cooling that follows temperature and a fan that runs down; then a bridge with leads, a
clock and a cold measurement, each with errors.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

COPPER_J, IRON_J = 385.0, 460.0
"""Specific heat [J/(kg K)]."""


@dataclass(frozen=True)
class Machine:
    # Heat capacities of slot part, end winding, teeth, yoke with housing, rotor [J/K].
    C: np.ndarray
    # Conductances [W/K] slot-tooth, slot-end, end-housing, tooth-yoke, yoke-air, rotor-tooth.
    G: np.ndarray
    end_share: float  # Share of the resistance in the end windings [1].
    copper_W: float  # Loss at 20 degC of winding and current.
    iron_W: tuple[float, float]  # Of teeth and yoke, two numbers.
    rotor_W: float  # Of the rotor.
    ambient_degC: float  # Of the air.
    still: float  # Conductance of the housing to still air over that with the fan [1].
    exponent: float  # Of the rise in natural convection [1].
    run_down_s: float  # Time constant of speed [s].
    heated_s: float  # How long it ran from cold [s].
    B: float  # Of the material [degC].

    def slope(self, T: np.ndarray, speed: float, *, is_on: bool) -> np.ndarray:
        slot_tooth, slot_end, end_housing, tooth_yoke, yoke_air, rotor_tooth = self.G
        slot, end, _, yoke, _ = T
        P = self.copper_W if is_on else 0.0
        ratio = (self.B + np.array([slot, end])) / (self.B + 20.0)
        heat = np.zeros(5)
        heat[:2] = P * np.array([1.0 - self.end_share, self.end_share]) * ratio
        heat[2] = self.iron_W[0] * (1.0 if is_on else 0.3 * speed**1.5)
        heat[3] = self.iron_W[1] * (1.0 if is_on else 0.3 * speed**1.5)
        heat[4] = self.rotor_W * (1.0 if is_on else 0.2 * speed**2)
        rise = max(yoke - self.ambient_degC, 1e-6)
        natural = self.still * (rise / 40.0) ** self.exponent
        to_air = yoke_air * (natural + (1.0 - self.still) * speed**0.8)
        stirred = 0.4 + 0.6 * speed**0.6
        flows = (
            (0, 2, slot_tooth), (0, 1, slot_end), (1, 3, end_housing * stirred),
            (2, 3, tooth_yoke), (4, 2, rotor_tooth * stirred),
        )  # fmt: skip
        for near, far, conductance in flows:
            watts = conductance * (T[near] - T[far])
            heat[near] -= watts
            heat[far] += watts
        heat[3] -= to_air * (yoke - self.ambient_degC)
        return heat / self.C

    def winding(self, T: np.ndarray) -> np.ndarray:
        """Return the temperature that the resistance shows [degC]."""
        return (1.0 - self.end_share) * T[0] + self.end_share * T[1]

    def cooled(self, time_s: np.ndarray) -> tuple[float, np.ndarray]:
        cold = np.full(5, self.ambient_degC)
        hot = solve_ivp(
            lambda t, T: self.slope(T, 1.0, is_on=True), (0.0, self.heated_s), cold,
            method="LSODA", rtol=1e-8, atol=1e-8,
        ).y[:, -1]  # fmt: skip
        off = solve_ivp(
            lambda t, T: self.slope(T, np.exp(-t / self.run_down_s), is_on=False),
            (0.0, float(time_s[-1]) + 1.0), hot, method="LSODA", t_eval=time_s, rtol=1e-8,
            atol=1e-8,
        )  # fmt: skip
        return float(self.winding(hot)), self.winding(off.y)


@dataclass(frozen=True)
class TwoNodes:
    """A machine of winding and iron, all losses of which end at switch-off."""

    A: np.ndarray  # State matrix [1/s].
    hot_K: np.ndarray  # Rise of the nodes at switch-off [K].
    ambient_degC: float  # Of what it cools to.
    run_down_s: float  # 0: nothing runs on.
    B: float  # Of the material [degC].

    def cooled(self, time_s: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the winding at switch-off and at times after it, evenly spaced from 0 [degC]."""
        step, state, course = expm(self.A * (time_s[1] - time_s[0])), self.hot_K, []
        for _ in time_s:
            course.append(self.ambient_degC + state[0])
            state = step @ state
        return course[0], np.array(course)


OF_TWO = {
    "two nodes": ((60.0, 400.0), (2400.0, 9000.0), (0.08, 0.3)),
    "water jacket": ((30.0, 120.0), (300.0, 1200.0), (0.3, 0.7)),
}
"""Time constants of the winding over the iron and of the iron [s], share of the winding in the rise
[1]."""


def two_nodes(random: np.random.Generator, kind: str) -> TwoNodes:
    (fast, slow, shares), rise = OF_TWO[kind], random.uniform(60.0, 105.0)
    tau, slow_s = (np.exp(random.uniform(*np.log(ends))) for ends in (fast, slow))
    share = random.uniform(*shares)
    C = np.array([1000.0, 0.0])
    inner = C[0] / tau
    outer = inner * share / (1.0 - share) * random.uniform(1.0, 1.8)
    C[1] = outer * slow_s
    A = np.array([[-inner, inner], [inner, -inner - outer]]) / C[:, None]
    # 1 W of copper loss, and in the iron what the share of the winding leaves to it
    heat = np.array([1.0, max(outer * (1.0 - share) / (share * inner) - 1.0, 0.0)]) / C
    steady = -np.linalg.solve(A, heat)
    is_short = random.random() < 0.3
    run_s = random.uniform(0.1, 1.0) * slow_s if is_short else 10.0 * slow_s
    hot = steady - expm(A * run_s) @ steady
    return TwoNodes(A, hot * rise / hot[0], random.uniform(15.0, 32.0), 0.0,
                    random.normal(234.5, 0.5))  # fmt: skip


@dataclass(frozen=True)
class Design:
    copper: float = 1.1  # Copper of a machine of 1 kW [kg].
    density: tuple[float, float] = (3.0, 7.5)  # Current density [A/mm2].
    # Losses of the rotor over those of the cold copper [1].
    rotor: tuple[float, float] = (0.1, 0.7)
    slot_K: tuple[float, float] = (5.0, 22.0)  # Rise of the slot part over the teeth.
    end_K: tuple[float, float] = (20.0, 45.0)  # Rise of the end winding over the housing.
    teeth_K: tuple[float, float] = (3.0, 12.0)  # Rise of the teeth over the yoke.
    housing_K: tuple[float, float] = (25.0, 55.0)  # Rise of the housing.
    is_fanned: bool = True  # Whether speed and rise change what the housing gives off.


FIVE_IN_JACKET = "five in a jacket"

DESIGNS = {
    FIVE_IN_JACKET: Design(
        0.35, (6.0, 14.0), (0.05, 0.3), (25.0, 60.0), (40.0, 80.0), (6.0, 20.0), (10.0, 25.0), False
    ),
}
"""Of the kinds of five nodes that are not cooled by air."""


def machine(random: np.random.Generator, kind: str = "") -> Machine:
    """Return a machine from 0.5 to 500 kW, drawn from what designs of its kind have."""
    design = DESIGNS.get(kind, Design())
    output_kW = 10.0 ** random.uniform(-0.3, 2.7)
    copper_kg = design.copper * output_kW**0.75 * random.lognormal(0.0, 0.25)
    iron_kg = copper_kg * random.uniform(3.0, 6.0)
    density = random.uniform(*design.density)
    copper_W = copper_kg * 2.2 * density**2  # 1.72e-8 ohm m, 8900 kg/m3: 1.93 and some extra
    end = random.uniform(0.3, 0.6)
    iron_W = copper_W * random.uniform(0.2, 0.7)
    rotor_W = copper_W * random.uniform(*design.rotor)
    hot = 1.3 * copper_W
    slot_W = hot * (1.0 - end)
    # the rises that a designer aims at set the conductances
    over_slot, over_teeth = random.uniform(*design.slot_K), random.uniform(*design.teeth_K)
    housing = random.uniform(*design.housing_K)
    total = hot + iron_W + rotor_W
    G = np.array([
        slot_W / over_slot,
        hot / random.uniform(30.0, 200.0),
        hot * end / random.uniform(*design.end_K),
        (slot_W + 0.5 * iron_W + rotor_W) / over_teeth,
        total / housing,
        rotor_W / random.uniform(10.0, 40.0),
    ])  # fmt: skip
    kg = np.array([(1.0 - end) * copper_kg, end * copper_kg, 0.3 * iron_kg, 1.1 * iron_kg,
                   0.8 * iron_kg])  # fmt: skip
    C = kg * np.array([COPPER_J, COPPER_J, IRON_J, IRON_J, IRON_J])
    C[:2] *= random.uniform(1.1, 1.4)  # impregnation and insulation
    slow_s = float(np.sum(C) / G[4])
    made = Machine(
        C, G, end, copper_W, (0.6 * iron_W, 0.4 * iron_W), rotor_W,
        ambient_degC=random.uniform(15.0, 32.0),
        still=random.uniform(0.2, 0.6), exponent=random.uniform(0.1, 0.3),
        run_down_s=10.0 ** random.uniform(0.3, 1.5),
        heated_s=slow_s * random.uniform(1.5, 6.0), B=random.normal(234.5, 0.5),
    )  # fmt: skip
    return made if design.is_fanned else replace(made, still=1.0, exponent=0.0)
