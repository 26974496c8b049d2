"""Bodies that no motor test resembles: a heater in a block, a coil under direct current.

Integrated here in explicit steps of a second, in plain NumPy.
"""

import numpy as np
import pandas as pd

BLOCK = {"Ceq": 700.0, "Req": 1.1}
COIL = {"Ceq_w": 60.0, "Ceq_sr": 900.0, "Req_w": 0.9, "Req_sr": 1.4}
COIL_OHM, LEADS_SHARE, ROOM = 0.42, 0.35, 22.0


def read(course, rng):
    return np.round(course + 0.05 * rng.standard_normal(course.size), 1)


def heater(folder, more=""):
    """A block with a heater: no current, no resistance. Returns motor file and test."""
    rng = np.random.default_rng(5)
    t = np.arange(5400.0)
    power = np.where((t > 60) & (t < 2400), 30.0, 0.0) + np.where(t > 3600, 15.0, 0.0)
    room = 21.0 + 0.3 * np.sin(t / 900.0)
    T = np.full(t.size, 21.0)
    for i in range(1, t.size):
        T[i] = T[i - 1] + (power[i - 1] - (T[i - 1] - room[i - 1]) / BLOCK["Req"]) / BLOCK["Ceq"]
    columns = {"time_s": t, "heater [W]": power, "ambient_degC": room, "block [degC]": read(T, rng)}
    pd.DataFrame(columns).to_csv(folder / "heater.csv", index=False)
    (folder / "heater.toml").write_text(
        '[motor]\nname = "block"\n'
        '[columns]\nlosses_W = "heater [W]"\nwinding_degC = "block [degC]"\n'
        f"[constants]\n{more}\n"
    )
    return folder / "heater.toml", folder / "heater.csv"


def coil(folder, *, has_power):
    """A coil under direct current in a room that is held; with the power at the meter, or not."""
    rng = np.random.default_rng(6)
    t = np.arange(7200.0)
    current = np.where((t > 60) & (t < 3600), 8.0, 0.0) + np.where(
        (t > 4800) & (t < 6300), 5.0, 0.0
    )
    winding, body = np.full(t.size, ROOM), np.full(t.size, ROOM)
    for i in range(1, t.size):
        heat = current[i - 1] ** 2 * COIL_OHM * (234.5 + winding[i - 1]) / 259.5
        flow = (winding[i - 1] - body[i - 1]) / COIL["Req_w"]
        out = (body[i - 1] - ROOM) / COIL["Req_sr"]
        winding[i] = winding[i - 1] + (heat - flow) / COIL["Ceq_w"]
        body[i] = body[i - 1] + (flow - out) / COIL["Ceq_sr"]
    columns = {"time_s": t, "I [A]": current, "winding_degC": read(winding, rng)}
    text = '[motor]\nname = "coil"\nphases = 1\n'
    constants = f"[constants]\nambient_degC = {ROOM}\n"
    if has_power:
        ohm = COIL_OHM * ((234.5 + winding) / 259.5 + LEADS_SHARE)
        columns["P [W]"] = ohm * current**2
        mapped = 'losses_W = "P [W]"\n'
        constants += "speed_rpm = 0\n"
    else:
        text += 'losses = "map"\n'
        mapped = ""
        constants += "losses_W = 0\n"
    pd.DataFrame(columns).to_csv(folder / "coil.csv", index=False)
    (folder / "coil.toml").write_text(
        f"{text}[winding]\nphase_resistance_ohm = {COIL_OHM}\n"
        f'[columns]\nphase_current_A = "I [A_rms]"\n{mapped}{constants}'
    )
    return folder / "coil.toml", folder / "coil.csv"
