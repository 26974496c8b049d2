"""The benchmark: heatrun beside what a user would take instead, in turns in one process.

    make bench
    python tests/benchmarks/run.py [--small] [--only SECTION]

Prints tables with targets and writes `results/bench/table.md` and `table.json`. Ratios are
medians of pairs measured in turns, because machines are shared and drift by a factor of two; the
load stands in the head of the page. A rival that is not installed is skipped with a line, one that
would take hours is timed per evaluation and marked as extrapolated.
"""

from __future__ import annotations

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

sys.path.insert(0, str(Path(__file__).parent))

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


def measure(small: bool, only: str | None) -> list[Row]:
    """Run the sections and return their rows."""
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
        "processes": [processes.help_of_each]
        + ([] if small else [processes.commands, processes.large_record]),
    }
    rows = []
    for name, calls in sections.items():
        for call in calls if only in (None, name) else ():
            begin = time.perf_counter()
            rows += call()
            print(f"· {name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr)
    return rows


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
        "date": datetime.date.today().isoformat(),
        "command": "make bench",
        "seed": SEED,
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--small", action="store_true", help="fewer samples and repeats")
    parser.add_argument("--only", help="one section")
    options = parser.parse_args()
    load, begin = os.getloadavg()[0], time.perf_counter()
    rows = measure(options.small, options.only)
    taken = time.perf_counter() - begin
    text = markdown(rows)
    print(text)
    if options.small or options.only:
        return
    about = machine() | {"load": [load, os.getloadavg()[0]], "seconds": taken}
    OUT.mkdir(parents=True, exist_ok=True)
    listed = [{**dataclasses.asdict(row), "missed": row.missed} for row in rows]
    (OUT / "table.json").write_text(json.dumps({"about": about, "rows": listed}, indent=1) + "\n")
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    missed = sum(row.missed for row in rows)
    head = (
        f"# Benchmark\n\n`{about['command']}`, seed {about['seed']}, {about['date']}, "
        f"{about['processor']}, {about['cores']} cores, Python {about['python']}, {versions}. "
        f"It took {taken / 60:.0f} min; load of the machine {load:.1f} at the start and "
        f"{about['load'][1]:.1f} at the end, of which one to two are the benchmark's own. "
        f"{missed} of {sum(row.target is not None for row in rows)} targets are missed.\n\n"
    )
    (OUT / "table.md").write_text(head + text + "\n")


if __name__ == "__main__":
    main()
