"""The cross-checks at full length; writes `results/crosschecks/table.md` and `table.json`.

    make study-crosschecks

Simulation by scipy and diffrax, the fit by scipy on a simulator in numba, the posterior by NUTS
of numpyro and blackjax. Times are those of one run on a machine that others may use.
"""

import datetime
import json
import platform
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import chains
import fits
import numpy as np
import simulation

import heatrun  # noqa: F401  (sets XLA's options before JAX is used)
from heatrun.posterior.importance import importance_sample, linear_sample
from heatrun.posterior.posterior import sample

SEED = 20
SHORT_S = 120.0
"""A test so short that the posterior bends and has tails."""

OUT = Path(__file__).parents[2] / "results" / "crosschecks"
PACKAGES = ("jax", "numpy", "scipy", "diffrax", "numba", "numpyro", "blackjax", "emcee", "arviz")


def simulations() -> list[dict]:
    """Compare whole records at 2 s and their first half hour at 10 Hz."""
    rows = []
    for test, step, num in (("duty_90min", 2.0, None), ("duty_30min", 0.1, None)):
        inputs = simulation.bundled_inputs(test, step, num)
        for name in simulation.NODES:
            gaps = simulation.gaps(name, inputs)
            rows.append({"record": test, "step_s": step, "network": name, "gaps_K": gaps})
    return rows


def posteriors(found) -> dict:
    """Draw by all samplers; return statistics, z values of all pairs, and what each took."""
    long = {"num_warmup": 1000, "num_draws": 2000, "num_chains": 4}
    statistics, about = {}, {}

    def take(name, draw):
        begin = time.perf_counter()
        statistics[name], said = draw()
        about[name] = {"seconds": time.perf_counter() - begin, **said}

    def by_emcee():
        posterior = sample(found, seed=SEED)
        return chains.statistics(found, posterior.vectors), {"said": posterior.sentence()}

    def by(sampler):
        draws, diverging = sampler(found, **long, seed=SEED)()
        return chains.statistics(found, draws), {"said": f"{diverging} divergences"}

    def by_weights(weighted):
        said = (
            f"Pareto k {weighted.pareto_k:.2f}, {weighted.effective_size:.0f} effective draws"
            f" of {weighted.weights.size}"
        )
        return chains.weighted_statistics(found, weighted), {"said": said}

    take("emcee", by_emcee)
    take("numpyro NUTS", lambda: by(chains.by_numpyro))
    take("blackjax NUTS", lambda: by(chains.by_blackjax))
    take("randomize-then-optimize", lambda: by_weights(importance_sample(found, seed=SEED)))
    take("linear models", lambda: by_weights(linear_sample(found, num_draws=32_768, seed=SEED)))
    pairs = {}
    labels = list(statistics)
    for i, one in enumerate(labels):
        for other in labels[i + 1 :]:
            z = chains.z_values(statistics[one], statistics[other])
            values = np.array([v for row in z.values() for v in row.values()])
            pairs[f"{one} / {other}"] = {
                "largest": float(np.max(np.abs(values))),
                "rms": float(np.sqrt(np.mean(values**2))),
                "z": z,
            }
    return {"statistics": statistics, "about": about, "pairs": pairs}


def markdown(result: dict[str, Any]) -> str:
    about = result["about"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    parts = [
        "# Cross-checks with tools that others wrote",
        f"`{about['command']}`, seed {about['seed']}, {about['date']}, Python {about['python']}, "
        f"{versions}.",
        _simulation(result["simulation"]),
        _fit(result["fit"]),
        *(_posterior(test, found) for test, found in result["posterior"].items()),
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _table(rows: list[list[str]]) -> str:
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _simulation(rows: list[dict]) -> str:
    columns = list(rows[0]["gaps_K"])
    table = [["record, step", "network", *columns]]
    for row in rows:
        gaps = (f"{row['gaps_K'][column]:.1e}" for column in columns)
        table.append([f"{row['record']}, {row['step_s']:g} s", row["network"], *gaps])
    return (
        "## The same simulation\n\nLargest difference of any node at any edge [K]. The balances "
        "were written again from their equations, without code of `lptn`; inputs are constant "
        f"over each step.\n\n{_table(table)}"
    )


def _fit(fits: dict[str, dict]) -> str:
    table = [["parameter", *fits]]
    for name in next(iter(fits.values()))["gap_in_sd"]:
        table.append([name, *(f"{fit['gap_in_sd'][name]:+.1e}" for fit in fits.values())])
    apart = [f["sum_of_squares_heatrun"] - f["sum_of_squares_scipy"] for f in fits.values()]
    table.append(["sum of squares, heatrun − scipy", *(f"{each:+.1e}" for each in apart)])
    return (
        "## The same fit\n\n`scipy.optimize.least_squares` with derivatives by differences, on a "
        "fourth-order simulator in numba, a dense noise covariance and the priors written anew, "
        "from a start off by a factor of two in each network parameter. scipy's optimum minus "
        f"heatrun's, in posterior standard deviations.\n\n{_table(table)}"
    )


def _posterior(test: str, found: dict) -> str:
    statistics, about = found["statistics"], found["about"]
    samplers = [["sampler", "smallest bulk ESS", "largest R-hat", "seconds", "said"]]
    for name, rows in statistics.items():
        least = _least(rows, "ess_bulk", min, "{:.0f}"), _least(rows, "rhat", max, "{:.4f}")
        samplers.append([name, *least, f"{about[name]['seconds']:.0f}", about[name]["said"]])
    agreement = [["pair", "largest \\|z\\|", "rms z"]]
    for name, pair in found["pairs"].items():
        agreement.append([name, f"{pair['largest']:.2f}", f"{pair['rms']:.2f}"])
    values = [["parameter", *statistics]]
    for name in next(iter(statistics.values())):
        said = ((*rows[name]["mean"], *rows[name]["sd"]) for rows in statistics.values())
        values.append([name, *("{:+.4f} ± {:.4f}; {:.4f} ± {:.4f}".format(*one) for one in said)])
    return (
        f"## The same posterior, {test}\n\nSecond order, all free parameters and the noise, in "
        f"standard scores of their priors.\n\n{_table(samplers)}\n\nDifferences of mean, sd and "
        "the 2.5, 50 and 97.5 % quantiles of every parameter over their joint Monte Carlo error "
        f"(ArviZ; delta method for weighted draws); 1 is what chance makes of the rms.\n\n"
        f"{_table(agreement)}\n\nMean and sd of each parameter, each ± its Monte Carlo error.\n\n"
        f"{_table(values)}"
    )


def _least(rows: dict, key: str, choose, form: str) -> str:
    if any(key not in row for row in rows.values()):
        return ""
    return form.format(choose(row[key][0] for row in rows.values()))


def main() -> None:
    fitted = {test: chains.fitted(test, "second") for test in ("duty_30min", "duty_90min")}
    short = chains.fitted("step_30min", "second", until_s=SHORT_S)
    result = {
        "about": {
            "command": "make study-crosschecks",
            "seed": SEED,
            "date": datetime.date.today().isoformat(),
            "python": platform.python_version(),
            "versions": {name: version(name) for name in PACKAGES},
        },
        "simulation": simulations(),
        "fit": {test: fits.agreement(found) for test, found in fitted.items()},
        "posterior": {
            test: posteriors(found)
            for test, found in (*fitted.items(), ("step_30min, two minutes", short))
        },
    }
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "table.json").write_text(json.dumps(result, indent=1) + "\n")
    text = markdown(result)
    (OUT / "table.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
