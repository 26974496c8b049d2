"""The exported observer on a real record, its sensor blanked: `make study-observer`.

Profile 24 of the Paderborn motor. It is calibrated on the heating, without and with 20 minutes of
cooling, and followed through the rest, on which it was not fitted: the sensor blanked for ten
minutes at a time, and a start 30 K wrong. (The cooling alone tells no machine.) The record is not
part of the project (`../shared/bench`): without it nothing is done.
"""

import numpy as np
import pandas as pd
from gate_rows import heads
from observer import BLANK_S, EVERY_S, SETTLED_S, WRONG_K, alarms_of, compiled, without_reading
from paderborn import MOTOR, calibrated, columns_of, paderborn_record
from study_runs import Row, command, put, temporary

from heatrun.runs.verdict import headline

STEP_S = 2.5
FIRST_S = 300.0
"""When the sensor is blanked first [s]: the rests last 52 and 32 minutes."""

FITTED_UNTIL_S = {"heating": 4395.0, "heating and 20 min of cooling": 5595.0}
"""The load is taken off at 4395 s, the speed stays."""

INPUTS = ("phase_current_A", "losses_W", "coolant_degC", "speed_rpm")


def main() -> None:
    found = paderborn_record(__doc__ or "", "observer")
    if found is None:
        return
    record, out = found
    rows = [followed(record, fitted) for fitted in FITTED_UNTIL_S]
    put(out / "real.md", table(rows))
    print(table(rows))


def followed(record: pd.DataFrame, fitted: str) -> Row:
    is_fitted = record.time_s < FITTED_UNTIL_S[fitted]
    with temporary() as folder:
        run = calibrated(folder, MOTOR, columns_of(record[is_fitted]))
        use, c = headline(run.result).use, str(folder / "c")
        words = ["export", str(run.path), "--to", "c", "--step", str(STEP_S), "--replica"]
        code, said = command([*words, "--out", c])
        if code != 0:
            raise SystemExit(said)
        has_speed = "HAS_SPEED 1" in (folder / "c" / "thermal_network.h").read_text()
        part = pd.DataFrame(columns_of(record[~is_fitted]))
        names = [each for each in INPUTS if each != "speed_rpm" or has_speed]
        rows = part[[*names, "winding_degC"]].to_numpy()[1:]
        truth, since = rows[:, -1].copy(), part.time_s.to_numpy()[1:]
        follow = compiled(folder / "c")
        is_blank = (since >= FIRST_S) & ((since - FIRST_S) % EVERY_S < BLANK_S)
        start = float(truth[0])
        T, sd, _ = follow(without_reading(rows, is_blank), start, 5.0)
        open_T, _, _ = follow(without_reading(rows), start, 5.0)
        wrong_T, wrong_sd, _ = follow(rows, start + WRONG_K, WRONG_K)
        _, _, sound = follow(rows, start, 5.0)
    late = since >= SETTLED_S
    error, wrong = np.abs(T[:, 0] - truth), np.abs(wrong_T[:, 0] - truth)
    return {
        "fitted": fitted, "verdict": use,
        "num_blanks": int(np.sum(np.diff(is_blank.astype(int)) == 1)),
        "in_band": float(np.mean(error[is_blank] < 1.96 * sd[is_blank, 0])),
        "wrong_in_band": float(np.mean(wrong[late] < 1.96 * wrong_sd[late, 0])),
        "sd_K": float(np.mean(sd[is_blank, 0])),
        "rmse_K": float(np.sqrt(np.mean(error[is_blank] ** 2))),
        "open_K": float(np.sqrt(np.mean((open_T[is_blank, 0] - truth[is_blank]) ** 2))),
        "largest_K": float(np.max(error[is_blank])), "alarms": alarms_of(sound),
    }  # fmt: skip


def table(rows: list[Row]) -> str:
    lines = [
        "# The exported observer on a real record",
        "",
        "Paderborn's profile 24, `make study-observer`: calibrated on the first part (second "
        f"order, quick), exported with `--to c --step {STEP_S:g}`, run over the rest. The "
        f"winding's sensor is blanked for {BLANK_S // 60} "
        f"of {EVERY_S // 60} min from {FIRST_S / 60:g} min "
        f"on; the truth is what it shows. *Wrong start*: {WRONG_K:g} K off, from "
        f"{SETTLED_S // 60} min on. One machine, few blanks: an example, no rate.",
        "",
        *heads("fitted | verdict | blanks | in the 95 % band | its sd | RMSE, blanked | "
               "largest error | open loop, same minutes | in the band after a wrong start | "
               "false alarms"),
    ]  # fmt: skip
    lines += [
        f"| {r['fitted']} | {r['verdict']} | {r['num_blanks']} | "
        f"{100.0 * r['in_band']:.0f} % | {r['sd_K']:.2f} K | {r['rmse_K']:.2f} K | "
        f"{r['largest_K']:.2f} K | {r['open_K']:.2f} K | {100.0 * r['wrong_in_band']:.0f} % | "
        f"{r['alarms']} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
