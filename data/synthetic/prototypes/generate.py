"""Writes a drive on two prototypes: `python data/synthetic/prototypes/generate.py`.

One truth, two recordings. A small electric car drives a town cycle; the bench (semi-real
prototype) records it with the instruments of a laboratory, the car itself (real prototype) with its
own logger, which was started earlier, samples more coarsely and has a winding sensor that reads
high and a current sensor with a zero error. What differs is therefore known and stands in
`truth.json`. No code is shared with the packages.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 20240305
STEP_S = 0.05
BENCH_EVERY, ROAD_EVERY = 4, 20  # 5 Hz and 1 Hz

LEGS = (  # speed [km/h] to reach, acceleration [m/s^2], seconds held
    (0, 1.0, 20), (32, 0.9, 25), (0, 0.8, 12), (50, 1.0, 60), (30, 0.7, 20), (50, 0.8, 40),
    (0, 1.1, 20), (15, 0.6, 15), (0, 0.9, 10), (70, 1.0, 90), (50, 0.6, 30), (0, 1.2, 25),
    (35, 1.1, 35), (20, 0.7, 12), (60, 1.0, 70), (0, 0.9, 18), (50, 1.0, 45), (0, 0.7, 30),
    (70, 0.9, 120), (40, 0.8, 30), (0, 1.0, 20), (28, 0.8, 22), (0, 0.8, 40),
)  # fmt: skip

CAR = {
    "mass_kg": 1120.0,
    "rolling_coefficient": 0.011,
    "drag_area_m2": 0.62,
    "gear_ratio": 9.1,
    "wheel_radius_m": 0.29,
    "gear_efficiency": 0.96,
    "recuperation_limit_Nm": 38.0,
    "battery_V": 144.0,
    "battery_ohm": 0.03,
    "auxiliaries_W": 180.0,
    "inverter_share": 0.025,
    "torque_per_ampere_Nm": 0.46,
    "idle_current_A": 9.0,
}
MOTOR = {
    "phase_resistance_ohm": 0.0062,
    "reference_degC": 25.0,
    "B_degC": 234.5,
    "Ceq_w": 666.75,
    "Ceq_sr": 15060.1,
    "Req_w": 0.14485,
    "Req_sr": 0.11625,
    "hysteresis_W": 210.0,
    "eddy_W": 260.0,
    "rated_speed_rpm": 6000.0,
}
ROAD = {"started_earlier_s": 37.4, "winding_reads_high_K": 3.0, "current_zero_A": -1.5}


def drive() -> np.ndarray:
    """Return the speed of the car at every step [m/s], shape (time,)."""
    speed = [0.0]
    for target_km_per_h, acceleration, held_s in LEGS:
        target = target_km_per_h / 3.6
        num_ramp = max(round(abs(target - speed[-1]) / acceleration / STEP_S), 1)
        speed += list(np.linspace(speed[-1], target, num_ramp + 1)[1:])
        speed += [target] * round(held_s / STEP_S)
    # a driver rounds every corner: a moving mean over 2 s
    width = round(2.0 / STEP_S)
    padded = np.concatenate((np.full(width, speed[0]), speed, np.full(width, speed[-1])))
    return np.convolve(padded, np.full(width, 1.0 / width), mode="same")[width:-width]


def simulate(v: np.ndarray) -> dict[str, np.ndarray]:
    """Return what truly happened along a drive, by column of the bench."""
    g, air = 9.81, 1.2
    acceleration = np.gradient(v, STEP_S)
    force = (
        CAR["mass_kg"] * acceleration
        + CAR["mass_kg"] * g * CAR["rolling_coefficient"] * (v > 0.01)
        + 0.5 * air * CAR["drag_area_m2"] * v**2
    )
    at_motor = force * CAR["wheel_radius_m"] / CAR["gear_ratio"]
    torque = np.where(
        at_motor > 0.0, at_motor / CAR["gear_efficiency"], at_motor * CAR["gear_efficiency"]
    )
    torque = np.maximum(torque, -CAR["recuperation_limit_Nm"])  # the brakes take the rest
    omega = v / CAR["wheel_radius_m"] * CAR["gear_ratio"]
    share = omega * 30.0 / np.pi / MOTOR["rated_speed_rpm"]
    turning = np.hypot(CAR["idle_current_A"], torque / CAR["torque_per_ampere_Nm"])
    current = np.where(omega > 1.0, turning, np.abs(torque) / CAR["torque_per_ampere_Nm"])
    other = MOTOR["hysteresis_W"] * share + MOTOR["eddy_W"] * share**2
    time_s = np.arange(v.size) * STEP_S
    ambient = 21.0 + 0.6 * time_s / 3600.0
    joule, winding = _heat(current, other, ambient)
    losses = joule + other
    shaft = torque * omega
    terminals = shaft + losses
    power = terminals + CAR["inverter_share"] * np.abs(terminals) + CAR["auxiliaries_W"]
    root = np.sqrt(CAR["battery_V"] ** 2 - 4.0 * CAR["battery_ohm"] * power)
    dc_current = (CAR["battery_V"] - root) / (2.0 * CAR["battery_ohm"])
    return {
        "time_s": time_s,
        "vehicle_speed_km_per_h": 3.6 * v,
        "speed_rpm": omega * 30.0 / np.pi,
        "torque_Nm": torque,
        "dc_voltage_V": CAR["battery_V"] - CAR["battery_ohm"] * dc_current,
        "dc_current_A": dc_current,
        "phase_current_A": current,
        "losses_W": losses,
        "ambient_degC": ambient,
        "winding_degC": winding,
    }


def _heat(
    current: np.ndarray, other: np.ndarray, ambient: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joule loss [W] and winding temperature [degC], by explicit steps far below its 97 s."""
    winding, stator = np.empty_like(current), ambient[0]
    joule = np.empty_like(current)
    T = ambient[0]
    for k in range(current.size):
        R = MOTOR["phase_resistance_ohm"] * (MOTOR["B_degC"] + T)
        joule[k] = 3.0 * current[k] ** 2 * R / (MOTOR["B_degC"] + MOTOR["reference_degC"])
        winding[k] = T
        to_stator = (T - stator) / MOTOR["Req_w"]
        to_air = (stator - ambient[k]) / MOTOR["Req_sr"]
        T += STEP_S * (joule[k] - to_stator) / MOTOR["Ceq_w"]
        stator += STEP_S * (other[k] + to_stator - to_air) / MOTOR["Ceq_sr"]
    return joule, winding


BENCH = {  # white noise (standard deviation) and decimals written
    "time_s": (0.0, 1), "vehicle_speed_km_per_h": (0.02, 2), "speed_rpm": (0.8, 0),
    "torque_Nm": (0.1, 2), "dc_voltage_V": (0.02, 2), "dc_current_A": (0.05, 2),
    "phase_current_A": (0.05, 2), "losses_W": (2.0, 1), "ambient_degC": (0.03, 1),
    "winding_degC": (0.1, 1),
}  # fmt: skip
LOGGER = {
    "time_s": (0.0, 0), "vehicle_speed_km_per_h": (0.1, 1), "speed_rpm": (4.0, 0),
    "dc_voltage_V": (0.1, 1), "dc_current_A": (0.3, 1), "ambient_degC": (0.1, 1),
    "winding_degC": (0.2, 0),
}  # fmt: skip


def on_the_bench(truth: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """Return the bench's CSV."""
    return _csv({name: truth[name][::BENCH_EVERY] for name in BENCH}, BENCH, rng)


def on_the_road(truth: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """Return the CSV of the car's logger, which ran before the drive began."""
    clock = np.arange(0.0, truth["time_s"][-1], STEP_S * ROAD_EVERY)
    moment = clock - ROAD["started_earlier_s"]  # before the drive, all stands still
    columns = {name: np.interp(moment, truth["time_s"], truth[name]) for name in LOGGER}
    columns["time_s"] = clock
    columns["winding_degC"] = columns["winding_degC"] + ROAD["winding_reads_high_K"]
    columns["dc_current_A"] = columns["dc_current_A"] + ROAD["current_zero_A"]
    return _csv(columns, LOGGER, rng)


def _csv(
    columns: dict[str, np.ndarray],
    instruments: dict[str, tuple[float, int]],
    rng: np.random.Generator,
) -> str:
    streams = rng.spawn(len(columns))
    noisy = [
        values + instruments[name][0] * stream.standard_normal(values.size)
        for (name, values), stream in zip(columns.items(), streams, strict=True)
    ]
    decimals = [instruments[name][1] for name in columns]
    lines = [",".join(columns)]
    lines += [
        ",".join(f"{x:.{places}f}" for x, places in zip(row, decimals, strict=True))
        for row in zip(*noisy, strict=True)
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write both records, the motor file and the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE)
    folder = parser.parse_args().out
    truth = simulate(drive())
    bench, road = np.random.default_rng(SEED).spawn(2)
    for name, text in (
        ("Test_2024_03_05_001", on_the_bench(truth, bench)),
        ("Road_2024_03_05_001", on_the_road(truth, road)),
    ):
        packed = io.BytesIO()
        with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as stream:
            stream.write(text.encode())
        (folder / f"{name}.csv.gz").write_bytes(packed.getvalue())
    (folder / "motor.toml").write_text(
        f"""[motor]
name = "Retrofit IPM-SynRel"
losses = "balance"
insulation_class = "F"
rated_speed_rpm = {MOTOR["rated_speed_rpm"]:.0f}

[winding]
material = "copper"
phase_resistance_ohm = {MOTOR["phase_resistance_ohm"]}
reference_temperature_degC = {MOTOR["reference_degC"]}

[vehicle]
gear_ratio = {CAR["gear_ratio"]}
wheel_radius_m = {CAR["wheel_radius_m"]}
""",
        encoding="utf-8",
    )
    content = {"car": CAR, "motor": MOTOR, "road_logger": ROAD, "seed": SEED}
    (folder / "truth.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
