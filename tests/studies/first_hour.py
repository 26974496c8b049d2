"""From five unlike files to a certificate: `make study-first-hour`.

Each file goes through `heatrun init`, `check` and `calibrate` as a person would take it: of the
drafted motor file nothing is done but to remove the `#` in front of lines that stand there, and to
put in the numbers that it asks for. Writes commands, edits and results to `results/first_hour/`.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

sys.path.insert(0, str(Path(__file__).parent))

from first_hour_files import FILES

from heatrun.io.quantities import quantity, rounded
from heatrun.reports.sheet.digits import format_interval
from heatrun.reports.sheet.printed import printed
from heatrun.results.parameter import FittedParameter

TRUTH = Path(__file__).parents[2] / "data" / "synthetic" / "truth.json"

NUMBERS = {"phase_resistance_ohm": "0.0062"}
"""What the person knows: the resistance off the data sheet."""

MISSING = re.compile(r"^# [0-9]+\. \[\w+\] (?P<key>\w+): ", re.MULTILINE)
BLANK = re.compile(r"(?P<key>\w+) =    # put in the number.*")
NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


def edited(draft: str) -> tuple[str, list[str]]:
    """Return a drafted motor file as a person fills it in, and the lines that were touched.

    For each key that the draft lists as missing, the first line that sets it is uncommented.

    Args:
        draft: As `heatrun init` wrote it.
    """
    lines, touched = draft.splitlines(), []
    for key in MISSING.findall(draft):
        place = next(n for n, line in enumerate(lines) if line.startswith(f"# {key} = "))
        line = lines[place].removeprefix("# ")
        lines[place] = f"{key} = {NUMBERS[key]}" if BLANK.fullmatch(line) else line
        touched.append(lines[place].partition("  #")[0])
    return "\n".join(lines) + "\n", touched


def run(kind: str, folder: Path) -> dict[str, Any]:
    """Take one file from `init` to the sheet and return its row."""
    record = FILES[kind](folder)
    motor, out = folder / "motor.toml", folder / "run"
    row: dict[str, Any] = {"kind": kind, "file": record.name, "commands": []}
    begin = time.perf_counter()

    def call(*words: object) -> dict[str, Any]:
        shown = [str(word).replace(f"{folder}/", "") for word in words]
        row["commands"].append(" ".join(["heatrun", *shown]))
        done = subprocess.run(
            [sys.executable, "-m", "heatrun.cli", *map(str, words), "--json"],
            capture_output=True, text=True, encoding="utf-8", check=False,
        )  # fmt: skip
        if done.returncode != 0:
            raise SystemExit(f"{row['commands'][-1]}: exit {done.returncode}\n{done.stdout[-2000:]}"
                             f"{done.stderr[-2000:]}")  # fmt: skip
        return json.loads(done.stdout)

    call("init", record, "--out", motor)
    text, row["edits"] = edited(motor.read_text(encoding="utf-8"))
    motor.write_text(text, encoding="utf-8")
    said = call("check", motor, record)
    row["suitability"] = said["suitability"][0]["sentence"]
    row["unclaimed"] = next(iter(said["unclaimed"].values()))
    call("calibrate", motor, record, "--quick", "--out", out)
    row["seconds"] = time.perf_counter() - begin
    fit = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    found = fit["models"]["second"]["parameters"]
    truth = json.loads(TRUTH.read_text(encoding="utf-8"))["motor"]
    row["parameters"] = {name: entry_of(found[name], truth[name]) for name in NAMES}
    row["covered"] = sum(
        each["interval_95"][0] <= each["truth"] <= each["interval_95"][1]
        for each in row["parameters"].values()
    )
    row["rmse_K"] = fit["models"]["second"]["residuals"][0]["rmse_K"]
    row["findings"] = sorted({each["id"] for each in fit["findings"]
                              if each["severity"] == "warning"})  # fmt: skip
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


def main() -> None:
    """Run all of them and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results") / "first_hour")
    parser.add_argument("--only", choices=list(FILES), action="append")
    options = parser.parse_args()
    rows = []
    for kind in options.only or FILES:
        with tempfile.TemporaryDirectory() as name:
            rows.append(run(kind, Path(name)))
        print(f"{kind}: {rows[-1]['seconds']:.0f} s, {rows[-1]['covered']} of 4", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    content = {"command": " ".join(sys.argv), "heatrun": version("heatrun"), "rows": rows}
    (options.out / "rows.json").write_text(
        json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    (options.out / "table.md").write_text(table(rows), encoding="utf-8")


def table(rows: list[dict[str, Any]]) -> str:
    """Return the page of the study."""
    lines = [
        "# From five unlike files to a certificate",
        "",
        "`make study-first-hour`. One heat run (the bundled duty of 90 min) as five benches hand "
        "it over. Of the drafted motor file, lines that stand in it were uncommented and the "
        "numbers that it asks for put in; nothing else was written, no key looked up.",
        "",
        "| file | lines touched | in the 95 % intervals | RMSE | time, all commands |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['kind']} | {len(row['edits'])} | {row['covered']} of 4 | {row['rmse_K']:.2f} K | "
        f"{row['seconds']:.0f} s |"
        for row in rows
    ]
    for row in rows:
        lines += ["", f"## {row['kind']}", "", "```", *row["commands"], "```", "",
                  "Lines touched:", "", "```toml", *row["edits"], "```", "",
                  f"`check` ends: {row['suitability']}"]  # fmt: skip
        lines += ["", "| parameter | as the certificate prints it | 95 % | truth |",
                  "|---|---|---|---|"]  # fmt: skip
        for name, each in row["parameters"].items():
            shown = (each[key] for key in ("printed", "printed_95", "printed_truth"))
            lines.append(f"| {name} | {' | '.join(shown)} |")
        warned = ", ".join(f"`{id}`" for id in row["findings"]) or "none"
        lines += ["", f"Warnings of the run: {warned}. Written: {', '.join(row['written'])}."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
