"""Posteriors: emcee on heatrun's density beside a numba one, and beside NUTS and PINTS."""

import time
import warnings
from collections.abc import Callable
from functools import partial

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
from heatrun.model.problem import NUM_NOISE, log_posterior, log_posterior_batch
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
    for name, build in (("numpyro NUTS", _numpyro), ("blackjax NUTS", _blackjax)):
        draw = build(found, *steps)
        if draw is None:
            continue
        draw()
        begin = time.perf_counter()
        draws = draw()
        row(f"{name}, whitened", time.perf_counter() - begin, draws)
    draw = _pints(found, 500 if small else 20_000)
    if draw is not None:
        begin = time.perf_counter()
        draws = draw()
        row("pints (Haario-Bardenet), whitened", time.perf_counter() - begin, draws)
    return rows


def _whitened(found: Fit) -> Callable:
    factor = jnp.asarray(np.linalg.cholesky(found.covariance))
    density = partial(log_posterior, found.problem.structure, found.problem.data)
    return lambda y: density(jnp.asarray(found.vector) + factor @ y)


@needs("numpyro")
def _numpyro(found: Fit, num_warmup: int, num_draws: int) -> Callable | None:
    from numpyro.infer import MCMC, NUTS

    density = _whitened(found)
    sampler = MCMC(NUTS(potential_fn=lambda y: -density(y)), num_warmup=num_warmup,
                   num_samples=num_draws, progress_bar=False)  # fmt: skip

    def draw():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sampler.run(jax.random.key(0), init_params=jnp.zeros(found.vector.size))
        return np.asarray(sampler.get_samples(group_by_chain=True))

    return draw


@needs("blackjax")
def _blackjax(found: Fit, num_warmup: int, num_draws: int) -> Callable | None:
    import blackjax

    density = _whitened(found)

    @jax.jit
    def run(key):
        warm, key = jax.random.split(key)
        adaptation = blackjax.window_adaptation(blackjax.nuts, density)
        (state, tuned), _ = adaptation.run(warm, jnp.zeros(found.vector.size), num_warmup)
        kernel = blackjax.nuts(density, **tuned)

        def step(state, key):
            state, _ = kernel.step(key, state)
            return state, state.position

        return jax.lax.scan(step, state, jax.random.split(key, num_draws))[1]

    return lambda: np.asarray(run(jax.random.key(0)))[None]


@needs("pints")
def _pints(found: Fit, num_draws: int) -> Callable | None:
    import pints

    density = jax.jit(_whitened(found))
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
