"""Study of measured bodies, powers and short tests: `make study-bodies`.

Writes rows and a table under `results/bodies/`: a second measured body, the torque's gain on drives
that motor and generate, a heater alone, a coil alone, tests of minutes on machines from 1 W to
1 MW, and four nodes measured at three. Seeds below 300000 were used while the study was made;
reports use seeds from there on, each once.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import platform
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from bodies_cases import jobs, run
from bodies_table import table

REPORTING_SEED = 300_000


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--repeats", type=int, default=100, help="records of each kind")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no case is begun after this; their order is by chance")  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("results") / "bodies")
    options = parser.parse_args()
    listed = jobs(options.seed, options.repeats)
    options.out.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    rows: list[dict[str, Any]] = []
    context = multiprocessing.get_context("spawn")  # JAX must not be forked
    left = iter(listed)
    with ProcessPoolExecutor(options.processes, mp_context=context) as pool:
        pending = {pool.submit(run, job) for job in islice(left, options.processes)}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            if time.monotonic() - begin < 60.0 * options.minutes:
                pending |= {pool.submit(run, job) for job in islice(left, len(done))}
            for row in (future.result() for future in done):
                rows.append(row)
                names = [finding[0] for finding in row.get("findings", [])]
                print(
                    f"{len(rows)}/{len(listed)} {row['kind']}, {row['variant']}, {row['seed']}: "
                    f"{names} {row['processor_s']:.0f} s {row.get('failure', '')}",
                    flush=True,
                )
            write(rows, options, len(listed))


def write(rows: list[dict[str, Any]], options: argparse.Namespace, planned: int) -> None:
    """Write rows and table."""
    rows = sorted(rows, key=lambda row: row["seed"])
    content = {
        "command": " ".join(sys.argv),
        "seed": options.seed,
        "planned": planned,
        "python": platform.python_version(),
        "versions": {
            name: version(name) for name in ("heatrun", "jax", "numpy", "scipy", "optimistix")
        },
        "rows": rows,
    }
    text = json.dumps(content, indent=1) + "\n"
    (options.out / "study.json").write_text(text, encoding="utf-8")
    written = table(rows, " ".join(sys.argv), options.seed, planned)
    (options.out / "table.md").write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
