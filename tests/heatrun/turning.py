"""A motor of three bodies whose friction heats the rotor, integrated by SciPy."""

import numpy as np
from two_sinks import amperes, copper, integrated, read

from heatrun.record.record import Record

TRUTH = {
    "Ceq_winding": 700.0, "Ceq_stator": 9000.0, "Ceq_rotor": 2500.0, "Req_winding_stator": 0.12,
    "Req_stator_rotor": 0.25, "Req_stator_ambient": 0.06,
    "P_mechanical_n": 30.0, "P_mechanical_n2": 12.0,
}  # fmt: skip
NETWORK = """
[network]
name = "turning"
nodes = ["winding", "stator", "rotor"]
links = [["winding", "stator"], ["stator", "rotor"], ["stator", "ambient"]]
losses = { copper = "winding", iron = "stator", mechanical = "rotor" }
by_speed = ["mechanical"]
sensors = { winding_degC = "winding", stator_degC = "stator", rotor_degC = "rotor" }
"""
T0 = 22.0


def rpm(t):
    return np.array([1000.0, 5000.0, 0.0, 3000.0, 6000.0, 2000.0])[
        np.minimum((np.asarray(t) // 1000.0).astype(int), 5)
    ]


def iron(t):
    """Iron loss [W]: by the speed, and by the load too."""
    return 60.0 * rpm(t) / 1000.0 + 100.0 * (np.asarray(t) % 1500.0 < 900.0)


def friction(t):
    s = rpm(t) / 1000.0
    return TRUTH["P_mechanical_n"] * s + TRUTH["P_mechanical_n2"] * s**2


def course(time):
    """Temperatures of winding, stator and rotor [degC]."""
    p = TRUTH

    def slope(t, T):
        winding, stator, rotor = T
        into = (winding - stator) / p["Req_winding_stator"]
        on = (stator - rotor) / p["Req_stator_rotor"]
        out = (stator - T0) / p["Req_stator_ambient"]
        return [
            (copper(t, winding) - into) / p["Ceq_winding"],
            (iron(t) + into - on - out) / p["Ceq_stator"],
            (friction(t) + on) / p["Ceq_rotor"],
        ]

    return integrated(slope, [T0, T0, T0], time, max_step=1.0)


def record(seed=17, *, kind="balance"):
    """A record at 1 Hz; 0.1 K of noise, rounded to 0.1 K.

    With `kind="map"` the losses are those of the iron alone.
    """
    time = np.arange(0.0, 6000.0, 1.0)
    winding, stator, rotor = course(time)
    rng = np.random.default_rng(seed)

    # the sample at the end of a second holds what the second held
    held = np.maximum(time - 0.5, 0.0)
    losses = iron(held)
    if kind == "balance":
        losses = losses + friction(held) + copper(held, winding)
    return Record(
        "duty",
        {
            "time_s": time,
            "phase_current_A": amperes(held),
            "losses_W": losses,
            "ambient_degC": np.full(time.size, T0),
            "speed_rpm": rpm(held),
            "winding_degC": read(winding, rng),
            "stator_degC": read(stator, rng),
            "rotor_degC": read(rotor, rng),
        },
    )
