"""Study of measured bodies, powers and short tests: `make study-bodies`.

Writes rows and a table under `results/bodies/`: a second measured body, the torque's gain on drives
that motor and generate, a heater alone, a coil alone, tests of minutes on machines from 1 W to
1 MW, and four nodes measured at three. Seeds below 300000 were used while the study was made;
reports use seeds from there on, each once.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from bodies_cases import KINDS, jobs, run
from bodies_table import table
from study_runs import rows_as_they_come, rows_done, said_of, write_rows

REPORTING_SEED = 400_000


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--repeats", type=int, default=100, help="records of each kind")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no case is begun after this; their order is by chance")  # fmt: skip
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS),
                        help="records of these kinds only")  # fmt: skip
    parser.add_argument("--resume", action="store_true", help="go on behind the rows in --out")
    parser.add_argument("--out", type=Path, default=Path("results") / "bodies")
    options = parser.parse_args()
    listed = jobs(options.seed, options.repeats)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = rows_done(options.out / "study.json", options.seed) if options.resume else []
    done = {row["seed"] for row in rows}
    left = [job for job in listed if job["kind"] in options.kinds and job["seed"] not in done]
    for finished in rows_as_they_come(
        left, run, processes=options.processes, minutes=options.minutes
    ):
        for row in finished:
            rows.append(row)
            words = f"{row['kind']}, {row['variant']}, {row['seed']}"
            print(f"{len(rows)}/{len(listed)} {words}: {said_of(row)}", flush=True)
        write(rows, options, len(listed))


def write(rows: list[dict[str, Any]], options: argparse.Namespace, planned: int) -> None:
    """Write rows and table."""
    rows = sorted(rows, key=lambda row: row["seed"])
    write_rows(options.out / "study.json", rows, seed=options.seed, planned=planned)
    command = " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])
    written = table(rows, command, options.seed, planned)
    (options.out / "table.md").write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
