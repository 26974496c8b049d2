"""Study of the honesty of the intervals: `make study-coverage`.

Writes rows, gates, tables and figures under `results/coverage/`. Seed 1000 was used to tune;
reports use seed 70000 (50000 was reported before the noise of block means was mended, 60000 before
the heat that a network misses had a prior). Rows go to a file as they come; a run that was killed
goes on from there.
"""

from __future__ import annotations

import argparse
import gzip
import json
import multiprocessing
import os
import platform
import sys
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the arrays are small; threads only wait
sys.path.insert(0, str(Path(__file__).parent))

from coverage_figures import draw_coverage, draw_ranks
from coverage_gates import gates
from coverage_table import table

TUNING_SEED = 1_000
REPORTING_SEED = 70_000

NUM_RECORDS = {
    "as declared": 400,
    "prior draws": 200,
    "exact instruments": 120,
    "slower noise": 60,
    "stronger noise": 60,
    "noise that doubles": 60,
    "heavy tails": 60,
    "truncated": 30,
    "large errors, declared": 30,
    "large errors, not declared": 30,
    "errors taken as none": 30,
    "point samples at 1 Hz": 30,
    "unevenly soaked": 30,
}
"""Records of each cell."""

NUM_EMCEE = {"as declared": 20, "prior draws": 10}
"""Records of a cell on which the ensemble sampler is run as well: a minute and more each, since
its tails must converge too."""

TASKS = 60
"""Records after which a process is replaced: what it has compiled for each length of record stays
in its memory."""

HURRY = {"as declared": 0.75, "prior draws": 0.75}
"""A run that is cut short has these in full before the others [1]."""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--only", choices=NUM_RECORDS, help="this cell alone")
    parser.add_argument("--share", type=float, default=1.0, help="of the records of each cell")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this time")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("results") / "coverage")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / f"rows-{options.seed}.partial.jsonl"
    begin = time.perf_counter()
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {(row["cell"], row["index"]) for row in rows}
    wanted = [
        job for job in jobs(options.seed, options.share) if options.only in (None, job["cell"])
    ]
    waiting = [job for job in wanted if (job["cell"], job["index"]) not in done]
    context = multiprocessing.get_context("spawn")  # JAX must not be forked
    with (
        path.open("a", encoding="utf-8") as file,
        context.Pool(options.processes, maxtasksperchild=TASKS) as pool,
    ):
        for number, row in enumerate(pool.imap_unordered(_run, waiting)):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(f"{number + 1}/{len(waiting)} {row['cell']} {row['index']} "
                  f"{row['seconds']:.1f} s", flush=True)  # fmt: skip
            if time.perf_counter() - begin > 60.0 * options.minutes:
                break
    words = f"--seed {options.seed}"
    if options.only:
        words += f' --share {options.share:g} --only "{options.only}"'
    found = [] if options.only else gates(rows)  # they are for all cells
    write(rows, found, options.out, words, options.seed, len(wanted))
    if len(rows) == len(wanted):
        path.unlink()


def _run(job: dict[str, Any]) -> dict[str, Any]:
    from heatrun.io.caches import use_caches

    use_caches(print)
    from coverage_cases import run

    return run(job)


def jobs(seed: int, share: float) -> Iterator[dict[str, Any]]:
    """Yield the records in such an order that a run cut short has its share of every cell."""
    listed = []
    for cell, count in NUM_RECORDS.items():
        num = max(1, round(share * count))
        every = max(1, num // max(1, round(share * NUM_EMCEE.get(cell, 0)))) | 1
        for index in range(num):
            emcee = cell in NUM_EMCEE and index % every == 0
            job = {"cell": cell, "seed": seed, "index": index, "emcee": emcee}
            listed.append((index / num * HURRY.get(cell, 1.0), job))
    yield from (job for _, job in sorted(listed, key=lambda each: each[0]))


def write(
    rows: list[dict[str, Any]],
    found: list[dict[str, Any]],
    out: Path,
    words: str,
    seed: int,
    planned: int,
) -> None:
    """Write rows, gates, summary, table and figures; `words` are those of the command."""
    rows = sorted(rows, key=lambda row: (list(NUM_RECORDS).index(row["cell"]), row["index"]))
    packages = ("heatrun", "jax", "numpy", "scipy", "optimistix", "emcee")
    content = {
        "command": f"make study-coverage (coverage_study.py {words})",
        "seed": seed,
        "tuning_seed": TUNING_SEED,
        "machine": f"{platform.system()} {platform.machine()}, one thread per process",
        "python": platform.python_version(),
        "versions": {name: version(name) for name in packages},
        "cpu_s": sum(row["cpu_s"] for row in rows),
        "planned": planned,
        "records": {c: sum(r["cell"] == c for r in rows) for c in NUM_RECORDS},
        "gates": found,
    }
    (out / "study.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    (out / "table.md").write_text(table(rows, found, content), encoding="utf-8")
    lines = "".join(json.dumps(_short(row)) + "\n" for row in rows).encode()
    (out / "rows.jsonl.gz").write_bytes(gzip.compress(lines, mtime=0))
    draw_coverage(rows, out / "coverage.png")
    draw_ranks(rows, out / "ranks.png")


def _short(value: Any) -> Any:
    """Return a row with its figures cut to five digits, without times that differ from run to run.

    Ranks come from 4000 draws: more digits say nothing.
    """
    if isinstance(value, dict):
        return {k: _short(v) for k, v in value.items() if k not in ("seconds", "cpu_s")}
    if isinstance(value, list):
        return [_short(v) for v in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()
