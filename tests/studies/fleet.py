"""Study of populations: `make study-fleet`.

Writes rows and table under `results/fleet/`. Seeds below 50000 were used to tune; reports use those
from `SEED` on. Each fleet runs the command on files. Rows go to a file as they come; a run that was
cut short goes on from there.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small; threads only wait
sys.path.insert(0, str(Path(__file__).parent))

from fleet_rows import run
from fleet_table import table
from study_runs import rows_done, write_rows

SEED = 50_000
"""First of the reporting seeds."""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=10)
    parser.add_argument("--machines", type=int, default=200, help="of each fleet")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=2, help="processes of a fleet")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no fleet after this")
    parser.add_argument("--out", type=Path, default=Path("results") / "fleet")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "population_rows.json"
    rows = rows_done(path, options.seed)
    if any(row["machines"] != options.machines for row in rows):
        raise SystemExit(f"{path} is of fleets of another size: give another --out.")
    done = {row["seed"] for row in rows}
    begin = time.monotonic()
    for seed in range(options.seed, options.seed + options.fleets):
        if seed in done or time.monotonic() - begin > 60.0 * options.minutes:
            continue
        rows.append(run({"seed": seed, "machines": options.machines, "workers": options.workers}))
        write_rows(path, rows, seed=options.seed, planned=options.fleets)
        print(f"{seed}: {rows[-1]['processor_s']:.0f} s", flush=True)
    one_stage = options.out / "one_stage.json"
    compared = json.loads(one_stage.read_text()) if one_stage.exists() else None
    text = table(rows, compared, json.loads(path.read_text(encoding="utf-8")))
    (options.out / "population.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
