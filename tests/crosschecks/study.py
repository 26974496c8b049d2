"""The cross-checks at full length; writes `results/crosschecks/table.md` and `table.json`.

    make study-crosschecks

Simulation by scipy and diffrax, the fit by scipy on a simulator in numba, the posterior by NUTS
of numpyro and blackjax. Times are those of one run on a machine that others may use.
"""

from __future__ import annotations

import datetime
import json
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

import heatrun  # noqa: F401  (sets XLA's options before JAX is used)

sys.path.insert(0, str(Path(__file__).parent))

import chains
import fits
import numpy as np
import report
import simulation

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
        draws, diverging = sampler(found, **long, seed=SEED)
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


def main() -> None:
    """Run everything and write the tables."""
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
    text = report.markdown(result)
    (OUT / "table.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
