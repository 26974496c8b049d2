"""Heat balances of two nodes and a few effects, written out by hand beside the package's own."""

import jax.numpy as jnp
import numpy as np

from lptn import CopperLosses, Drive
from lptn.effects import EFFECTS, build

CW, CS, RW, RS = 666.75, 15060.1, 0.14485, 0.11625
RS0, B, TREF = 0.0062, 234.5, 25.0
CURRENT, POWER, SINK, SPEED, RATED = 110.0, 500.0, 21.0, 240.0, 600.0
K = 3.0 * CURRENT**2 * RS0 / (B + TREF)
BY_ID = {kind.card.id: kind for kind in EFFECTS}

LAWS = {
    "none": ({}, None),
    "speed_cooling": ({"g": 0.8, "m": 0.7}, "stator"),
    "radiation": ({"eA": 0.4}, "stator"),
    "natural_convection": ({"f": 0.6, "n": 0.3}, "stator"),
    "housing_node": ({"x": 0.35, "tau": 250.0}, "stator"),
}


def drive(current=CURRENT, power=POWER, sink=SINK, **more):
    return Drive.constant(
        current_squared=current**2, losses=power, ambient=sink, speed=SPEED,
        rated_speed=RATED, rated_current=150.0, **more,
    )  # fmt: skip


def corrected(kind="balance"):
    """Copper losses of the reference machine whose instruments are corrected."""
    by = {"power_gain": 0.03, "torque_offset": 0.2, "ambient_offset": -0.7}
    by = {name: jnp.asarray(value) for name, value in by.items()}
    return CopperLosses(Rs0=jnp.asarray(RS0), kind=kind, **by)


def built(law, network):
    values, _ = LAWS[law]
    return () if law == "none" else (build(BY_ID[law], values, network),)


def rate(law, kind, current=CURRENT, power=POWER, sink=SINK):
    """Return dT/dt of (stator, winding[, housing]) as the cards state the laws."""
    k = 3.0 * current**2 * RS0 / (B + TREF)
    p = LAWS[law][0]

    def slope(t, T):
        stator, winding = T[0], T[1]
        copper = k * (B + winding)
        other = power - copper if kind == "balance" else power
        theta = stator - sink
        out = theta / RS
        if law == "speed_cooling":
            out *= 1.0 + p["g"] * (SPEED / RATED) ** p["m"]
        if law == "radiation":
            out += 5.670374419e-8 * p["eA"] * ((stator + 273.15) ** 4 - (sink + 273.15) ** 4)
        if law == "natural_convection":
            out *= 1.0 - p["f"] + p["f"] * ((theta**2 + 1.0) / 1600.0) ** (0.5 * p["n"])
        more = []
        if law == "housing_node":  # the ladder itself: core, housing, sink
            inner, outer = (1.0 - p["x"]) * RS, p["x"] * RS
            capacity = p["tau"] / (p["x"] * (1.0 - p["x"]) * RS)
            out = (stator - T[2]) / inner
            more = [(out - (T[2] - sink) / outer) / capacity]
        across = (winding - stator) / RW
        return [(other + across - out) / CS, (copper - across) / CW, *more]

    return slope


def jacobian(slope, at):
    """Central differences: the laws are smooth and temperatures are of the order of 100 K."""
    at, h = np.asarray(at, dtype=float), 1e-3
    unit = h * np.eye(at.size)
    return np.stack(
        [(np.subtract(slope(0, at + u), slope(0, at - u))) / (2 * h) for u in unit], axis=1
    )
