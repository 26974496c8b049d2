"""Posteriors: emcee on heatrun's density beside a numba one, and beside NUTS and PINTS."""

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "crosschecks"))

import chains
import emcee
import jax
import jax.numpy as jnp
import numpy as np
import ours
import rivals
from duty_record import around
from rows import Row, duration, needs, seconds

from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.problem import NUM_NOISE, log_posterior_batch
from heatrun.posterior.importance import importance_sample
from heatrun.posterior.posterior import sample

SECTION = "Posterior"


def ensembles(made: dict, steps: int) -> list[Row]:
    """Time emcee at the full rate in turns with the numba density, and on blocks."""
    rows = []
    mine, in_numba = ours.likelihood(made), rivals.numba_likelihood(made)
    start = around(64, seed=2)

    def run(density, start, steps):
        sampler = emcee.EnsembleSampler(*start.shape, density, vectorize=True)
        return seconds(lambda: sampler.run_mcmc(start, steps) and None)

    def of(likelihood):
        return lambda theta: np.where(
            np.all(theta > 0, axis=1), -0.5 * np.asarray(likelihood(theta)) / 0.09, -np.inf
        )

    here = of(lambda theta: mine(jnp.asarray(theta)))
    run(here, start, 5)
    if in_numba is not None:
        there = of(in_numba)
        run(there, start, 5)
        times = np.array([(run(here, start, steps), run(there, start, steps)) for _ in range(5)])
        ratio = float(np.median(times[:, 0] / times[:, 1]))
        full = 2000 / steps * np.median(times, axis=0)
        quiet = np.divide(*times.min(axis=0))
        detail = (
            f"{steps} steps in turns, fastest {quiet:.2f}; 2000 steps extrapolate to "
            f"{duration(full[0])} / {duration(full[1])}"
        )
        rows.append(Row(SECTION, "emcee 64 walkers, 10 Hz / numba", ratio, "1", 1.0, detail))
    problem = ours.problem(made)
    size = problem.num_parameters + NUM_NOISE
    walkers = 1e-2 * np.random.default_rng(3).standard_normal((64, size))

    def density(vectors):
        return np.asarray(
            log_posterior_batch(problem.structure, problem.data, jnp.asarray(vectors))
        )

    run(density, walkers, 2)
    taken = float(np.median([2000 / (10 * steps) * run(density, walkers, 10 * steps)
                             for _ in range(3)]))  # fmt: skip
    detail = f"{size} parameters with noise and instruments, from {10 * steps} steps"
    rows.append(Row(SECTION, "emcee 64 x 2000 on blocks", taken, "s", 2.0, detail))
    return rows


def effective_draws(made: dict, small: bool) -> list[Row]:
    """Return the time per effective draw of the worst parameter, by sampler, on blocks."""
    found = fit(ours.problem(made))
    rows = []

    def row(name, taken, draws, target=None):
        import arviz

        draws = draws.reshape(2, -1, draws.shape[-1])  # one chain in two halves, for R-hat
        about = arviz.convert_to_dataset({str(i): draws[..., i] for i in range(draws.shape[-1])})
        size = min(float(each) for each in arviz.ess(about, method="bulk").values())
        detail = f"{size:.0f} effective draws in {duration(taken)}, compiling not counted"
        rows.append(Row(SECTION, f"1000 effective draws, {name}", 1000 * taken / size, "s",
                        target, detail))  # fmt: skip

    importance_sample(found)
    begin = time.perf_counter()
    weighted = importance_sample(found)
    taken = time.perf_counter() - begin
    said = f"Pareto k {weighted.pareto_k:.2f}, Kish {weighted.effective_size:.0f}"
    rows.append(Row(SECTION, "importance samples of --quick", taken, "s", 0.5, said))

    sample(found, most_steps=500)
    begin = time.perf_counter()
    posterior = sample(found, most_steps=500 if small else 12_000)
    taken = time.perf_counter() - begin
    # of all draws, not of the thinned ones that are kept; where the samples that the walkers began
    # at agree with them, these stand in
    judged = posterior.convergence or posterior.weighted
    assert judged is not None
    size = judged.effective_size
    said = f"{size:.0f} effective draws in {duration(taken)}, by {posterior.method} in the end"
    rows.append(Row(SECTION, "1000 effective draws, heatrun's emcee", 1000 * taken / size, "s",
                    None, said))  # fmt: skip
    steps = (50, 50) if small else (500, 1000)
    for name, build in (("numpyro", chains.by_numpyro), ("blackjax", chains.by_blackjax)):
        made = needs(name)(partial(build, num_warmup=steps[0], num_draws=steps[1], num_chains=1,
                                   seed=0))(found)  # fmt: skip
        if made is None:
            continue
        made()
        begin = time.perf_counter()
        draws, _ = made()
        row(f"{name} NUTS, whitened", time.perf_counter() - begin, draws)
    draw = _pints(found, 500 if small else 20_000)
    if draw is not None:
        begin = time.perf_counter()
        draws = draw()
        row("pints (Haario-Bardenet), whitened", time.perf_counter() - begin, draws)
    return rows


@needs("pints")
def _pints(found: Fit, num_draws: int) -> Callable | None:
    import pints

    density = jax.jit(chains.whitened_density(found)[0])
    size = found.vector.size

    class Density(pints.LogPDF):
        def __call__(self, x):
            return float(density(jnp.asarray(x)))

        def n_parameters(self):
            return size

    def draw():
        start = np.random.default_rng(0).standard_normal((2, size))
        controller = pints.MCMCController(Density(), 2, list(start))
        controller.set_max_iterations(num_draws // 2)
        controller.set_log_to_screen(False)
        return controller.run()[:, num_draws // 10 :]

    density(jnp.zeros(size))
    return draw
