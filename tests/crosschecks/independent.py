"""The heat balances once more, written down from their equations: no code shared with `lptn`.

Plain arithmetic on scalars, so that scipy, numba and diffrax can all take the same right-hand
side. Temperatures in degC, watts, kelvin per second; `drive` is (I^2, losses, ambient, speed
over rated speed, I^2 over rated I^2) of one interval.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

FIRST = {"Ceq": 12_500.0, "Req": 0.132}
SECOND = {"Ceq_w": 666.75, "Ceq_sr": 15_060.1, "Req_w": 0.14485, "Req_sr": 0.11625}
RS0, B, T_REF = 0.0062, 234.5, 25.0

FOUR_C = {"winding": 437.0, "tooth": 6509.0, "yoke": 10_666.0, "magnet": 3511.0}
FOUR_R = {
    ("winding", "tooth"): 0.0899,
    ("winding", "yoke"): 0.0375,
    ("yoke", "tooth"): 0.0707,
    ("tooth", "magnet"): 0.4,
    ("yoke", "ambient"): 0.09,
}
FOUR_SHARE = {"tooth": 0.5, "yoke": 0.3, "magnet": 0.2}
EFFECTS = {"eA": 0.3, "g": 0.5, "m": 0.8, "ac": 0.3, "stray": 200.0, "insulation": 0.003}
"""Radiation of the yoke [m^2]; gain and exponent of the speed on its path to the sink; AC over DC
copper loss less one; stray loss [W]; slope of the insulation's conductivity [1/K]."""

STEFAN_BOLTZMANN = 5.670374419e-8
"""W/(m^2 K^4), CODATA 2018."""

Slope = Callable[..., list]


def first_order(T, drive):
    """One node: all losses go into it."""
    _, P, T0, _, _ = drive
    return [(P - (T[0] - T0) / FIRST["Req"]) / FIRST["Ceq"]]


def second_order(T, drive):
    """Winding and stator under a measured balance of losses."""
    I2, P, T0, _, _ = drive
    p = SECOND
    copper = 3.0 * RS0 * I2 * (B + T[0]) / (B + T_REF)
    flow = (T[0] - T[1]) / p["Req_w"]
    stator = P - copper + flow - (T[1] - T0) / p["Req_sr"]
    return [(copper - flow) / p["Ceq_w"], stator / p["Ceq_sr"]]


def four_nodes(T, drive):
    """Winding, tooth, yoke, magnet, with five effects."""
    I2, P, T0, s, i2 = drive
    winding, tooth, yoke, magnet = T
    e, R, C = EFFECTS, FOUR_R, FOUR_C
    risen = (B + winding) / (B + T_REF)
    joule = 3.0 * RS0 * I2 * risen
    copper = joule * (1.0 + e["ac"] * (s / risen) ** 2) + e["stray"] * i2 * s**1.5
    other = P - copper
    to_tooth = (winding - tooth) / R["winding", "tooth"]
    to_tooth = to_tooth * (1.0 + e["insulation"] * (winding - 60.0))
    to_yoke = (winding - yoke) / R["winding", "yoke"]
    yoke_tooth = (yoke - tooth) / R["yoke", "tooth"]
    to_magnet = (tooth - magnet) / R["tooth", "magnet"]
    out = (yoke - T0) / R["yoke", "ambient"] * (1.0 + e["g"] * s ** e["m"])
    out = out + STEFAN_BOLTZMANN * e["eA"] * ((yoke + 273.15) ** 4 - (T0 + 273.15) ** 4)
    share = FOUR_SHARE
    return [
        (copper - to_tooth - to_yoke) / C["winding"],
        (share["tooth"] * other + to_tooth + yoke_tooth - to_magnet) / C["tooth"],
        (share["yoke"] * other + to_yoke - yoke_tooth - out) / C["yoke"],
        (share["magnet"] * other + to_magnet) / C["magnet"],
    ]


def by_scipy(slope: Slope, start: list[float], edges: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Return temperatures at the edges [degC], shape (edge, node), by DOP853 from edge to edge."""
    rows = [np.asarray(start, dtype=float)]
    for (begin, end), values in zip(pairwise(edges), drive, strict=True):
        solution = solve_ivp(
            lambda t, T, values=values: slope(T, values), (begin, end), rows[-1],
            method="DOP853", rtol=1e-12, atol=1e-12,
        )  # fmt: skip
        rows.append(solution.y[:, -1])
    return np.stack(rows)


def by_diffrax(
    slope: Slope, start: list[float], edges: np.ndarray, drive: np.ndarray
) -> np.ndarray:
    """As `by_scipy`, by one call of diffrax (Dopri8) that is told where the inputs jump."""
    import diffrax
    import jax.numpy as jnp

    times, values = jnp.asarray(edges), jnp.asarray(drive)

    def rate(t, T, _):
        index = jnp.clip(jnp.searchsorted(times, t, side="right") - 1, 0, len(values) - 1)
        return jnp.stack(slope(T, values[index]))

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        diffrax.Dopri8(),
        t0=times[0],
        t1=times[-1],
        dt0=times[1] - times[0],
        y0=jnp.asarray(start),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=1e-11, atol=1e-11), jump_ts=times
        ),
        saveat=diffrax.SaveAt(ts=times),
        max_steps=8 * len(edges),
    )
    return np.asarray(solution.ys)
