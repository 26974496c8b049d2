"""The benchmark: heatrun beside the same arithmetic in C and numba, in turns in one process.

    python tests/benchmarks/run.py [--small]

Prints a table with targets and writes `results/bench/table.md` and `table.json`. Ratios are
medians of pairs measured in turns, because machines are shared and drift by a factor of two.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import heatrun  # noqa: F401  (sets XLA's options before JAX is used)

import jax  # isort: skip
import jax.numpy as jnp  # isort: skip
import numpy as np  # isort: skip

sys.path.insert(0, str(Path(__file__).parent))
import ours
import rivals

ROOT = Path(__file__).parents[2]
TRUTH = np.array([666.75, 15060.1, 0.14485, 0.11625, 0.0062, 20.0])


def record(num: int, seed: int = 5) -> dict:
    """A duty of the reference motor at 10 Hz: `num` samples, noise 0.3 K."""
    rng = np.random.default_rng(seed)
    hold = 2400
    level = np.repeat(rng.uniform(40.0, 125.0, num // hold + 1), hold)[:num]
    made = {
        "step": 0.1,
        "current_squared": level**2,
        "losses": 400.0 + 0.02 * level**2,
        "ambient": np.full(num, 20.0),
        "measured": np.zeros(num),
    }
    network, losses, start = ours.build(TRUTH)
    import lptn

    reading = lptn.reading(network, losses, ours.inputs_of(made), start)
    made["measured"] = np.asarray(reading[1:]) + 0.3 * rng.standard_normal(num)
    return made


def in_turns(first, second, repeats: int) -> tuple[float, float, float, float]:
    """Return medians of both [s], the median ratio, and half its central 50 % spread."""
    jax.block_until_ready(first())
    jax.block_until_ready(second())
    pairs = []
    for _ in range(repeats):
        pair = []
        for call in (first, second):
            begin = time.perf_counter()
            jax.block_until_ready(call())
            pair.append(time.perf_counter() - begin)
        pairs.append(pair)
    pairs = np.array(pairs)
    ratio = pairs[:, 0] / pairs[:, 1]
    low, high = np.quantile(ratio, [0.25, 0.75])
    return *np.median(pairs, axis=0), float(np.median(ratio)), float(0.5 * (high - low))


def measure(num: int, repeats: int, steps: int, small: bool) -> list[dict]:
    rng = np.random.default_rng(1)
    made = record(num)
    rows = []

    def row(what, value, unit, target, detail=""):
        rows.append(
            {
                "what": what,
                "value": value,
                "unit": unit,
                "target": target,
                "missed": target is not None and value > target,
                "detail": detail,
            }
        )

    with tempfile.TemporaryDirectory() as folder:
        in_c = rivals.c_likelihood(made, Path(folder))
        in_numba = rivals.numba_likelihood(made)
        mine = ours.likelihood(made)
        check = TRUTH * (1 + 1e-3 * rng.standard_normal((4, 6)))
        for rival in filter(None, (in_c, in_numba)):
            np.testing.assert_allclose(rival(check), mine(jnp.asarray(check)), rtol=1e-9)
        for walkers, target in ((1, 1.1), (32, 2.0), (64, 1.5), (128, 1.5)):
            theta = TRUTH * (1 + 1e-3 * rng.standard_normal((walkers, 6)))
            on_device = jnp.asarray(theta)
            for name, rival in (("C", in_c), ("numba", in_numba)):
                if rival is None:
                    continue
                a, b, ratio, spread = in_turns(
                    lambda d=on_device: mine(d), lambda r=rival, t=theta: r(t), repeats
                )
                row(
                    f"likelihood of {walkers} / {name}",
                    ratio,
                    "1",
                    target if name == "C" else None,
                    f"{1e3 * a:.2f} ms / {1e3 * b:.2f} ms, ± {spread:.2f}",
                )
        one = jnp.asarray(TRUTH)
        if in_c is not None:
            jac = ours.jacobian(made)
            a, b, ratio, spread = in_turns(lambda: jac(one), lambda: in_c(TRUTH[None]), repeats)
            row(
                "residual and Jacobian (4) / one in C",
                ratio,
                "1",
                3.0,
                f"{1e3 * a:.2f} ms / {1e3 * b:.2f} ms, ± {spread:.2f}",
            )
        coloured = ours.coloured(made)
        sixty_four = jnp.asarray(TRUTH * (1 + 1e-3 * rng.standard_normal((64, 6))))
        a, b, ratio, spread = in_turns(
            lambda: coloured(sixty_four), lambda: mine(sixty_four), repeats
        )
        row(
            "OU + white / white likelihood, 64",
            ratio,
            "1",
            1.2,
            f"{1e3 * a:.2f} ms / {1e3 * b:.2f} ms, ± {spread:.2f}",
        )
        rows += samplers(made, mine, in_numba, steps)
    rows += fits(made)
    if not small:
        rows += cold()
    return rows


def fits(made: dict) -> list[dict]:
    from heatrun.fit import fit

    rows = []
    problem = ours.problem(made)
    begin = time.perf_counter()
    found = fit(problem)
    first = time.perf_counter() - begin
    begin = time.perf_counter()
    fit(ours.problem(made))
    warm = time.perf_counter() - begin
    detail = (
        f"{found.stats['num_starts']:.0f} starts, noise and covariance, {made['measured'].size} "
        f"samples reduced to 2 s; Ceq_w {found.values()['Ceq_w']:.1f} J/K"
    )
    for what, value, target in (
        ("complete fit, warm", warm, 0.1),
        ("complete fit, compiling", first, None),
    ):
        rows.append(
            {
                "what": what,
                "value": value,
                "unit": "s",
                "target": target,
                "missed": target is not None and value > target,
                "detail": detail,
            }
        )
    return rows


def samplers(made: dict, mine, in_numba, steps: int) -> list[dict]:
    import emcee

    from heatrun.problem import log_posterior_batch

    rows = []
    start = TRUTH * (1 + 1e-3 * np.random.default_rng(2).standard_normal((64, 6)))

    def run(density, start, steps):
        sampler = emcee.EnsembleSampler(start.shape[0], start.shape[1], density, vectorize=True)
        begin = time.perf_counter()
        sampler.run_mcmc(start, steps)
        return time.perf_counter() - begin

    def of(likelihood):
        return lambda theta: np.where(
            np.all(theta > 0, axis=1), -0.5 * np.asarray(likelihood(theta)) / 0.09, -np.inf
        )

    run(of(lambda t: mine(jnp.asarray(t))), start, 5)
    if in_numba is not None:
        times = [
            (run(of(lambda t: mine(jnp.asarray(t))), start, steps), run(of(in_numba), start, steps))
            for _ in range(3)
        ]
        ratio = float(np.median([a / b for a, b in times]))
        full = 2000 / steps * float(np.median([a for a, _ in times]))
        rows.append(
            {
                "what": "emcee 64 walkers, 10 Hz / numba",
                "value": ratio,
                "unit": "1",
                "target": 1.0,
                "missed": ratio > 1.0,
                "detail": f"{steps} steps in turns; 2000 steps would take {full:.1f} s",
            }
        )
    problem = ours.problem(made)
    size = problem.num_parameters + 3
    walkers = 1e-2 * np.random.default_rng(3).standard_normal((64, size))

    def density(vectors):
        return np.asarray(
            log_posterior_batch(problem.structure, problem.data, jnp.asarray(vectors))
        )

    run(density, walkers, 2)
    seconds = 2000 / (10 * steps) * run(density, walkers, 10 * steps)
    rows.append(
        {
            "what": "emcee 64 x 2000 on blocks",
            "value": seconds,
            "unit": "s",
            "target": 2.0,
            "missed": seconds > 2.0,
            "detail": f"{size} parameters with noise and instruments",
        }
    )
    return rows


def cold() -> list[dict]:
    """Time whole commands from a cold process."""
    rows = []
    data = ROOT / "data" / "synthetic"
    with tempfile.TemporaryDirectory() as folder:
        for what, words, target in (
            ("heatrun --help, cold", ["--help"], None),
            (
                "heatrun calibrate, 90 min at 10 Hz, both orders, cold",
                [
                    "calibrate",
                    str(data / "motor.toml"),
                    str(data / "duty_90min.csv.gz"),
                    "--out",
                    f"{folder}/run",
                ],
                20.0,
            ),
        ):
            begin = time.perf_counter()
            subprocess.run(
                [sys.executable, "-m", "heatrun.cli", *words],
                check=True,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            seconds = time.perf_counter() - begin
            rows.append(
                {
                    "what": what,
                    "value": seconds,
                    "unit": "s",
                    "target": target,
                    "missed": target is not None and seconds > target,
                    "detail": "",
                }
            )
    return rows


def markdown(rows: list[dict]) -> str:
    lines = ["| what | measured | target | |", "|---|---|---|---|"]
    for row in rows:
        target = "" if row["target"] is None else f"≤ {row['target']:g} {row['unit']}"
        verdict = "" if row["target"] is None else "met"
        if row["missed"]:
            verdict = f"**missed by {100 * (row['value'] / row['target'] - 1):.0f} %**"
        measured = f"{row['value']:.3g} {row['unit']} ({row['detail']})"
        lines.append(f"| {row['what']} | {measured} | {target} | {verdict} |")
    return "\n".join(lines)


def machine() -> dict:
    names = [
        line.split(":", 1)[1].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    packages = ("heatrun", "jax", "jaxlib", "numpy", "scipy", "emcee", "numba", "optimistix")
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in packages},
        "date": datetime.date.today().isoformat(),
        "command": "make bench",
        "seed": 5,
    }


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--small", action="store_true", help="fewer samples and repeats")
    options = parser.parse_args()
    rows = measure(4000, 3, 5, True) if options.small else measure(45_846, 15, 20, False)
    text = markdown(rows)
    print(text)
    if not options.small:
        folder = ROOT / "results" / "bench"
        folder.mkdir(parents=True, exist_ok=True)
        about = machine()
        (folder / "table.json").write_text(
            json.dumps({"about": about, "rows": rows}, indent=1) + "\n"
        )
        versions = ", ".join(f"{k} {v}" for k, v in about["versions"].items())
        head = (
            f"# Benchmark\n\n`{about['command']}`, seed {about['seed']}, {about['date']}, "
            f"{about['processor']}, {about['cores']} cores, "
            f"Python {about['python']}, {versions}.\n\n"
        )
        (folder / "table.md").write_text(head + text + "\n")


if __name__ == "__main__":
    main()
