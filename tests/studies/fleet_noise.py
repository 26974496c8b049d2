"""Study of noise, unmodelled heat and a named effect over fleets: a part of `make study-fleet`.

Writes rows and table under `results/fleet/`. Seeds below 61000 were used to try it; reports use
those from `SEED` on. Each fleet goes the user's way: fleet, population, and the next machines. Rows
go to a file as they come; a run that was cut short goes on from there.
"""

import json
import os
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small; threads only wait

import numpy as np
from fleet import fleet_options, population_of, rows_of
from fleet_cases import NAMES
from fleet_noise_cases import (
    EFFECT,
    HEATS,
    IRON_SPREAD,
    NOISE,
    NoisyFleet,
    draw_noisy_fleet,
    write_noisy_fleet,
)
from gate_rows import at_least, at_most, covered, heads, percent_95, rms, times_better
from study_runs import Row, run_study, temporary

import heatrun

SEED = 61_000
"""First of the reporting seeds."""


TEST_MIN, NEXT_MIN, NUM_NEXT = 120.0, 10.0, 20
"""Length of the tests of the machines that make the type, and of those that come after it [min];
number of the latter."""


TIMES_BETTER = 2.0
"""By which sisters are to reduce the error of Req_sr from a test of ten minutes [1]."""


def run(job: Row) -> Row:
    """Return the row of a fleet: `seed`, `machines`, `has_effect`, `heat`, and `workers`."""
    begin = time.monotonic()
    num = job["machines"]
    fleet = draw_noisy_fleet(
        job["seed"], num + NUM_NEXT, has_effect=job["has_effect"], heat=job["heat"]
    )
    with temporary() as folder:
        path = write_noisy_fleet(
            fleet, folder / "bench", job["seed"], minutes=TEST_MIN, places=range(num)
        )
        out = heatrun.calibrate_fleet(path, out=folder / "fleet", workers=job["workers"]).path
        content, rows = population_of(out, folder / "type")
        following = {
            how: _following(fleet, folder, how, motor, job)
            for how, motor in (("alone", ""), ("sisters", '[population]\nrun = "../type"\n'))
        }
    return {
        **job,
        "is_converged": content["is_converged"] and content["noise"]["is_converged"],
        "left_out": content["left_out"],
        "type": _type(fleet, content),
        "heat_of_the_next": _heat_of_the_next(fleet, content, num),
        "machines_found": [_machine(fleet, row) for row in rows if row["status"] == "used"],
        "next": following,
        "processor_s": time.monotonic() - begin,
    }


def _following(fleet: NoisyFleet, folder: Path, how: str, motor: str, job: Row) -> list[Row]:
    """Return errors of the logarithms of the machines that come after the type was known."""
    places = range(job["machines"], job["machines"] + NUM_NEXT)
    path = write_noisy_fleet(
        fleet, folder / how, job["seed"], minutes=NEXT_MIN, places=places, motor=motor
    )
    heatrun.calibrate_fleet(path, out=folder / f"out_{how}", workers=job["workers"])
    found = []
    for row in rows_of(folder / f"out_{how}" / "machines.parquet"):
        if row["status"] != "fitted":
            found.append({"machine": row["machine"], "status": row["status"]})
            continue
        at = [row["parameters"].index(name) for name in NAMES]
        size = len(row["parameters"])
        mean = np.array(row["log_mean"])[at]
        sd = np.sqrt(np.diag(np.reshape(row["log_covariance"], (size, size))))[at]
        error = mean - fleet.machines.logs[int(row["machine"][1:])]
        found.append(
            {"machine": row["machine"], "status": row["status"], "error": error.round(5).tolist(),
             "is_inside": (np.abs(error) <= 1.96 * sd).tolist(), "sd": sd.round(5).tolist()}
        )  # fmt: skip
    return found


def _type(fleet: NoisyFleet, content: Row) -> list[Row]:
    rows = []

    def add(of: str, name: str, kind: str, truth: float, entry: Row) -> None:
        low, high = entry["interval_95"]
        rows.append({"of": of, "name": name, "kind": kind, "truth": float(truth),
                     "value": entry["value"], "low": low, "high": high})  # fmt: skip

    used = [int(machine["name"][1:]) for machine in content["machines"]]
    middle = np.exp(fleet.machines.middle([fleet.machines.machines[place] for place in used]))
    for place, name in enumerate(NAMES):
        add("network", name, "median", middle[place], content["parameters"][name]["median"])
    for place, name in enumerate(NOISE):
        said = content["noise"]["parameters"][name]
        add("noise", name, "median", np.exp(fleet.noise_mean[place]), said["median"])
        add("noise", name, "spread", np.expm1(fleet.noise_sd[place]), said["spread"])
    if fleet.iron_median_W > 0.0:
        said = content["parameters"][f"{EFFECT}.k"]
        add("effect", EFFECT, "median", fleet.iron_median_W, said["median"])
        add("effect", EFFECT, "spread", np.expm1(IRON_SPREAD), said["spread"])
    return rows


def _heat_of_the_next(fleet: NoisyFleet, content: Row, num: int) -> list[bool]:
    low, high = content["noise"]["parameters"]["unmodelled_heat"]["next_interval_95"]
    return [bool(low <= heat <= high) for heat in np.exp(fleet.noise[num:, 3])]


def _machine(fleet: NoisyFleet, row: Row) -> Row:
    place = int(row["machine"][1:])
    found: Row = {
        "machine": row["machine"],
        "is_other": bool(fleet.is_other[place]),
        "probability": row["noise_outlier_probability"],
        "is_outlier": row["is_outlier"],
    }
    if row["noise"]:
        truth = np.exp(fleet.noise[place])
        low, high = (np.array(row[f"noise_given_{end}_95"]) for end in ("low", "high"))
        found["noise_inside"] = ((low <= truth) & (truth <= high)).tolist()
        found["heat_error"] = [
            float(np.log(row[f"noise_{how}_values"][3] / truth[3])) for how in ("alone", "given")
        ]
    at = [row["parameters"].index(name) for name in NAMES]
    truth = np.exp(fleet.machines.logs[place])
    for how in ("alone", "given"):
        low, high = (np.array(row[f"{how}_{end}_95"])[at] for end in ("low", "high"))
        found[f"inside_{how}"] = ((low <= truth) & (truth <= high)).tolist()
    if fleet.iron_median_W > 0.0:
        k = row["parameters"].index(f"{EFFECT}.k")
        found["effect_inside"] = bool(
            row["given_low_95"][k] <= fleet.iron_W[place] <= row["given_high_95"][k]
        )
    return found


def main() -> None:
    options = fleet_options(__doc__, SEED, fleets=12, machines=50)
    size = {"machines": options.machines, "workers": options.workers}
    jobs = [
        {"seed": options.seed + number, **size, "has_effect": number % 2 == 1,
         "heat": HEATS[number // 2 % 2]}
        for number in range(options.fleets)
    ]  # fmt: skip
    files = "noise_rows.json", "noise.md"
    page = lambda rows: table(rows, json.loads((options.out / files[0]).read_bytes()))  # noqa: E731
    run_study(options, jobs, run, page, files=files, same="machines")


def table(rows: Sequence[Row], said: Row) -> str:
    machines = [each for row in rows for each in row["machines_found"]]
    of_type = [each for row in rows for each in row["type"]]
    with_effect = sum(row["has_effect"] for row in rows)
    usual = [m["noise_inside"] for m in machines if "noise_inside" in m and not m["is_other"]]
    lines = [
        "# Noise, unmodelled heat and a named effect over fleets",
        "",
        f"`python tests/studies/fleet_noise.py` (`make study-fleet`), seeds from {said['seed']} "
        f"on; {len(rows)} of {said['planned']} fleets, {len(machines)} machines that count, of "
        f"tests of {TEST_MIN:.0f} min. Two-node machines by NumPy after Runge and Kutta; slow and "
        "white noise of the winding and heat that nobody measures differ from machine to machine, "
        "the heat of a usual size in half of the types and three times that in the others; "
        f"{with_effect} types warm the winding with a part of their iron loss, and their motor "
        "file names the effect. The heat is smoother than the process that heatrun takes it for. "
        "In 5 % of the machines the slow noise or the heat is 5 to 9 times as large. Through "
        "`heatrun.calibrate_fleet` and `heatrun population`, back from the files. Then "
        f"{NUM_NEXT} further machines of each type with a test of {NEXT_MIN:.0f} min under one "
        "load, with and without `[population]`. Limits: 95 % after Clopper and Pearson.",
        "",
        *heads("95 % intervals | gate | hold the truth | limits | "),
        *(covered(what, _inside(of_type, of, kind)) for what, of, kind in TYPES),
        *_by_heat(rows),
        covered("noise and heat of each machine", _flat(usual)),
        covered("heat of the next machine", _flat(row["heat_of_the_next"] for row in rows)),
        covered("parameters of each machine", _flat(m["inside_given"] for m in machines)),
        covered("effect of each machine",
                 [m["effect_inside"] for m in machines if "effect_inside" in m]),
        "",
        *heads("what | gate | found | limits | "),
        at_least("machines with another noise found", 0.90, _called(machines, is_other=True)),
        at_most("called so though they are none", 0.02, _called(machines, is_other=False)),
        at_most("called another motor, which none is", 0.02, [m["is_outlier"] for m in machines]),
        "",
        *heads(" | ".join([f"a test of {NEXT_MIN:.0f} min: RMSE of the logarithm", *NAMES,
                           "95 % intervals that hold the truth"])),
        *(_next(rows, how, words) for how, words in HOW),
        "",
        _better(rows),
        "",
        f"Converged: {sum(row['is_converged'] for row in rows)} of {len(rows)} populations. Left "
        f"out: {sum(len(row['left_out']) for row in rows)} machines. "
        f"{sum(row['processor_s'] for row in rows) / 60:.0f} min in all. What the calibrations "
        "call noise and heat holds whatever else the network leaves.",
        "",
        f"`{said['command']}`, {', '.join(f'{k} {v}' for k, v in said['versions'].items())}.",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


TYPES = (
    ("medians of the network's parameters", "network", "median"),
    ("medians of noise and heat", "noise", "median"),
    ("spreads of noise and heat", "noise", "spread"),
    ("medians of the effect", "effect", "median"),
    ("spreads of the effect", "effect", "spread"),
)


def _by_heat(rows: Sequence[Row]) -> list[str]:
    lines = []
    for heat in sorted({row["heat"] for row in rows}):
        of_type = [each for row in rows if row["heat"] == heat for each in row["type"]]
        for name in NOISE:
            own = [each for each in of_type if (each["name"], each["kind"]) == (name, "median")]
            off = np.median([np.log(each["value"] / each["truth"]) for each in own])
            inside = _inside(own, "noise", "median")
            lines.append(
                f"| – of {name}, types with {100 * heat:g} % of heat | | {sum(inside)} of "
                f"{len(inside)} | | off by {100 * np.expm1(off):+.0f} % (median) |"
            )
    return lines


HOW = (("alone", "its own test alone"), ("sisters", "`[population]`"))


def _inside(entries: Sequence[Row], of: str, kind: str) -> list[bool]:
    return [each["low"] <= each["truth"] <= each["high"] for each in entries
            if (each["of"], each["kind"]) == (of, kind)]  # fmt: skip


def _flat(lists: Iterable[Sequence[bool]]) -> list[bool]:
    return [each for one in lists for each in one]


def _called(machines: Sequence[Row], *, is_other: bool) -> list[bool]:
    return [m["probability"] > 0.5 for m in machines
            if m["probability"] is not None and m["is_other"] == is_other]  # fmt: skip


def _next(rows: Sequence[Row], how: str, words: str) -> str:
    found = [each for row in rows for each in row["next"][how]]
    fitted = [each for each in found if "error" in each]
    inside = _flat(each["is_inside"] for each in fitted)
    cells = " | ".join(f"{100 * each:.1f} %" for each in rms([each["error"] for each in fitted]))
    return (
        f"| {words} ({len(fitted)} of {len(found)} fitted) | {cells} | "
        f"{100 * np.mean(inside):.1f} % ({percent_95(sum(inside), len(inside))}) |"
    )


def _better(rows: Sequence[Row]) -> str:
    place = NAMES.index("Req_sr")
    pairs = [
        (alone["error"][place], sister["error"][place])
        for row in rows
        for alone, sister in zip(row["next"]["alone"], row["next"]["sisters"], strict=True)
        if "error" in alone and "error" in sister
    ]
    alone, sister = np.array(pairs).T
    ratio, low, high, mark = times_better(alone, sister, TIMES_BETTER)
    return (
        f"RMSE of Req_sr, alone over with sisters: {ratio:.1f} ({low:.1f}…{high:.1f}); at least "
        f"{TIMES_BETTER:.0f}: {mark}."
    )


if __name__ == "__main__":
    main()
