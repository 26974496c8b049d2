"""One motor in one afternoon, from parts of its record: `make study-paderborn`.

Profile 24 of the Paderborn motor (W. Kirchgässner, O. Wallscheid, J. Böcker, Electric Motor
Temperature, 2021) whole, its heating and its cooling, each without a measured body and with yoke or
tooth fitted as the stator node, through `heatrun calibrate`. The four parameters belong to one
machine: their intervals should overlap, or a finding say why they may not.
Networks in which tooth and yoke are nodes of their own are in `real_records.py`. The record is not
part of the project: without it, nothing is done.
"""

import argparse
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
from study_runs import put, temporary

import heatrun
from heatrun.runs.verdict import headline

PARAMETERS = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
BENCH = Path("..") / "shared" / "bench"
PADERBORN = "paderborn_profile24_heatrun_2p5s.csv.gz"
BODIES = {
    "none": "",
    "yoke": '[sensors]\nyoke_degC = "stator"\n',
    "tooth": '[sensors]\ntooth_degC = "stator"\n',
}
"""What the motor file says of the bodies; one that is not fitted is held against the stator."""

PARTS = {"whole": (-np.inf, np.inf), "heating": (-np.inf, 4395.0), "cooling": (4390.0, np.inf)}
"""From and until [s]: the load is taken off at 4395 s."""

MOTOR = """[motor]
name = "Paderborn 24"
losses = "balance"
sink = "coolant"
rated_speed_rpm = 5500
[winding]
phase_resistance_ohm = 0.0146
reference_temperature_degC = 70.0
"""


def main() -> None:
    found = paderborn_record(__doc__ or "", "real")
    if found is None:
        return
    record, out = found
    runs = {}
    with temporary() as folder:
        for part, (first, last) in PARTS.items():
            chosen = record[(record.time_s >= first) & (record.time_s < last)]
            for body, said in BODIES.items():
                runs[part, body] = calibrated(folder, MOTOR + said, columns_of(chosen))
                print(f"{part}, {body}: {', '.join(warnings(runs[part, body]))}", flush=True)
    put(out / "paderborn.md", table(runs))


def paderborn_record(description: str, out: str) -> tuple[pd.DataFrame, Path] | None:
    """Return the record of profile 24 and the folder of the results, as the options of a study say;
    None, with a word, where the record is not at hand.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--bench", type=Path, default=BENCH)
    parser.add_argument("--out", type=Path, default=Path("results") / out)
    options = parser.parse_args()
    if not (options.bench / PADERBORN).exists():
        print(f"{options.bench / PADERBORN} is not there: nothing is done.")
        return None
    return pd.read_csv(options.bench / PADERBORN), options.out


def calibrated(folder: Path, motor: str, columns: dict[str, pd.Series]) -> heatrun.Run:
    """Calibrate the second order as a user does, from files in a folder to a run in it."""
    path, test = folder / "motor.toml", folder / "test.csv"
    path.write_text(motor, encoding="utf-8")
    pd.DataFrame(columns).to_csv(test, index=False)
    out = folder / f"run_{len(list(folder.iterdir()))}"
    return heatrun.calibrate(path, test, model="second", method="quick", out=out)


def columns_of(chosen: pd.DataFrame) -> dict[str, pd.Series]:
    shaft = chosen.torque_Nm * chosen.speed_rpm * np.pi / 30.0
    return {
        "time_s": chosen.time_s - chosen.time_s.iloc[0],
        "phase_current_A": np.hypot(chosen.i_d_A, chosen.i_q_A) / np.sqrt(2.0),
        "losses_W": 1.5 * (chosen.u_d_V * chosen.i_d_A + chosen.u_q_V * chosen.i_q_A) - shaft,
        "coolant_degC": chosen.coolant_degC,
        "ambient_degC": chosen.ambient_degC,
        "speed_rpm": chosen.speed_rpm,
        "torque_Nm": chosen.torque_Nm,
        "winding_degC": chosen.stator_winding_degC,
        "tooth_degC": chosen.stator_tooth_degC,
        "yoke_degC": chosen.stator_yoke_degC,
        "magnet_degC": chosen.pm_degC,
    }


def warnings(run: heatrun.Run) -> list[str]:
    return [*dict.fromkeys(f.id for f in run.result.findings if f.severity == "warning")]


def table(runs: dict[tuple[str, str], heatrun.Run]) -> str:
    lines = [
        "# One motor, parts of one record",
        "",
        "`make study-paderborn`: profile 24 of the Paderborn motor through `heatrun calibrate "
        "--model second --quick`; the sink is the coolant. *Body*: the one that is fitted as the "
        "stator node, with gain, offset and lag of its sensor; the others are held against that "
        "node. Winding, tooth, yoke, magnet: RMSE of their readings. *Certified*: page 1 does not "
        "say *not to be used*, and the parameter is identified; such intervals are in bold.",
        "",
        f"| part | body | page 1 | effects in the model | {' | '.join(PARAMETERS)} | winding "
        "| tooth | yoke | magnet | noise, heat | warnings |",
        f"|---|---|---|---|{'---|' * len(PARAMETERS)}---|---|---|---|---|---|",
    ]
    for (part, body), run in runs.items():
        model = run.result.models["second"]
        intervals = [
            ("**{}**" if is_certified(run, name) else "{}").format(
                " … ".join(f"{limit:.3g}" for limit in model.parameters[name].interval_95)
            )
            for name in PARAMETERS
        ]
        has = ", ".join(effect.id for effect in model.effects) or "–"
        lines.append(f"| {part} | {body} | {headline(run.result).use} | {has} | "
                     f"{' | '.join(intervals)} | {_errors(run)} |")  # fmt: skip
    heads = "| parameter | pairs whose intervals overlap | pairs that are certified and disjoint |"
    lines += ["", heads, "|---|---|---|"]
    for name in PARAMETERS:
        pairs = list(combinations(runs, 2))
        apart = [pair for pair in pairs if not overlap(*(_interval(runs[k], name) for k in pair))]
        both = [pair for pair in pairs if all(is_certified(runs[key], name) for key in pair)]
        wrong = ", ".join(
            " and ".join(" ".join(key) for key in pair) for pair in both if pair in apart
        )
        lines.append(f"| {name} | {len(pairs) - len(apart)} of {len(pairs)} | "
                     f"{sum(pair in apart for pair in both)} of {len(both)}"
                     f"{f': {wrong}' if wrong else ''} |")  # fmt: skip
    return "\n".join([*lines, ""])


def is_certified(run: heatrun.Run, name: str) -> bool:
    entry = run.result.models["second"].parameters[name]
    return headline(run.result).use != "not usable" and entry.identifiability == "identified"


def _errors(run: heatrun.Run) -> str:
    model = run.result.models["second"]
    bodies = {row.body: f"{row.rmse_K:.2f} K" for row in model.bodies or ()}
    cells = [f"{model.residuals[0].rmse_K:.2f} K"]
    cells += [bodies.get(f"{name}_degC", "–") for name in ("tooth", "yoke", "magnet")]
    noise = model.noise
    cells += [f"{noise.sd_K:.2f} K, {100 * noise.unmodelled_heat:.1f} %"]
    return " | ".join([*cells, ", ".join(warnings(run)) or "none"])


def _interval(run: heatrun.Run, name: str) -> tuple[float, float]:
    return run.result.models["second"].parameters[name].interval_95


def overlap(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return max(one[0], other[0]) <= min(one[1], other[1])


if __name__ == "__main__":
    main()
