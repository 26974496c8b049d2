"""The benchmark: heatrun beside what a user would take instead, in turns in one process.

    make bench
    python tests/benchmarks/run.py [--small] [--only SECTION]

Prints tables with targets and writes `results/bench/table.md` and `table.json`; with `--only`
the rows of one section are measured again and the others kept. Ratios are
medians of pairs measured in turns, because machines are shared and drift by a factor of two; the
load stands in the head of the page. A rival that is not installed is skipped with a line, one that
would take hours is timed per evaluation and marked as extrapolated.
"""

import argparse
import dataclasses
import datetime
import json
import os
import platform
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import as_the_commands  # noqa: F401
import growth
import likelihoods
import processes
import samplers
import searches
from duty_record import SEED, record
from rows import Row, markdown

OUT = Path(__file__).parents[2] / "results" / "bench"
NUM = 45_846
"""Samples of the published 76-minute test at 10 Hz."""

PACKAGES = ("heatrun", "jax", "jaxlib", "numpy", "scipy", "emcee", "numba", "optimistix", "diffrax",
            "casadi", "numpyro", "blackjax", "pints")  # fmt: skip


def measure(small: bool, only: str | None) -> tuple[list[Row], dict]:
    """Run the sections; return their rows, and by section what it took and the load [s, 1]."""
    made = record(4000 if small else NUM)
    repeats, steps = (3, 5) if small else (21, 20)
    sections = {
        "likelihood": [
            lambda: likelihoods.by_hand(made, repeats),
            lambda: likelihoods.by_solvers(made, repeats),
        ],
        "fit": [lambda: searches.one_search(made, repeats), lambda: searches.whole(made)],
        "posterior": [
            lambda: samplers.ensembles(made, steps),
            lambda: samplers.effective_draws(made, small),
        ],
        "growth": [
            lambda: growth.with_samples(small),
            lambda: growth.with_walkers(made, small),
            lambda: growth.with_tests(small),
            lambda: growth.with_nodes_and_effects(made),
        ],
        "processes": [processes.help_of_each, processes.import_alone]
        + ([] if small else [processes.commands]),
        "long": [] if small else [processes.large_record],
    }
    rows, runs = [], {}
    for name, calls in sections.items():
        if only not in (None, name):
            continue
        load, begin = os.getloadavg()[0], time.perf_counter()
        for call in calls:
            rows += call()
        taken = time.perf_counter() - begin
        runs[name] = {
            "seconds": taken, "load": [load, os.getloadavg()[0]],
            "date": datetime.date.today().isoformat(),
        }  # fmt: skip
        print(f"· {name}: {taken:.0f} s", file=sys.stderr)
    return rows, runs


def merged(listed: list[dict], rows: list[Row]) -> list[Row]:
    """Return the rows of the last benchmark with new ones in the place of their sections'."""
    fields = [field.name for field in dataclasses.fields(Row)]
    old = [Row(**{name: row[name] for name in fields}) for row in listed]
    new = {row.section for row in rows}
    first = next((i for i, row in enumerate(old) if row.section in new), len(old))
    after = [row for row in old[first:] if row.section not in new]
    return old[:first] + rows + after


def machine() -> dict:
    """Return what the figures were measured with."""
    names = [
        line.split(":", 1)[1].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in PACKAGES},
        "command": "make bench",
        "seed": SEED,
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--small", action="store_true", help="fewer samples and repeats")
    parser.add_argument("--only", help="one section")
    options = parser.parse_args()
    rows, runs = measure(options.small, options.only)
    print(markdown(rows))
    if options.small:
        return
    if options.only:
        last = json.loads((OUT / "table.json").read_text())
        rows, runs = merged(last["rows"], rows), last["about"]["runs"] | runs
    about = machine() | {"runs": runs}
    OUT.mkdir(parents=True, exist_ok=True)
    listed = [{**dataclasses.asdict(row), "missed": row.missed} for row in rows]
    (OUT / "table.json").write_text(json.dumps({"about": about, "rows": listed}, indent=1) + "\n")
    (OUT / "table.md").write_text(head(about, rows) + markdown(rows) + "\n")


def head(about: dict, rows: list[Row]) -> str:
    """Return what stands above the tables."""
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    runs = "; ".join(
        f"{name} {run['seconds'] / 60:.1f} min at {run['load'][0]:.1f} to {run['load'][1]:.1f}, "
        f"{run['date']}"
        for name, run in about["runs"].items()
    )
    missed = sum(row.missed for row in rows)
    return (
        f"# Benchmark\n\n`{about['command']}`, seed {about['seed']}, "
        f"{about['processor']}, {about['cores']} cores, Python {about['python']}, {versions}.\n\n"
        f"Time of each section and load of the machine, of which one to two are the benchmark's "
        f"own: {runs}. {missed} of {sum(row.target is not None for row in rows)} targets are "
        "missed.\n\n"
    )


if __name__ == "__main__":
    main()
