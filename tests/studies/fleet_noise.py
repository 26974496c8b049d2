"""Study of noise, unmodelled heat and a named effect over fleets: a part of `make study-fleet`.

Writes rows and table under `results/fleet/`. Seeds below 61000 were used to try it; reports use
those from `SEED` on. Rows go to a file as they come; a run that was cut short goes on from there.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small; threads only wait
sys.path.insert(0, str(Path(__file__).parent))

from fleet_noise_cases import HEATS
from fleet_noise_rows import run
from fleet_noise_table import table
from study_runs import rows_done, write_rows

SEED = 61_000
"""First of the reporting seeds."""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=12)
    parser.add_argument("--machines", type=int, default=50, help="of each fleet")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=2, help="processes of a fleet")
    parser.add_argument("--out", type=Path, default=Path("results") / "fleet")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "noise_rows.json"
    rows = rows_done(path, options.seed)
    if any(row["machines"] != options.machines for row in rows):
        raise SystemExit(f"{path} is of fleets of another size: give another --out.")
    done = {row["seed"] for row in rows}
    for number in range(options.fleets):
        seed = options.seed + number
        if seed in done:
            continue
        kind = {"has_effect": number % 2 == 1, "heat": HEATS[number // 2 % 2]}
        size = {"machines": options.machines, "workers": options.workers}
        rows.append(run({"seed": seed, **size, **kind}))
        write_rows(path, rows, seed=options.seed, planned=options.fleets)
        print(f"{seed}: {rows[-1]['processor_s']:.0f} s", flush=True)
    text = table(rows, json.loads(path.read_text(encoding="utf-8")))
    (options.out / "noise.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
