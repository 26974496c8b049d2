"""From five unlike files to a certificate: `make study-first-hour`.

Five files as five benches would hand them over: SCADA, HIOKI, LabVIEW, VESC, Simulink. Four hold
the bundled 90-min duty; the VESC's is a locked rotor of the same machine, solved here; nothing of
heatrun writes them. Each goes through `heatrun init --accept`, `check` and `calibrate` as a person
would take it: the numbers that the motor file asks for are put in, and a column is named where the
draft took another. Writes commands, seconds, typed lines and results to `results/first_hour/`.
"""

import argparse
import datetime
import json
import os
import platform
import re
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
from study_runs import put, temporary

from heatrun.io.quantities import quantity, rounded
from heatrun.reports.printed import format_interval, printed
from heatrun.results import FitResult, from_json
from heatrun.results.model import FittedParameter
from heatrun.runs.verdict import concerns

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"
START = datetime.datetime(2025, 11, 20, 9, 15, 0)
KNOWN = {"phase_resistance_ohm": "0.0062"}
"""What the person knows: the resistance off the data sheet."""

ROOM_DEGC = 22.0
VESC_SEED = 41


@dataclass(frozen=True)
class Handed:
    write: Callable[[Path], Path]  # Writes the file into a folder and returns where it lies.
    columns: dict[str, str]  # Channel to the column that it must be read from, as the person knows.
    # What the person knows that no file of this bench holds: key or channel to text.
    numbers: dict[str, str]


def record(every: int = 10) -> pd.DataFrame:
    """Return the heat run: t, Is, Pd, Te, Tw_m, speed_rpm; one of so many samples of 0.1 s."""
    return pd.read_csv(SYNTHETIC / "duty_90min.csv.gz").iloc[::every].reset_index(drop=True)


def clock(table: pd.DataFrame, form: str) -> list[str]:
    return [(START + datetime.timedelta(seconds=float(s))).strftime(form) for s in table.t]


def scada(folder: Path) -> Path:
    """Write means of 5 s as a German control room exports them."""
    fast = record(every=1)
    table = fast.groupby(np.arange(len(fast)) // 50).mean()
    table["t"] -= table.t.iloc[0]
    columns = {
        "Zeitstempel": clock(table, "%d.%m.%Y %H:%M:%S"),
        "Motor_Wicklungstemp_MW [°C]": table.Tw_m.round(1),
        "Hallentemperatur_MW [°C]": table.Te.round(1),
        "Motorstrom_L1_MW [A]": table.Is.round(1),
        "Verlustleistung_MW [kW]": (table.Pd / 1e3).round(4),
        "Drehzahl_MW [1/min]": table.speed_rpm.round(0),
        "Lüfter_Ein": 1,
    }
    head = "Anlage;Prüffeld 3\r\nBericht;Trend 5-s-Mittelwerte\r\n\r\n"
    text = pd.DataFrame(columns).to_csv(sep=";", decimal=",", index=False, lineterminator="\r\n")
    path = folder / "Trend_Pruefstand.csv"
    path.write_bytes((head + text).encode("cp1252"))
    return path


def hioki(folder: Path) -> Path:
    """Write what a Japanese power meter with motor inputs and two sensors logs, every second."""
    table = record()
    torque = (0.62 * table.Is * (table.speed_rpm > 50)).round(2)
    shaft = torque * table.speed_rpm * np.pi / 30.0
    rows = pd.DataFrame({
        "日時": clock(table, "%Y/%m/%d %H:%M:%S"), "相電流[A]": table.Is.round(2),
        "入力電力[W]": (table.Pd + shaft).round(1), "トルク[Nm]": torque,
        "回転数[r/min]": table.speed_rpm, "巻線温度[℃]": table.Tw_m, "室温[℃]": table.Te,
    })  # fmt: skip
    head = "HIOKI 8450,Ver 2.10\r\n測定開始,2025/11/20 09:15:00\r\n記録間隔,1s\r\n\r\n"
    path = folder / "AUTO0003.CSV"
    path.write_bytes((head + rows.to_csv(index=False, lineterminator="\r\n")).encode("cp932"))
    return path


def labview(folder: Path) -> Path:
    """Write a LabVIEW measurement file with its two headers, every second."""
    table = record()
    count = f"\t{len(table)}" * 4
    lines = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        "Decimal_Separator\t.", "Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative",
        "Operator\tM. Rossi", "Date\t2025/11/20", "Time\t09:15:00.25", "***End_of_Header***\t",
        "\t", "Channels\t4" + "\t" * 4, f"Samples{count}", "Date" + "\t2025/11/20" * 4,
        "Time" + "\t09:15:00.25" * 4, "Y_Unit_Label\tdegC\tdegC\tA\tW",
        "X_Dimension" + "\tTime" * 4,
        "X0" + "\t0.0000000000000000E+0" * 4, "Delta_X" + "\t1.000000" * 4,
        "***End_of_Header***" + "\t" * 5, "X_Value\tSlot\tLab air\tPhase current\tLosses\tComment",
    ]  # fmt: skip
    lines += [f"{t:.6f}\t{w:.6f}\t{a:.6f}\t{i:.6f}\t{p:.6f}\t" for t, w, a, i, p in zip(
        table.t, table.Tw_m, table.Te, table.Is, table.Pd, strict=True)]  # fmt: skip
    path = folder / "test_017.lvm"
    path.write_text("\r\n".join(lines) + "\r\n", encoding="ascii")
    return path


def vesc(folder: Path) -> Path:
    """Write the log of a motor controller: the rotor locked, the room not recorded, every 2 s."""
    machine = json.loads((SYNTHETIC / "truth.json").read_text(encoding="utf-8"))["motor"]
    step_s, every = 0.1, 20
    time_s = np.arange(0.0, 4800.0, step_s)
    levels = np.array([0.0, 105.0, 55.0, 125.0, 0.0])
    current = levels[np.searchsorted([60.0, 1500.0, 2400.0, 3300.0], time_s, side="right")]
    winding, copper = np.empty(time_s.size), np.empty(time_s.size)
    T_w = T_s = ROOM_DEGC
    for k in range(time_s.size):
        resistance = machine["phase_resistance_ohm"] * (234.5 + T_w) / 259.5
        winding[k], copper[k] = T_w, 3.0 * current[k] ** 2 * resistance
        flow = (T_w - T_s) / machine["Req_w"]
        T_w += step_s * (copper[k] - flow) / machine["Ceq_w"]
        T_s += step_s * (flow - (T_s - ROOM_DEGC) / machine["Req_sr"]) / machine["Ceq_sr"]
    rng = np.random.default_rng(VESC_SEED)
    amplitude = np.sqrt(2.0) * current + rng.normal(0.0, 0.1, time_s.size)
    volts = 50.4 - 0.01 * copper / 50.0 + rng.normal(0.0, 0.02, time_s.size)
    table = pd.DataFrame({
        "ms_today": (1000.0 * time_s + 33301000).astype(int), "input_voltage": volts.round(2),
        "temp_mos_max": (ROOM_DEGC + 0.1 * current).round(1),
        "temp_motor": (winding + rng.normal(0.0, 0.1, time_s.size)).round(1),
        "current_motor": np.abs(amplitude).round(2), "current_in": (copper / volts).round(2),
        "d_axis_current": rng.normal(0.0, 0.05, time_s.size).round(2),
        "q_axis_current": amplitude.round(2), "erpm": 0, "duty_cycle": (current / 4000.0).round(3),
        "fault_code": 0,
    })  # fmt: skip
    path = folder / "2025-11-20_09-15-01.csv"
    table.iloc[::every].to_csv(path, sep=";", index=False, lineterminator="\n")
    return path


def simulink(folder: Path) -> Path:
    """Write a structure with time as Simulink's To Workspace saves it, every second."""
    from scipy.io import savemat

    table = record()
    names = {"I_rms": table.Is, "P_loss": table.Pd, "T_amb": table.Te, "T_wdg": table.Tw_m}
    signals = np.empty((1, 4), dtype=[(key, object) for key in ("values", "label", "dimensions")])
    for k, (name, values) in enumerate(names.items()):
        signals[0, k] = (values.to_numpy(dtype=float)[:, None], name, 1.0)
    log = {"time": table.t.to_numpy(dtype=float)[:, None], "signals": signals, "blockName": "b/S"}
    path = folder / "simout.mat"
    savemat(path, {"log": log})
    return path


FIVE = ("time_s", "winding_degC", "ambient_degC", "phase_current_A", "losses_W")
FILES: dict[str, Handed] = {
    "German SCADA, means of 5 s": Handed(scada, dict(zip(FIVE, (
        "Zeitstempel", "Motor_Wicklungstemp_MW [°C]", "Hallentemperatur_MW [°C]",
        "Motorstrom_L1_MW [A]", "Verlustleistung_MW [kW]"), strict=True)), {}),
    "Japanese HIOKI, cp932": Handed(hioki, {
        "time_s": "日時", "winding_degC": "巻線温度[℃]", "ambient_degC": "室温[℃]",
        "phase_current_A": "相電流[A]", "electrical_power_W": "入力電力[W]",
        "torque_Nm": "トルク[Nm]", "speed_rpm": "回転数[r/min]"}, {}),
    "LabVIEW LVM": Handed(labview, dict(zip(FIVE, (
        "X_Value", "Slot", "Lab air", "Phase current", "Losses"), strict=True)), {}),
    "VESC log, rotor locked": Handed(vesc, {
        "time_s": "ms_today", "winding_degC": "temp_motor", "i_d_A": "d_axis_current",
        "i_q_A": "q_axis_current", "dc_voltage_V": "input_voltage", "dc_current_A": "current_in"},
        {"ambient_degC": "22.0", "mechanical_power_W": "0.0", "speed_rpm": "0.0"}),
    "MATLAB struct with time": Handed(simulink, dict(zip(FIVE, (
        "log.time", "log.signals(4).values", "log.signals(3).values", "log.signals(1).values",
        "log.signals(2).values"), strict=True)), {}),
}  # fmt: skip
"""Kind of file to what a bench hands over."""
TRUTH = Path(__file__).parents[2] / "data" / "synthetic" / "truth.json"

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
MOST_COMMANDS, MOST_LINES = 3, 5


def edited(draft: str, missing: Sequence[Mapping[str, Any]], handed: Handed) -> tuple[str, list]:
    """Return a drafted motor file as a person completes it, and the lines that were typed."""
    lines, typed = draft.splitlines(), []

    def put(key: str, text: str, section: str) -> None:
        found = [n for n, line in enumerate(lines) if re.match(rf"(# )?{key} = ", line)]
        place = found[0] if found else lines.index(f"[{section}]")
        lines[place : place + len(found[:1])] = [text] if found else [lines[place], text]
        typed.append(text)

    for gap in missing:
        key = gap["key"] or gap["channel"]
        number = (KNOWN | handed.numbers).get(key)
        if number is not None:
            put(key, f"{key} = {number}", "winding" if gap["key"] else "constants")
        elif key not in handed.columns:
            raise ValueError(f"{key}: {gap['sentence']}")
    live = tomllib.loads("\n".join(lines)).get("columns", {})
    for channel, column in handed.columns.items():
        asked = any(gap["channel"] == channel for gap in missing)
        is_other = channel in live and not live[channel].startswith(column)
        if is_other or (asked and channel not in live):
            put(channel, f"{channel} = {json.dumps(column, ensure_ascii=False)}", "columns")
    return "\n".join(lines) + "\n", typed


def run(kind: str, folder: Path) -> dict[str, Any]:
    handed = FILES[kind]
    record = handed.write(folder)
    motor, out = folder / "motor.toml", folder / "run"
    row: dict[str, Any] = {"kind": kind, "file": record.name, "commands": [], "seconds_each": []}

    def call(*words: object) -> dict[str, Any]:
        shown = [str(word).replace(f"{folder}/", "") for word in words]
        row["commands"].append(shlex.join(["heatrun", *shown]))
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "heatrun.cli", *map(str, words), "--json"],
            capture_output=True, text=True, encoding="utf-8", check=False,
        )  # fmt: skip
        row["seconds_each"].append(round(time.perf_counter() - begin, 1))
        if done.returncode != 0:
            raise SystemExit(f"{row['commands'][-1]}: exit {done.returncode}\n{done.stdout[-2000:]}"
                             f"{done.stderr[-2000:]}")  # fmt: skip
        return json.loads(done.stdout)

    drafted = call("init", record, "--accept", "--out", motor)
    text, row["edits"] = edited(motor.read_text(encoding="utf-8"), drafted["missing"], handed)
    motor.write_text(text, encoding="utf-8")
    row["to_check"] = text.count("# please check")
    said = call("check", motor, record)
    read = {each["channel"]: each["column"] for each in said["tests"][0]["mapping"]}
    row["read_wrongly"] = sorted(channel for channel, column in handed.columns.items()
                                 if read.get(channel) != column)  # fmt: skip
    row["suitability"] = said["suitability"][0]["sentence"]
    row["unclaimed"] = next(iter(said["unclaimed"].values()))
    call("calibrate", motor, record, "--quick", "--out", out)
    row["seconds"] = sum(row["seconds_each"])
    content = (out / "fit.json").read_bytes()
    fit = json.loads(content)
    found = fit["models"]["second"]["parameters"]
    truth = json.loads(TRUTH.read_text(encoding="utf-8"))["motor"]
    row["parameters"] = {name: entry_of(found[name], truth[name]) for name in NAMES}
    row["covered"] = sum(
        each["interval_95"][0] <= each["truth"] <= each["interval_95"][1]
        for each in row["parameters"].values()
    )
    row["rmse_K"] = fit["models"]["second"]["residuals"][0]["rmse_K"]
    result = from_json(content, FitResult, "fit.json", "the run")
    row["findings"] = sorted({each.id for each in result.findings if each.severity == "warning"
                              and concerns(each, result)})  # fmt: skip
    row["written"] = sorted(path.name for path in out.iterdir() if path.is_file())
    return row


def entry_of(found: dict[str, Any], truth: float) -> dict[str, Any]:
    entry = msgspec.convert(found, FittedParameter)
    return {
        "value": entry.value,
        "interval_95": list(entry.interval_95),
        "truth": truth,
        "printed": printed(entry).text,
        "printed_95": quantity(format_interval(entry.interval_95, entry.sd), entry.unit),
        "printed_truth": quantity(rounded(truth, 5), entry.unit),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results") / "first_hour")
    parser.add_argument("--only", choices=list(FILES), action="append")
    options = parser.parse_args()
    rows = []
    for kind in options.only or FILES:
        with temporary() as folder:
            rows.append(run(kind, folder))
        print(f"{kind}: {rows[-1]['seconds']:.0f} s, {rows[-1]['covered']} of 4", flush=True)
    content = {"command": "python tests/studies/first_hour.py", "heatrun": version("heatrun"),
               "python": platform.python_version(), "cores": os.cpu_count(),
               "seeds": {"calibrate": 0, "VESC log": VESC_SEED, "heat run": 104},
               "date": datetime.date.today().isoformat(), "rows": rows}  # fmt: skip
    put(options.out / "rows.json", json.dumps(content, indent=1, ensure_ascii=False) + "\n")
    put(options.out / "table.md", table(content))
    few = all(len(row["commands"]) <= MOST_COMMANDS and len(row["edits"]) <= MOST_LINES
              for row in rows)  # fmt: skip
    right = all(row["covered"] == len(NAMES) and not row["read_wrongly"] for row in rows)
    return 0 if few and right else 1


def table(content: Mapping[str, Any]) -> str:
    rows, seeds = content["rows"], content["seeds"]
    made = ", ".join(f"{name} {seed}" for name, seed in seeds.items())
    lines = [
        "# From five unlike files to a certificate",
        "",
        f"`make study-first-hour` (`{content['command']}`), {content['date']}, heatrun "
        f"{content['heatrun']}, Python {content['python']}, {content['cores']} cores shared with "
        f"other work; seeds: {made}.",
        "",
        "A heat run as five benches hand it over: the bundled duty of 90 min, and of the VESC a "
        "locked rotor of the same machine, its power stage without loss. The person knows the "
        "phase resistance, which column is what, and of the VESC the room and that the rotor "
        "stood. Lines marked `# please check` were read and left as they were where right.",
        "",
        "| file | commands | lines typed | lines to check | in the 95 % intervals | RMSE | "
        "seconds: init, check, calibrate |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['kind']} | {len(row['commands'])} | {len(row['edits'])} | {row['to_check']} | "
        f"{row['covered']} of 4 | {row['rmse_K']:.2f} K | "
        f"{', '.join(f'{s:.0f}' for s in row['seconds_each'])} |"
        for row in rows
    ]
    for row in rows:
        lines += ["", f"## {row['kind']}", "", "```", *row["commands"], "```", "",
                  "Lines typed:", "", "```toml", *row["edits"], "```", "",
                  f"`check` ends: {row['suitability']}"]  # fmt: skip
        lines += ["", "| parameter | as the certificate prints it | 95 % | truth |",
                  "|---|---|---|---|"]  # fmt: skip
        for name, each in row["parameters"].items():
            shown = (each[key] for key in ("printed", "printed_95", "printed_truth"))
            lines.append(f"| {name} | {' | '.join(shown)} |")
        warned = ", ".join(f"`{id}`" for id in row["findings"]) or "none"
        lines += [
            "",
            f"Warnings on the certified network: {warned}. Written: {', '.join(row['written'])}.",
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
