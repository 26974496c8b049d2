"""Likelihood and commands of this tree beside those of an earlier commit, in turns.

    python tests/benchmarks/against.py --before 49dbf28

49dbf28 is the last commit before unmodelled heat entered the likelihood. Both trees run in
processes of their own with the packages that are installed here, one after the other, and again;
the processor time counts, for the machine may be shared. Compilations are kept from the first turn,
which is not counted.
"""

from __future__ import annotations

import argparse
import datetime
import io
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from measured import ROOT, environment, heatrun

OUT = ROOT / "results" / "bench" / "against_before.md"
MOST = 3.0

LIKELIHOOD = """
import sys, time
sys.path.insert(0, "tests/benchmarks")
import jax, numpy as np
from heatrun.runtime import configure
configure()
import ours
from duty_record import record
from heatrun.fit.fit import fit
from heatrun.model.problem import log_posterior_batch
found = fit(ours.problem(record(45846)))
problem = found.problem
vectors = found.vector + 0.01 * np.random.default_rng(0).standard_normal((64, found.vector.size))
def call():
    return jax.block_until_ready(log_posterior_batch(problem.structure, problem.data, vectors))
call()
times = []
for _ in range(200):
    begin = time.process_time()
    call()
    times.append(time.process_time() - begin)
print(np.median(times))
"""


def exported(commit: str, folder: Path) -> Path:
    """Write the tree of a commit; return where."""
    packed = subprocess.run(
        ["git", "archive", commit], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as tree:
        tree.extractall(folder, filter="data")
    return folder


def of_likelihood(tree: Path, cache: Path) -> float:
    """Return the processor time of 64 log posteriors [s]."""
    done = subprocess.run(
        [sys.executable, "-c", LIKELIHOOD], cwd=tree, env=environment(cache, tree), check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    return float(done.stdout.split()[-1])


def jobs(motor: str, duty: str, step: str) -> dict:
    """Return what is timed, by name."""

    def command(*words: str):
        def timed(tree: Path, cache: Path) -> float:
            with tempfile.TemporaryDirectory() as out:
                return heatrun([*words, "--out", f"{out}/run"], cache, tree, (0, 1)).processor_s

        return timed

    return {
        "64 log posteriors of 76 min at 10 Hz": of_likelihood,
        "`calibrate --quick`, one test": command("calibrate", motor, duty, "--quick"),
        "`calibrate`, one test and one held out": command(
            "calibrate", motor, duty, "--holdout", step
        ),
        "`discover`, one test and one held out": command(
            "discover", motor, duty, "--holdout", step
        ),
    }


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", default="49dbf28", metavar="COMMIT")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--only", default="", help="what has this in its name")
    parser.add_argument("--out", type=Path, default=OUT)
    chosen = parser.parse_args()
    data = ROOT / "data" / "synthetic"
    files = [str(data / name) for name in ("motor.toml", "duty_90min.csv.gz", "step_90min.csv.gz")]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        before = exported(chosen.before, Path(folder) / "before")
        trees = {"before": before, "now": ROOT}
        for what, job in jobs(*files).items():
            if chosen.only not in what:
                continue
            times: dict[str, list[float]] = {name: [] for name in trees}
            for turn in range(chosen.turns + 1):
                for name, tree in trees.items():
                    taken = job(tree, Path(folder) / f"cache_{name}")
                    if turn:
                        times[name].append(taken)
            ratios = [n / b for n, b in zip(times["now"], times["before"], strict=True)]
            rows.append((what, *(statistics.median(times[name]) for name in trees), ratios))
            print(rows[-1], flush=True)
    words = f"--before {chosen.before} --turns {chosen.turns}"
    words += f' --only "{chosen.only}"' if chosen.only else ""
    chosen.out.write_text(page(rows, words, chosen.turns))


def page(rows: list, words: str, turns: int) -> str:
    """Return the table."""
    lines = [
        "# Before unmodelled heat and now, in turns",
        "",
        f"`python tests/benchmarks/against.py {words}`, "
        f"{datetime.date.today()}. Processor time, median of {turns} turns; the ratio is the "
        "median of those of the turns, with the smallest and the largest. The likelihood may cost "
        f"{MOST:g} times as much as before.",
        "",
        "| what | before | now | now / before | |",
        "|---|---|---|---|---|",
    ]
    for what, before, now, ratios in rows:
        ratio = statistics.median(ratios)
        unit, scale = ("ms", 1e3) if now < 1.0 else ("s", 1.0)
        verdict = ""
        if "posterior" in what:
            verdict = "met" if ratio <= MOST else f"**MISSED by {ratio / MOST - 1.0:.0%}**"
        lines.append(
            f"| {what} | {scale * before:.3g} {unit} | {scale * now:.3g} {unit} | {ratio:.2f} "
            f"({min(ratios):.2f}…{max(ratios):.2f}) | {verdict} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
