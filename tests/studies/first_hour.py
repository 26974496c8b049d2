"""From five unlike files to a certificate: `make study-first-hour`.

Each file goes through `heatrun init --accept`, `check` and `calibrate` as a person would take it:
the numbers that the motor file asks for are put in, and a column is named where the draft took
another. Writes commands, seconds, typed lines and results to `results/first_hour/`.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import re
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

sys.path.insert(0, str(Path(__file__).parent))

from first_hour_files import FILES, KNOWN, VESC_SEED, Handed

from heatrun.io.quantities import quantity, rounded
from heatrun.reports.printed import format_interval, printed
from heatrun.results import FitResult, from_json
from heatrun.results.model import FittedParameter
from heatrun.runs.verdict import concerns, favoured

TRUTH = Path(__file__).parents[2] / "data" / "synthetic" / "truth.json"

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
MOST_COMMANDS, MOST_LINES = 3, 5


def edited(draft: str, missing: Sequence[Mapping[str, Any]], handed: Handed) -> tuple[str, list]:
    """Return a drafted motor file as a person completes it, and the lines that were typed.

    Args:
        draft: As `heatrun init --accept` wrote it.
        missing: What it says is missing, from its `--json`.
        handed: What the person knows.

    Raises:
        ValueError: If it asks for what the person does not know.
    """
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
    """Take one file from `init` to the sheet and return its row."""
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
    certified = result.models[favoured(result)]
    row["findings"] = sorted({each.id for each in result.findings if each.severity == "warning"
                              and concerns(each, result, certified)})  # fmt: skip
    row["written"] = sorted(path.name for path in out.iterdir() if path.is_file())
    return row


def entry_of(found: dict[str, Any], truth: float) -> dict[str, Any]:
    """Return what the table says of a parameter, its numbers as the certificate prints them.

    Args:
        found: The parameter as it stands in `fit.json`.
        truth: Its true value, in the same unit.
    """
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
    """Run all of them and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results") / "first_hour")
    parser.add_argument("--sheets", type=Path, help="folder that the sheets are kept in")
    parser.add_argument("--only", choices=list(FILES), action="append")
    options = parser.parse_args()
    rows = []
    for number, kind in enumerate(options.only or FILES, 1):
        with tempfile.TemporaryDirectory() as name:
            rows.append(run(kind, Path(name)))
            if options.sheets:
                options.sheets.mkdir(parents=True, exist_ok=True)
                sheet = Path(name) / "run" / "sheet.pdf"
                (options.sheets / f"sheet_{number}.pdf").write_bytes(sheet.read_bytes())
        print(f"{kind}: {rows[-1]['seconds']:.0f} s, {rows[-1]['covered']} of 4", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    content = {"command": "python tests/studies/first_hour.py", "heatrun": version("heatrun"),
               "python": platform.python_version(), "cores": os.cpu_count(),
               "seeds": {"calibrate": 0, "VESC log": VESC_SEED, "heat run": 104},
               "date": datetime.date.today().isoformat(), "rows": rows}  # fmt: skip
    (options.out / "rows.json").write_text(
        json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    (options.out / "table.md").write_text(table(content), encoding="utf-8")
    few = all(len(row["commands"]) <= MOST_COMMANDS and len(row["edits"]) <= MOST_LINES
              for row in rows)  # fmt: skip
    right = all(row["covered"] == len(NAMES) and not row["read_wrongly"] for row in rows)
    return 0 if few and right else 1


def table(content: Mapping[str, Any]) -> str:
    """Return the page of the study.

    Args:
        content: Rows, and what they were made with.
    """
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
