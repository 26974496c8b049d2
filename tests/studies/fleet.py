"""Study of populations: `make study-fleet`.

Writes rows and table under `results/fleet/`. Seeds below 50000 were used to tune; reports use those
from `SEED` on. Each fleet goes the user's way: fleet command, its folder, population, its folder.
Rows go to a file as they come; a run that was cut short goes on from there.
"""

import json
import os
import time
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small; threads only wait

import numpy as np
from fleet_cases import NAMES, SHORT_MIN, Fleet, draw_fleet, write_fleet
from gate_rows import at_least, at_most, covered, heads, rms, times_better
from study_runs import Row, options_of, run_study, temporary

import heatrun
from heatrun import cli

SEED = 50_000
"""First of the reporting seeds."""


WITHIN = 0.05
"""How near the two stages are to come to one [1]."""

TIMES_BETTER = 2.0
"""By which pooling is to reduce the error of a short test's Req_sr [1]."""


def run(job: Row) -> Row:
    """Return the row of a fleet: `seed`, `machines`, and `workers` for its calibrations."""
    begin = time.monotonic()
    fleet = draw_fleet(job["seed"], job["machines"])
    with temporary() as folder:
        path = write_fleet(fleet, folder / "bench", job["seed"])
        calibrated = heatrun.calibrate_fleet(path, out=folder / "fleet", workers=job["workers"])
        content, rows = population_of(calibrated.path, folder / "type", "--covariate", "supplier")
    table = [row for row in rows if row["status"] == "used"]
    return {
        **job,
        "is_converged": content["is_converged"],
        "method": content["method"],
        "left_out": content["left_out"],
        "population": _population(fleet, content),
        "machines_found": _machines(fleet, table),
        "processor_s": time.monotonic() - begin,
    }


def population_of(fleet: Path, out: Path, *words: str) -> tuple[Row, list[Row]]:
    code = cli.main(["population", str(fleet), *words, "--out", str(out)])
    if code != 0:
        raise SystemExit(f"the population of {fleet} ended with {code}")
    return json.loads((out / "population.json").read_bytes()), rows_of(out / "population.parquet")


def rows_of(path: Path) -> list[Row]:
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        return file.read().to_pylist()


def _population(fleet: Fleet, content: Row) -> list[Row]:
    used = [machine["name"] for machine in content["machines"]]
    middle = np.exp(fleet.middle(used))
    (label,) = content["covariates"]
    sign = 1.0 if label == "supplier=south" else -1.0
    rows = []
    for place, name in enumerate(NAMES):
        said = content["parameters"][name]
        effect = content["covariates"][label][name]
        for kind, truth, entry in (
            ("median", middle[place], said["median"]),
            ("spread", np.expm1(fleet.sd[place]), said["spread"]),
            ("supplier", np.expm1(sign * fleet.supplier[place]), effect),
        ):
            low, high = entry["interval_95"]
            rows.append(
                {"kind": kind, "parameter": name, "truth": float(truth), "value": entry["value"],
                 "low": low, "high": high}
            )  # fmt: skip
    return rows


def _machines(fleet: Fleet, table: list[Row]) -> list[Row]:
    """Return each machine's errors of the logarithms, alone and given all, and whether it fits."""
    rows = []
    for row in table:
        place = int(row["machine"][1:])
        truth = np.exp(fleet.logs[place])
        at = [row["parameters"].index(name) for name in NAMES]

        def numbers(column: str, row: Row = row, at: list[int] = at) -> np.ndarray:
            return np.array(row[column])[at]

        is_inside = (numbers("given_low_95") <= truth) & (truth <= numbers("given_high_95"))
        is_inside_alone = (numbers("alone_low_95") <= truth) & (truth <= numbers("alone_high_95"))
        rows.append(
            {
                "is_short": bool(fleet.minutes[place] == SHORT_MIN),
                "is_outlier": bool(fleet.is_outlier[place]),
                "odd": NAMES[fleet.odd[place]] if fleet.odd[place] >= 0 else "",
                "outlier_probability": row["outlier_probability"],
                "different": row["different"],
                "error_alone": np.log(numbers("alone_values") / truth).round(5).tolist(),
                "error_given": np.log(numbers("given_values") / truth).round(5).tolist(),
                "is_inside": is_inside.tolist(),
                "is_inside_alone": is_inside_alone.tolist(),
            }
        )
    return rows


def main() -> None:
    options = fleet_options(__doc__, SEED, fleets=10, machines=200)
    size = {"machines": options.machines, "workers": options.workers}
    jobs = [{"seed": options.seed + number, **size} for number in range(options.fleets)]
    files = "population_rows.json", "population.md"

    def page(rows: list[Row]) -> str:
        one_stage, said = (options.out / name for name in ("one_stage.json", files[0]))
        compared = json.loads(one_stage.read_text()) if one_stage.exists() else None
        return table(rows, compared, json.loads(said.read_text(encoding="utf-8")))

    run_study(options, jobs, run, page, files=files, same="machines")


def fleet_options(doc: str | None, seed: int, **counts: int) -> Namespace:
    """Return the options of a study of fleets, each of which starts workers of its own."""
    parser = options_of(doc, "fleet", seed, **counts)
    parser.add_argument("--workers", type=int, default=2, help="processes of a fleet")
    parser.set_defaults(processes=0)
    return parser.parse_args()


def table(rows: Sequence[Row], one_stage: Row | None, said: Row) -> str:
    machines = [each for row in rows for each in row["machines_found"]]
    num = sum(row["machines"] for row in rows)
    lines = [
        "# Populations of simulated fleets",
        "",
        f"`make study-fleet`, seeds from {said['seed']} on; {len(rows)} of {said['planned']} "
        f"fleets, {num} machines in all. Two-node machines integrated by NumPy after Runge and "
        "Kutta, half of them with a test of 30 minutes under one load, half with one of two hours "
        "under a staircase; two suppliers; 5 % of the machines are something else in one "
        "parameter, by 35…55 % of its logarithm; type, correlations, supplier and instruments "
        "drawn, the errors of the instruments as heatrun's priors have them and each machine's its "
        "own; noise with a slow part of 0.15 K over 40 s and a white one of 0.1 K. Through "
        "`heatrun.calibrate_fleet` and `heatrun population --covariate supplier`, "
        "and back from the files. Limits: 95 % after Clopper and Pearson.",
        "",
        *heads("what | gate | found | limits | "),
        *_coverage(rows),
        _rmse(machines),
        at_least("outliers found", 0.90, _flags(machines, is_outlier=True)),
        at_most("machines called outliers that are none", 0.02, _flags(machines, is_outlier=False)),
        "",
        *heads("among them |  | found | limits | "),
        *_outliers_by_test(machines),
        _named(machines),
        "",
        *heads("95 % intervals of machines that fit | alone | given all"),
        *_machines_covered(machines),
        "",
        *heads(" | ".join(["RMSE of the logarithm [%]", *NAMES])),
        *_errors(machines),
        "",
        f"Left out: {sum(len(row['left_out']) for row in rows)} of {num} machines. Converged: "
        f"{sum(row['is_converged'] for row in rows)} of {len(rows)} populations.",
        "",
        f"`{said['command']}`, {', '.join(f'{k} {v}' for k, v in said['versions'].items())}.",
    ]
    return "\n".join([*lines, *_one_stage(one_stage)]) + "\n"


def _coverage(rows: Sequence[Row]) -> list[str]:
    every = [each for row in rows for each in row["population"]]
    kinds = [("all parameters of the population", every)]
    kinds += [(kind, [each for each in every if each["kind"] == kind])
              for kind in ("median", "spread", "supplier")]  # fmt: skip
    return [
        covered(f"95 % intervals, {what}", [e["low"] <= e["truth"] <= e["high"] for e in entries])
        for what, entries in kinds
        if entries
    ]


def _rmse(machines: Sequence[Row]) -> str:
    place = NAMES.index("Req_sr")
    short = [each for each in machines if each["is_short"] and not each["is_outlier"]]
    alone, given = (
        np.array([each[key][place] for each in short]) for key in ("error_alone", "error_given")
    )
    what = f"| RMSE of Req_sr from 30 min, alone over pooled | ≥ {TIMES_BETTER:.0f}"
    if not short:
        return f"{what} | – | – | – |"
    ratio, low, high, mark = times_better(alone, given, TIMES_BETTER)
    return (
        f"{what} | {ratio:.2f} ({100 * rms(alone):.1f} % to {100 * rms(given):.1f} %, "
        f"{len(short)} machines) | {low:.2f}…{high:.2f} | {mark} |"
    )


def _flags(machines: Sequence[Row], *, is_outlier: bool) -> list[bool]:
    return [
        each["outlier_probability"] > 0.5 for each in machines if each["is_outlier"] == is_outlier
    ]


def _outliers_by_test(machines: Sequence[Row]) -> list[str]:
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [each for each in machines if each["is_short"] == is_short]
        lines.append(at_least(f"outliers found, {words}", 0.90, _flags(own, is_outlier=True)))
        lines.append(at_most(f"called outliers, {words}", 0.02, _flags(own, is_outlier=False)))
    return lines


def _named(machines: Sequence[Row]) -> str:
    found = [each for each in machines if each["is_outlier"] and each["outlier_probability"] > 0.5]
    named = [each["odd"] in each["different"] for each in found]
    return at_least("of the found ones, the parameter named that differs", 0.90, named)


def _machines_covered(machines: Sequence[Row]) -> list[str]:
    fits = [each for each in machines if not each["is_outlier"]]
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [each for each in fits if each["is_short"] == is_short]
        shares = []
        for key in ("is_inside_alone", "is_inside"):
            inside = np.array([each[key] for each in own], dtype=bool).reshape(len(own), -1)
            shares.append(f"{100 * inside.mean():.1f} % ({int(inside.sum())} of {inside.size})")
        lines.append(f"| {words} | {shares[0]} | {shares[1]} |")
    return lines


def _errors(machines: Sequence[Row]) -> list[str]:
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [e for e in machines if e["is_short"] == is_short and not e["is_outlier"]]
        for key, how in (("error_alone", "alone"), ("error_given", "given all")):
            errors = np.array([each[key] for each in own]).reshape(-1, len(NAMES))
            cells = " | ".join(f"{100 * rms(column):.2f}" for column in errors.T)
            lines.append(f"| {words}, {how} | {cells} |")
    return lines


def _one_stage(found: Row | None) -> list[str]:
    if found is None:
        return ["", "One stage was not run."]
    entries = [row for row in found["compared"] if row["kind"] != "supplier"]
    apart = {
        f"{row['kind']} of {row['parameter']}": row["two"][1] / row["one"][1] - 1.0
        for row in entries
    }
    far = [f"{name} ({100 * by:+.0f} %)" for name, by in apart.items() if abs(by) > WITHIN]
    said = f"Two stages within {100 * WITHIN:.0f} % of one stage: {len(apart) - len(far)} of "
    said += f"{len(apart)} medians and spreads{'; not ' + ', '.join(far) if far else ''}."
    return ["", "## One stage", "", *found["lines"], "", said]


if __name__ == "__main__":
    main()
