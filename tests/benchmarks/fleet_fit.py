"""Machines per second: the batch fit of a fleet against a loop of the fit of one, in turns.

    python tests/benchmarks/fleet_fit.py --machines 1 64 512

Each machine is a random one with two tests of two hours, simulated by the bench of `data/synthetic`
and reduced to blocks. Both fits are warm. The processor time counts, for the machine may be shared;
the loop is timed on a few of the machines, and in turns with the batch.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "data" / "synthetic"), str(ROOT / "tests" / "fleet")]

import generator  # noqa: E402
import numpy as np  # noqa: E402
from fleet_machines import machine  # noqa: E402

from heatrun.fleet.batch.fit import WIDTH, NotBatched, fits  # noqa: E402
from heatrun.inference.fitting.fit import fit  # noqa: E402

NUM_SIMULATED, NUM_ALONE, NOISE_K = 32, 4, 0.05


def problems(num: int, seed: int, sample_s: float):
    """Yield problems: as many machines as are simulated, then the same with readings anew."""
    rng = np.random.default_rng(seed)
    profiles = generator.duty(7200.0), generator.staircase(7200.0)
    known = [
        machine(generator, seed + i, profiles, sample_s=sample_s)
        for i in range(min(num, NUM_SIMULATED))
    ]
    for place in range(num):
        problem = known[place % len(known)]
        if place >= len(known):
            tests = tuple(
                replace(
                    test, measured=test.measured + NOISE_K * rng.standard_normal(test.num_blocks)
                )
                for test in problem.tests
            )
            problem = replace(problem, tests=tests)
        yield place, problem


def timed(work) -> tuple[float, float, list]:
    """Return wall and processor time [s] of something, and what it returns."""
    wall, processor = time.perf_counter(), time.process_time()
    found = list(work)
    return time.perf_counter() - wall, time.process_time() - processor, found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, nargs="+", default=[1, 64, 512])
    parser.add_argument("--width", type=int, default=WIDTH)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sample", type=float, default=0.5, help="period of the logger [s]")
    chosen = parser.parse_args()
    warm = list(problems(NUM_ALONE, chosen.seed, chosen.sample))
    timed(fits(warm, width=chosen.width))
    timed(fit(problem) for _, problem in warm[:1])
    print("machines  batch: wall ms  processor ms  per s  left over", end="")
    print("   one: wall ms  processor ms  ratio")
    for num in chosen.machines:
        work = list(problems(num, chosen.seed, chosen.sample))
        wall, processor, found = timed(fits(work, width=chosen.width))
        left = sum(isinstance(result, NotBatched) for _, result in found)
        of_one = [problem for _, problem in work[:NUM_ALONE]]
        wall_one, processor_one, _ = timed(fit(problem) for problem in of_one)
        ms, ms_one = 1e3 * processor / num, 1e3 * processor_one / len(of_one)
        print(
            f"{num:8d}  {1e3 * wall / num:14.0f}  {ms:12.0f}  {num / wall:5.1f}  {left:9d}  "
            f"{1e3 * wall_one / len(of_one):13.0f}  {ms_one:12.0f}  {ms_one / ms:5.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
