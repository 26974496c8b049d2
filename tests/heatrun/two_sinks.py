"""A motor that loses heat to a liquid and to the air, integrated by SciPy from its equations."""

import numpy as np
from scipy.integrate import solve_ivp

from heatrun.record.record import Record

TRUTH = {
    "Ceq_w": 700.0, "Ceq_sr": 12000.0, "Req_w": 0.12, "Req_coolant": 0.05, "Req_ambient": 0.11,
}  # fmt: skip
RS0 = 0.0062


def amperes(t):
    return np.where(np.asarray(t) % 1500.0 < 900.0, 190.0, 60.0)


def coolant(t):
    return 40.0 + 20.0 * np.clip((np.asarray(t) - 1800.0) / 30.0, 0.0, 1.0)


def air(t):
    return 22.0 + 9.0 * np.clip((np.asarray(t) - 3600.0) / 900.0, 0.0, 1.0)


def iron(t):
    return 300.0 + 250.0 * (np.asarray(t) % 2400.0 < 1200.0)


def copper(t, winding):
    return 3.0 * amperes(t) ** 2 * RS0 * (234.5 + winding) / 259.5


def integrated(slope, start, time, *, max_step):
    found = solve_ivp(
        slope, (0.0, time[-1]), start, t_eval=time, max_step=max_step, rtol=1e-8, atol=1e-8
    )
    return found.y


def read(course, rng):
    """Readings of a course with 0.1 K of noise, rounded to 0.1 K."""
    return np.round(course + 0.1 * rng.standard_normal(course.size), 1)


def course(time):
    """Temperatures of winding and stator [degC]."""
    p = TRUTH

    def slope(t, T):
        flow = (T[0] - T[1]) / p["Req_w"]
        out = (T[1] - coolant(t)) / p["Req_coolant"] + (T[1] - air(t)) / p["Req_ambient"]
        return [(copper(t, T[0]) - flow) / p["Ceq_w"], (iron(t) + flow - out) / p["Ceq_sr"]]

    return integrated(slope, [36.0, 36.0], time, max_step=2.0)


def record(seed=11, *, end_s=5400.0):
    """A record at 0.5 Hz; readings with 0.1 K of noise, rounded to 0.1 K; the losses a balance."""
    time = np.arange(0.0, end_s, 2.0)
    winding, stator = course(time)
    rng = np.random.default_rng(seed)

    return Record(
        "duty",
        {
            "time_s": time,
            "phase_current_A": amperes(time),
            "losses_W": copper(time, winding) + iron(time),
            "ambient_degC": air(time),
            "coolant_degC": coolant(time),
            "winding_degC": read(winding, rng),
            "stator_degC": read(stator, rng),
        },
    )
