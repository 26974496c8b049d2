"""Machines per second: a fleet's fits beside those of one machine at a time.

    python tests/benchmarks/fleet.py --machines 1 100 10000 --files 128

Rows of other numbers of machines, or of other ways, stay as an earlier run left them in the JSON
file beside the page, each with its date. So the long ones need not be run with the short ones.

Each machine is a random one with two tests of two hours at 1 Hz, simulated by the bench of
`data/synthetic`. Readings of `NUM_SIMULATED` machines are simulated; further machines have noise of
their own on top. Measured are

- the fits alone, of tests that are reduced already, on `--processes` processes;
- the command `heatrun fleet` from CSV files to its folder;
- the commands `heatrun calibrate --quick`, one after the other;
- what is written by hand today: scipy's least squares on a march compiled by numba, in a pool of
  processes: four parameters and two start temperatures from one start, and a covariance that takes
  the residuals for white noise.
"""

import argparse
import json
import math
import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import islice
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "data" / "synthetic"), str(ROOT / "tests" / "fleet")]

import generator  # noqa: E402
import numpy as np  # noqa: E402
from fleet_machines import NAMES, bench_records, machine  # noqa: E402
from measured import heatrun  # noqa: E402
from run import machine as about_machine  # noqa: E402

from heatrun.fit.fit import fit  # noqa: E402
from heatrun_fleet.job import BATCH  # noqa: E402
from heatrun_fleet.machine import FEWEST, fit_machines  # noqa: E402

OUT = ROOT / "results" / "fleet" / "throughput.md"
NUM_SIMULATED, NOISE_K, SAMPLE_S, DURATION_S = 32, 0.05, 1.0, 7200.0
TARGET_MACHINES, TARGET_S, STEEPEST = 10_000, 600.0, 1.05
NUM_BY_HAND, NUM_QUICK = 16, 3
ORDER = ("fits of", "heatrun fleet", "heatrun calibrate", "scipy")


@dataclass(frozen=True)
class Row:
    what: str
    machines: int
    wall_s: float
    processor_s: float
    memory_MB: float
    note: str = ""
    date: str = field(default_factory=lambda: about_machine()["date"])

    @property
    def key(self) -> tuple[int, int, str]:
        place = next((i for i, what in enumerate(ORDER) if self.what.startswith(what)), len(ORDER))
        return place, self.machines, self.what


def profiles():
    return generator.duty(DURATION_S), generator.staircase(DURATION_S)


@cache
def simulated(seed: int):
    return machine(generator, seed, profiles(), sample_s=SAMPLE_S)


def problems(num: int, seed: int, first: int = 0, every: int = 1):
    """Yield places and problems of each `every`th machine from `first` on."""
    for place in range(first, num, every):
        problem = simulated(seed + place % NUM_SIMULATED)
        if place >= NUM_SIMULATED:
            rng = np.random.default_rng([seed, place])
            tests = tuple(
                replace(t, measured=t.measured + NOISE_K * rng.standard_normal(t.num_blocks))
                for t in problem.tests
            )
            problem = replace(problem, tests=tests)
        yield place, problem


def share_of_fits(num: int, seed: int, first: int, every: int, barrier, answers) -> None:
    """Fit a share of the machines, warm, when all processes are ready."""
    warm = [problem for _, problem in problems(min(num, FEWEST), seed)]
    fit_machines(warm, seed, len(warm))
    fit(warm[0], seed=seed)  # those that are left to it
    work = problems(num, seed, first, every)
    # what a machine is simulated by is no part of the fit
    list(problems(min(num, NUM_SIMULATED), seed, first, every))
    barrier.wait()
    wall = time.perf_counter()
    before, left = time.process_time(), 0
    while batch := [problem for _, problem in islice(work, BATCH)]:
        left += len(fit_machines(batch, seed, len(batch)).alone)
    processor = time.process_time() - before
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    answers.put((time.perf_counter() - wall, processor, left, peak))


def fits_alone(num: int, seed: int, processes: int) -> Row:
    processes = min(processes, num)
    context = multiprocessing.get_context("spawn")
    barrier, answers = context.Barrier(processes), context.Queue()
    workers = [
        context.Process(target=share_of_fits, args=(num, seed, i, processes, barrier, answers))
        for i in range(processes)
    ]
    for worker in workers:
        worker.start()
    said = [answers.get() for _ in workers]
    for worker in workers:
        worker.join()
    walls, processors, left, peaks = zip(*said, strict=True)
    note = f"{processes} processes, largest {max(peaks):.0f} MB"
    note += f"; {sum(left)} fitted by themselves" if sum(left) else ""
    return Row("fits of reduced tests", num, max(walls), sum(processors), max(peaks), note)


def write_files(folder: Path, num: int, seed: int) -> None:
    """Write motor file, manifest and CSV files; machines share those of the simulated ones."""
    folder.mkdir(parents=True)
    rows = ["machine,type,motor,test"]
    for own in range(min(num, NUM_SIMULATED)):
        truth, records = bench_records(generator, seed + own, profiles(), SAMPLE_S)
        (folder / f"motor{own}.toml").write_text(
            f'[motor]\nname = "machine {own}"\ninsulation_class = "F"\n[winding]\n'
            f"phase_resistance_ohm = {truth.phase_resistance_ohm:.6g}\n"
            "reference_temperature_degC = 25.0\n"
        )
        for number, columns in enumerate(records):
            names = list(NAMES)
            table = np.stack([columns[name] for name in names], axis=1)
            np.savetxt(folder / f"m{own}_{number}.csv", table, "%.5g", ",",
                       header=",".join(names), comments="")  # fmt: skip
    for place in range(num):
        own = place % NUM_SIMULATED
        rows += [f"M{place:05d},A,motor{own}.toml,m{own}_{number}.csv" for number in (0, 1)]
    (folder / "machines.csv").write_text("\n".join(rows) + "\n")


def by_commands(num: int, seed: int, folder: Path) -> list[Row]:
    """Time `heatrun fleet`, and `heatrun calibrate --quick` one after the other."""
    bench, cache = folder / "bench", folder / "cache"
    write_files(bench, num, seed)
    rows = []
    for what in ("heatrun fleet, first run", "heatrun fleet, programs compiled before"):
        out = folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        took = heatrun(["fleet", str(bench / "machines.csv"), "--out", str(out)], cache)
        timing = json.loads((out / "timing.json").read_text())["batches"]
        alone = sum(len(each["fitted_alone"]) for each in timing)
        reading = sum(sum(each["reading_processor_s"]) for each in timing)
        note = f"{reading / num * 1e3:.0f} ms of it a machine for reading; {alone} fitted alone"
        rows.append(Row(what, num, took.wall_s, took.processor_s, math.nan, note))
    each = [
        heatrun(["calibrate", str(bench / f"motor{own}.toml"), *[str(bench / f"m{own}_{i}.csv")
                 for i in (0, 1)], "--quick", "--out", str(folder / f"run{own}")], cache)
        for own in range(NUM_QUICK)
    ]  # fmt: skip
    note = "second order, posterior and sheet too; the first one compiles"
    rows.append(Row("heatrun calibrate --quick, one by one", NUM_QUICK,
                    sum(took.wall_s for took in each), sum(took.processor_s for took in each),
                    math.nan, note))  # fmt: skip
    return rows


def by_hand_of_one(place: int) -> float:
    """Fit one machine as it is written by hand; return the processor time [s]."""
    from rivals import numba_reading
    from scipy.optimize import least_squares

    (problem,) = [problem for _, problem in problems(place + 1, 0, place)]
    tests = []
    for test in problem.tests:
        steps = {
            "current_squared": np.asarray(test.inputs.current_squared).ravel(),
            "losses": np.asarray(test.inputs.losses).ravel(),
            "ambient": np.asarray(test.inputs.ambient).ravel(),
            "step": float(np.min(test.inputs.step)),
        }
        tests.append((numba_reading(steps), test.weight.shape, test.measured))
    resistance = problem.motor.phase_resistance_ohm
    for read, _, _ in tests:
        read(np.array([660.0, 15000.0, 0.14, 0.12, resistance, 22.0]))

    def residual(x):
        parts = []
        for number, (read, shape, measured) in enumerate(tests):
            theta = np.array([*np.exp(x[:4]), resistance, x[4 + number]])
            parts.append(measured - read(theta).reshape(shape).mean(axis=1))
        return np.concatenate(parts)

    before = time.process_time()
    start = np.array([*np.log([660.0, 15000.0, 0.14, 0.12]), *[t[2][0] for t in tests]])
    found = least_squares(residual, start, x_scale=[0.3] * 4 + [1.0] * 2)
    noise = np.sqrt(2.0 * found.cost / (found.fun.size - found.x.size))
    np.linalg.inv(found.jac.T @ found.jac) * noise**2
    return time.process_time() - before


def by_hand(processes: int) -> Row:
    """Time scipy's least squares in a pool of processes; compiling is not counted."""
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        used = pool.map(by_hand_of_one, range(NUM_BY_HAND), chunksize=1)
    note = f"{processes} processes; one start, white noise, no instruments, no prior"
    return Row("scipy on numba, by hand", NUM_BY_HAND, sum(used) / processes, sum(used),
               math.nan, note)  # fmt: skip


def text(rows: list[Row]) -> str:
    """Return the page."""
    own = [row for row in rows if row.what.startswith("fits of")]
    about = about_machine()
    lines = [
        "# Throughput of a fleet",
        "",
        "`python tests/benchmarks/fleet.py --machines NUM ... --files NUM` (`make bench-fleet`); "
        "each row is of the last run that measured it. Machines with two tests of "
        f"{DURATION_S / 3600:.0f} h, sampled each {SAMPLE_S:g} s. "
        f"{about['processor']}, {about['cores']} cores, Python "
        f"{about['python']}, heatrun {about['versions']['heatrun']}, jax "
        f"{about['versions']['jax']}.",
        "",
        "| what | machines | wall | processor | a machine | machines per second | | measured |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row.what} | {row.machines} | {row.wall_s:.1f} s | {row.processor_s:.1f} s | "
            f"{1e3 * row.processor_s / row.machines:.0f} ms | {row.machines / row.wall_s:.2f} | "
            f"{row.note} | {row.date} |"
        )
    lines += ["", *_verdicts(own)]
    return "\n".join(lines) + "\n"


def _verdicts(rows: list[Row]) -> list[str]:
    said = []
    largest = max(rows, key=lambda row: row.machines)
    for row in rows:
        if row.machines == TARGET_MACHINES:
            is_met = row.wall_s <= TARGET_S
            said.append(
                f"- {row.machines} machines in at most {TARGET_S:.0f} s on two cores: "
                f"{row.wall_s:.0f} s, "
                + ("met." if is_met else f"**missed by {row.wall_s / TARGET_S - 1:.0%}**.")
            )
    many = [row for row in rows if row.machines >= 100]
    if len(many) > 1:
        slope = np.polyfit(*(np.log([getattr(r, key) for r in many])
                             for key in ("machines", "processor_s")), 1)[0]  # fmt: skip
        said.append(
            f"- Growth of the processor time from {many[0].machines} machines on, exponent at most "
            f"{STEEPEST}: {slope:.3f}, {'met' if slope <= STEEPEST else '**missed**'}."
        )
        grown = many[-1].memory_MB / many[0].memory_MB
        said.append(f"- Largest process: {grown:.2f} times as large for {many[-1].machines} "
                    f"machines as for {many[0].machines}.")  # fmt: skip
    said.append("- No GPU was at hand.")
    if largest.machines < 100_000:
        said.append("- 100 000 machines were not run.")
    return said


def rows_before(path: Path) -> list[Row]:
    """Return the rows of earlier runs."""
    if not path.exists():
        return []
    stored = json.loads(path.read_text())
    return [Row(**{**row, "memory_MB": row["memory_MB"] or math.nan}) for row in stored]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, nargs="*", default=[1, 100, 10_000])
    parser.add_argument("--files", type=int, default=128, help="machines of `heatrun fleet`")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT)
    chosen = parser.parse_args()
    rows = []

    def done(*found: Row) -> None:
        rows.extend(found)
        for row in found:
            print(row, flush=True)

    for num in chosen.machines:
        done(fits_alone(num, chosen.seed, chosen.processes))
    with tempfile.TemporaryDirectory() as folder:
        if chosen.files:
            done(*by_commands(chosen.files, chosen.seed, Path(folder)))
    done(by_hand(chosen.processes))
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    stored = chosen.out.with_suffix(".json")
    new = {row.key for row in rows}
    rows = sorted([*rows, *(row for row in rows_before(stored) if row.key not in new)],
                  key=lambda row: row.key)  # fmt: skip
    chosen.out.write_text(text(rows))
    stored.write_text(
        json.dumps([vars(row) | {"memory_MB": None if math.isnan(row.memory_MB) else row.memory_MB}
                    for row in rows], indent=1) + "\n"
    )  # fmt: skip
    print(f"written: {chosen.out}")


if __name__ == "__main__":
    main()
