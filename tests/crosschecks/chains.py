"""The same posterior by emcee, by weighted draws, and by two No-U-Turn samplers of others.

All draw from the log density that `heatrun` fits and samples, in the coordinates of `Fit.vector`
(standard scores of parameters and noise). The samplers of others see it whitened by the
covariance of the fit, a linear change that leaves the density as it is, and the noise, whose prior
ends, in coordinates without an end.
"""

import tempfile
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from heatrun.calibration import load_tests
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.model import Model
from heatrun.model.noise import LARGEST_SCORES, NOISE
from heatrun.model.problem import Problem, log_posterior
from heatrun.motor.file import load_motor
from heatrun.posterior.weighted import Weighted

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"

Statistics = dict[str, dict[str, tuple[float, float]]]
"""Value and Monte Carlo error of each statistic, by parameter."""

PROBABILITIES = (0.025, 0.5, 0.975)

ACCEPT = 0.95
"""Share of accepted proposals that step sizes are adapted to. At the customary 0.8 some
diverge where the white noise goes to zero, and the tail there is missed."""


EDGE = 0.1
"""Distance [1] from the end of a score at least, at which the samplers of others start."""


def fitted(test: str, order: str, *, until_s: float | None = None) -> Fit:
    motor = load_motor(SYNTHETIC / "motor.toml")
    path = SYNTHETIC / f"{test}.csv.gz"
    with tempfile.TemporaryDirectory() as folder:
        if until_s is not None:
            rows = pd.read_csv(path)
            path = Path(folder) / f"{test}.csv"
            rows[rows["t"] < until_s].to_csv(path, index=False)
        tests = load_tests(motor, [path], [])
    return fit(Problem.of(Model.of(order, motor), motor, [each.blocks for each in tests]))


def names(found: Fit) -> list[str]:
    """Return the names of the coordinates, noise last."""
    return [slot.parameter.name for slot in found.slots] + [p.name for p in NOISE]


def whitened_density(found: Fit) -> tuple[Callable, Callable]:
    """Return the log density of whitened coordinates, and the way back to scores.

    A score s of the noise is u - log(1 + exp(u - end)): u itself far below the end of the prior,
    and never beyond it.
    """
    factor = np.linalg.cholesky(found.covariance)
    density = partial(log_posterior, found.problem.structure, found.problem.data)
    ends = jnp.asarray(LARGEST_SCORES)
    start = np.array(found.vector)
    below = np.minimum(start[-len(ends) :], np.asarray(ends) - EDGE)
    start[-len(ends) :] = below - np.log(-np.expm1(below - np.asarray(ends)))
    centre, matrix = jnp.asarray(start), jnp.asarray(factor)

    def scores(y):
        u = centre + y @ matrix.T
        noise = u[..., -len(ends) :]
        return jnp.concatenate(
            [u[..., : -len(ends)], noise - jax.nn.softplus(noise - ends)], axis=-1
        )

    def whitened(y):
        noise = (centre + matrix @ y)[-len(ends) :]
        return density(scores(y)) + jnp.sum(jax.nn.log_sigmoid(ends - noise))

    return whitened, lambda y: np.asarray(scores(jnp.asarray(y)))


Drawn = tuple[np.ndarray, int]
"""Draws in scores, shape (chain, draw, all), and divergences."""


def by_numpyro(
    found: Fit, *, num_warmup: int, num_draws: int, num_chains: int, seed: int
) -> Callable[[], Drawn]:
    """Return what draws by numpyro's NUTS; what it compiles at first it keeps."""
    from numpyro.infer import MCMC, NUTS

    density, back = whitened_density(found)
    sampler = MCMC(
        NUTS(potential_fn=lambda y: -density(y), target_accept_prob=ACCEPT),
        num_warmup=num_warmup, num_samples=num_draws, num_chains=num_chains,
        chain_method="sequential", progress_bar=False,
    )  # fmt: skip
    start = np.random.default_rng(seed).standard_normal((num_chains, found.vector.size))

    def draw() -> Drawn:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its own internals
            sampler.run(
                jax.random.key(seed),
                init_params=jnp.asarray(start if num_chains > 1 else start[0]),
                extra_fields=("diverging",),
            )
        draws = back(sampler.get_samples(group_by_chain=True))
        return draws, int(np.sum(sampler.get_extra_fields()["diverging"]))

    return draw


def by_blackjax(
    found: Fit, *, num_warmup: int, num_draws: int, num_chains: int, seed: int
) -> Callable[[], Drawn]:
    """As `by_numpyro`, by NUTS of blackjax after its window adaptation."""
    import blackjax

    density, back = whitened_density(found)

    @jax.jit
    def one(key, start):
        warm, run = jax.random.split(key)
        adaptation = blackjax.window_adaptation(
            blackjax.nuts, density, target_acceptance_rate=ACCEPT
        )
        (state, tuned), _ = adaptation.run(warm, start, num_steps=num_warmup)
        kernel = blackjax.nuts(density, **tuned)

        def step(state, key):
            state, info = kernel.step(key, state)
            return state, (state.position, info.is_divergent)

        return jax.lax.scan(step, state, jax.random.split(run, num_draws))[1]

    start = np.random.default_rng(seed).standard_normal((num_chains, found.vector.size))
    keys = jax.random.split(jax.random.key(seed), num_chains)

    def draw() -> Drawn:
        results = [one(key, jnp.asarray(row)) for key, row in zip(keys, start, strict=True)]
        draws = np.stack([np.asarray(positions) for positions, _ in results])
        return back(draws), int(sum(np.sum(diverging) for _, diverging in results))

    return draw


def statistics(found: Fit, vectors: np.ndarray) -> Statistics:
    """Return mean, sd and quantiles with the Monte Carlo errors by ArviZ, and its ESS and R-hat.

    Reference: A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, Rank-normalization,
        folding, and localization: an improved R-hat, Bayesian Analysis 16 (2021) 667-718.
    """
    draws = {name: vectors[..., i] for i, name in enumerate(names(found))}
    import arviz

    data = arviz.convert_to_dataset(draws)
    # the error of a sd by way of that of the variance: ArviZ 0.23 fails on it under NumPy 2.4
    squares = arviz.convert_to_dataset({k: (x - np.mean(x)) ** 2 for k, x in draws.items()})
    error = {f"q{100 * p:g}": arviz.mcse(data, method="quantile", prob=p) for p in PROBABILITIES}
    error["mean"] = arviz.mcse(data, method="mean")
    error_of_squares = arviz.mcse(squares, method="mean")
    verdicts = {
        "ess_bulk": arviz.ess(data, method="bulk"),
        "ess_tail": arviz.ess(data, method="tail"),
        "rhat": arviz.rhat(data),
    }
    result = {}
    for name, x in draws.items():
        sd = float(np.std(x))
        values = {"mean": float(np.mean(x))}
        values |= {f"q{100 * p:g}": float(np.quantile(x, p)) for p in PROBABILITIES}
        result[name] = {key: (value, float(error[key][name])) for key, value in values.items()}
        result[name]["sd"] = (sd, float(error_of_squares[name]) / (2.0 * sd))
        result[name] |= {key: (float(each[name]), 0.0) for key, each in verdicts.items()}
    return result


def weighted_statistics(found: Fit, weighted: Weighted) -> Statistics:
    """As `statistics`, of weighted draws: errors by the delta method of self-normalised means.

    Reference: A. B. Owen, Monte Carlo theory, methods and examples, chapter 9, section 9.2.
    """
    result: Statistics = {}
    w = weighted.weights
    for name, x in zip(names(found), weighted.vectors.T, strict=True):
        mean = float(w @ x)
        sd = float(np.sqrt(w @ (x - mean) ** 2))
        influence = {"mean": x - mean, "sd": ((x - mean) ** 2 - sd**2) / (2 * sd)}
        values = {"mean": mean, "sd": sd}
        order = np.argsort(x)
        level = np.cumsum(w[order])
        for p in PROBABILITIES:
            value, low, high = (
                float(np.interp(q, level, x[order])) for q in (p, 0.8 * p, p + 0.2 * (1 - p))
            )
            density = (0.2 * (1 - p) + 0.2 * p) / (high - low)
            values[f"q{100 * p:g}"] = value
            influence[f"q{100 * p:g}"] = ((x <= value) - p) / density
        result[name] = {
            key: (values[key], float(np.sqrt(np.sum(w**2 * influence[key] ** 2)))) for key in values
        }
    return result


def z_values(one: Statistics, other: Statistics) -> dict[str, dict[str, float]]:
    """Return differences over their joint Monte Carlo error, by parameter and statistic [1]."""
    return {
        name: {
            key: (one[name][key][0] - other[name][key][0])
            / float(np.hypot(one[name][key][1], other[name][key][1]))
            for key in other[name]
            if key in one[name] and key not in ("ess_bulk", "ess_tail", "rhat")
        }
        for name in one
    }
