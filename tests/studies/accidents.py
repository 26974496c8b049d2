"""Study of accidents on the bench: what is caught and named, and what clean records are told.

`make study-accidents` writes `results/accidents/`: machines and loads of `ordinary_machines`, each
record written as a file and read as `heatrun check` reads it. Thresholds were set on seeds below
12000; reports use those from there on. `accidents.py --seed 1000 --clean 12 --each 2 --out FOLDER`
gives a first look; a run that was cut short goes on where it was.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from accident_cases import ACCIDENTS, doubts, is_caught, is_named, num_beside, run
from discovery_gates import limits_95
from study_runs import Row, rows_as_they_come, rows_done, write_rows

REPORTING_SEED = 12000
MOST_FALSE = 0.02
"""Share of clean records that may be accused [1]."""


def table(rows: Sequence[Row], seed: int) -> str:
    """Return the report of a study."""
    clean = [row for row in rows if not row["accident"]]
    accused = [row for row in clean if doubts(row)]
    low, high = limits_95(len(accused), max(len(clean), 1))
    ids = Counter(id for row in accused for id in set(doubts(row)))
    of = ", ".join(f"{id} ({count})" for id, count in ids.most_common()) or "none"
    lines = [
        "# Accidents on the bench\n",
        f"`make study-accidents` (accidents.py), seeds from {seed} on; versions stand in "
        "`study.json`. Six kinds of machines under three kinds of load with independent noise, "
        "rounding and two to four imperfections each; "
        "currents of three phases, some records rounded to 1 °C, some with the inrush of a start. "
        "*Named*: the finding that belongs to it, with the column or the line of the motor file, "
        "at its moment within 120 s (600 s where it comes over ten minutes). *Beside*: records "
        "with a finding beside it that is none of the test's course.\n",
        f"**Clean records:** {len(accused)} of {len(clean)} accused "
        f"({100.0 * len(accused) / max(len(clean), 1):.1f} %, 95 % limits {100.0 * low:.1f} to "
        f"{100.0 * high:.1f} %; at most {100.0 * MOST_FALSE:.0f} % are allowed): {of}.\n",
        "| accident | records | caught | named rightly | with a finding beside |",
        "|---|---:|---:|---:|---:|",
    ]
    for name in ACCIDENTS:
        of_kind = [row for row in rows if row["accident"] == name]
        counts = (
            sum(is_caught(row) for row in of_kind),
            sum(is_named(row) for row in of_kind),
            sum(num_beside(row) > 0 for row in of_kind),
        )
        lines.append(f"| {name} | {len(of_kind)} | {' | '.join(map(str, counts))} |")
    all_struck = [row for row in rows if row["accident"]]
    lines.append(
        f"| **all** | {len(all_struck)} | {sum(map(is_caught, all_struck))} | "
        f"{sum(map(is_named, all_struck))} | "
        f"{sum(num_beside(row) > 0 for row in all_struck)} |"
    )
    return "\n".join(lines) + "\n"


def struck(job: Row) -> Row:
    """Return the row of a case, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return run(job, Path(folder))


def main() -> None:
    """Run the cases that are left, and write rows and table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--clean", type=int, default=240, help="clean records")
    parser.add_argument("--each", type=int, default=6, help="records of each accident")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).parents[2] / "results" / "accidents"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    names = [""] * options.clean + [name for name in ACCIDENTS for _ in range(options.each)]
    jobs = [{"accident": name, "seed": options.seed + n} for n, name in enumerate(names)]
    rows = rows_done(options.out / "study.json", options.seed)
    done = {(row["accident"], row["seed"]) for row in rows}
    left = [job for job in jobs if (job["accident"], job["seed"]) not in done]
    for finished in rows_as_they_come(left, struck, processes=options.processes, minutes=600.0):
        rows += finished
        if len(rows) % 20 == 0 or len(rows) == len(jobs):
            write_rows(
                options.out / "study.json", rows, seed=options.seed, planned=len(jobs),
                command="make study-accidents",
            )  # fmt: skip
            print(f"{len(rows)} of {len(jobs)}", flush=True)
    rows.sort(key=lambda row: row["seed"])
    text = table(rows, options.seed)
    (options.out / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
