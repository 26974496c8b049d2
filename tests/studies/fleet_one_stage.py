"""One stage: all machines of a fleet at once, from their readings, by NUTS, beside the two stages.

What two stages leave out is here: the likelihood of each machine's readings as the calibration has
it, in all its parameters (instruments, starts, noise, unmodelled heat) and without any normal law
in between, times the law of the population. The machines are drawn in coordinates in which the two
stages would be exact, with the Jacobian of the change: where the draws lie does not depend on them,
only how soon they are enough. The responses to unmodelled heat are those at each machine's fit.

Reference: M. D. Hoffman, A. Gelman, The No-U-Turn Sampler, JMLR 15 (2014) 1593-1623.
"""

import argparse
import json
import os
import sys
import time
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import heatrun.runtime

# isort: split
import jax
import jax.numpy as jnp
import numpy as np
from fleet_cases import SHORT_MIN, Fleet, draw_fleet, write_fleet
from jax.scipy.stats import norm
from numpyro.diagnostics import effective_sample_size, split_gelman_rubin
from numpyro.infer import MCMC, NUTS
from study_runs import temporary

import heatrun
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.noise import from_scores
from heatrun.model.problem import log_likelihood
from heatrun_fleet.fleet_file import batches_of, digests_of, load_fleet, numerics
from heatrun_fleet.machine import Prepared, prepare
from heatrun_fleet.population.gathered import designed
from heatrun_fleet.population.law import (
    OUTLIER_SCALE,
    OUTLIER_SD,
    OUTLIER_SHARE,
    Law,
    num_scores,
    unpack,
)
from heatrun_fleet.population.of_fleet import gathered_of_fleet, read_fleet
from heatrun_fleet.population.report import default_hyperprior
from heatrun_fleet.population.sampling import Population, sample_population

SEED = 60_000

COVARIATE = "supplier"


class Machines(NamedTuple):
    """What the draws of all machines need, along the first axis."""

    data: Any  # Of the problems, stacked.
    centre: Any  # Prior centre of the thermal parameters, of the logarithm.
    scale: Any  # Its standard deviation.
    mode: Any  # Scores at the fit: parameters, then noise.
    slope: Any  # Of the other scores by the thermal ones, under the covariance of the fit.
    factor: Any  # Of the other scores' covariance given the thermal ones.
    design: Any  # Covariates.
    information: Any  # Of the second stage.
    precision: Any  # Of the second stage.
    width: Any  # Of the law in whose coordinates the machine is drawn: 1, or that of an outlier.


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--short", type=float, default=1.0, help="share of 30-minute tests: 0 or 1")
    parser.add_argument("--warmup", type=int, default=400)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--chains", type=int, default=2, help="one after another")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results") / "fleet")
    options = parser.parse_args()
    begin = time.monotonic()
    fleet = draw_fleet(options.seed, options.machines, short=options.short)
    with temporary() as folder:
        path = write_fleet(fleet, folder / "bench", options.seed)
        heatrun.calibrate_fleet(path, out=folder / "fleet", workers=options.workers)
        two = _two_stages(folder / "fleet", options.seed)
        print(f"two stages: {time.monotonic() - begin:.0f} s", flush=True)
        fits = _fits(path)
    print(f"fits: {time.monotonic() - begin:.0f} s", flush=True)
    structure, machines, places = _machines(fits, two)
    found, diagnostics = _sample(two, structure, machines, places, options)
    minutes = (time.monotonic() - begin) / 60.0
    content = {
        "command": " ".join(["fleet_one_stage.py", *sys.argv[1:]]),
        "seed": options.seed,
        "machines": options.machines,
        "minutes": minutes,
        "versions": {name: version(name) for name in ("heatrun", "jax", "numpyro", "numpy")},
        "diagnostics": diagnostics,
        "compared": _compared(two, found),
    }
    content["lines"] = _lines(content, fleet)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "one_stage.json").write_text(json.dumps(content, indent=1) + "\n")
    print("\n".join(content["lines"]))


def _two_stages(folder: Path, seed: int) -> Population:
    rows = read_fleet(folder)
    (type,) = rows.types
    gathered = designed(gathered_of_fleet(rows, type), [COVARIATE], str(folder))
    if gathered.left_out:
        raise SystemExit(f"left out: {gathered.left_out}")
    return sample_population(
        gathered.evidence(), default_hyperprior(gathered), gathered.matrix(), seed=seed
    )


def _fits(path: Path) -> list[Fit]:
    """Return the fit of each machine with its problem, which the rows do not hold."""
    loaded = load_fleet(path)
    (batch,) = batches_of(loaded, digests_of(loaded), 10**6, seed=0, numerics=numerics())
    found = []
    for entry in batch.entries:
        ready = prepare(entry, batch)
        if not isinstance(ready, Prepared):
            raise SystemExit(f"{entry.machine} was refused")
        found.append(fit(ready.problem, seed=0, throw=False))
    return found


def _machines(fits: list[Fit], two: Population) -> tuple[Any, Machines, np.ndarray]:
    slots = fits[0].slots
    places = np.array([i for i, slot in enumerate(slots) if slot.parameter.role == "network"])
    others = np.setdiff1d(np.arange(fits[0].vector.size), places)
    rows = []
    for found in fits:
        whole = np.asarray(found.covariance)
        thermal, cross = whole[np.ix_(places, places)], whole[np.ix_(others, places)]
        slope = np.linalg.solve(thermal, cross.T).T
        left = whole[np.ix_(others, others)] - slope @ cross.T
        kinds = [found.slots[i].parameter for i in places]
        rows.append(
            (np.log([each.centre for each in kinds]), np.array([each.sd for each in kinds]),
             found.vector, slope, np.linalg.cholesky(left))
        )  # fmt: skip
    data = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(each.problem.data for each in fits))
    usual = np.asarray(_outlier_probability(two)) < 0.5
    numbers = map(jnp.asarray, map(np.stack, zip(*rows, strict=True)))
    evidence = two.evidence
    return (
        fits[0].problem.structure,
        Machines(data, *numbers, *map(jnp.asarray, (
            two.design, evidence.information, evidence.precision,
            np.where(usual, 1.0, OUTLIER_SCALE)))),
        places,
    )  # fmt: skip


def _outlier_probability(two: Population) -> np.ndarray:
    from heatrun_fleet.population.sampling import given_population

    return given_population(two).outlier


def _log_density(
    two: Population, structure: Any, places: np.ndarray, machines: Machines, hypers: Any,
    coordinates: dict[str, Any],
) -> Any:  # fmt: skip
    """Return the log density of everything that is drawn, in its coordinates [nat]."""
    mean, root = hypers
    scores = mean + root @ coordinates["law"]
    law, log_prior = unpack(scores, two.hyper, two.design.shape[1])
    of_machines = jax.vmap(partial(_of_machine, structure, places, law))(
        machines, coordinates["thermal"], coordinates["others"]
    )
    return log_prior + jnp.sum(of_machines)


def cholesky(matrix: Any) -> Any:
    """Return the lower factor of a positive definite matrix.

    Batches of factorisations inside compiled code are shared among XLA's threads, which wait for
    one another for ever where two of them run at once: a population of 300 machines on two cores
    stood still. Rank-one updates, as many as a machine has parameters, have no such trouble and are
    faster.
    """
    size = matrix.shape[0]
    rest, columns = matrix, []
    for pivot in range(size):
        below = jnp.arange(size) >= pivot
        column = jnp.where(below, rest[:, pivot] / jnp.sqrt(rest[pivot, pivot]), 0.0)
        rest = rest - column[:, None] * column
        columns.append(column)
    return jnp.stack(columns, axis=1)


def solve_lower(factor: Any, right: Any) -> Any:
    """Return x with factor x = right, of a lower triangular factor."""
    rows = []
    for pivot in range(factor.shape[0]):
        rows.append(right[pivot] / factor[pivot, pivot])
        right = right - jnp.tensordot(factor[:, pivot], rows[-1], axes=0)
    return jnp.stack(rows)


def _of_machine(
    structure: Any, places: np.ndarray, law: Law, machine: Machines, thermal: Any, other: Any
) -> Any:
    centre = law.mean + machine.design @ law.effects
    wide = machine.width * law.factor
    inner = jnp.eye(centre.size) + wide.T @ machine.precision @ wide
    root = cholesky(inner)
    half = solve_lower(root, wide.T @ (machine.information - machine.precision @ centre))
    back = solve_lower(root, wide.T)
    logs = centre + back.T @ (half + thermal)
    log_jacobian = jnp.sum(jnp.log(jnp.diag(wide)) - jnp.log(jnp.diag(root)))
    z_thermal = (logs - machine.centre) / machine.scale
    others = np.setdiff1d(np.arange(machine.mode.size), places)
    z_others = machine.mode[others] + machine.slope @ (z_thermal - machine.mode[places])
    z_others = z_others + machine.factor @ other
    vector = jnp.zeros(machine.mode.size).at[places].set(z_thermal).at[others].set(z_others)
    num = structure.num_parameters
    likelihood = log_likelihood(structure, machine.data, vector[:num], from_scores(vector[num:]))
    usual = jnp.log1p(-law.outlier_share) + _log_normal(logs - centre, law.factor)
    else_ = jnp.log(law.outlier_share) + _log_normal(logs - centre, OUTLIER_SCALE * law.factor)
    prior = jnp.logaddexp(usual, else_) - 0.5 * jnp.sum(z_others**2)
    return likelihood + prior + log_jacobian


def _log_normal(apart: Any, factor: Any) -> Any:
    white = solve_lower(factor, apart)
    return jnp.sum(norm.logpdf(white)) - jnp.sum(jnp.log(jnp.diag(factor)))


def _sample(
    two: Population, structure: Any, machines: Machines, places: np.ndarray,
    options: argparse.Namespace,
) -> tuple[Law, dict[str, float]]:  # fmt: skip
    scores = _scores(two)
    root = np.linalg.cholesky(np.cov(scores.T) + 1e-9 * np.eye(scores.shape[1]))
    hypers = jnp.asarray(scores.mean(axis=0)), jnp.asarray(root)
    num, size = machines.centre.shape
    start = {
        "law": jnp.zeros(scores.shape[1]),
        "thermal": jnp.zeros((num, size)),
        "others": jnp.zeros((num, machines.factor.shape[1])),
    }
    potential = jax.jit(lambda at: -_log_density(two, structure, places, machines, hypers, at))
    slope = jax.jit(jax.grad(potential))
    jax.block_until_ready(slope(start))
    begin = time.monotonic()
    for _ in range(5):
        jax.block_until_ready(slope(start))
    print(f"gradient: {(time.monotonic() - begin) / 5:.4f} s", flush=True)
    sampler = MCMC(
        NUTS(potential_fn=potential, max_tree_depth=7, target_accept_prob=0.8),
        num_warmup=options.warmup, num_samples=options.draws, num_chains=options.chains,
        chain_method="sequential", progress_bar=False,
    )  # fmt: skip
    if options.chains > 1:
        start = jax.tree.map(lambda leaf: jnp.stack([leaf] * options.chains), start)
    sampler.run(jax.random.PRNGKey(options.seed), init_params=start,
                extra_fields=("num_steps", "diverging"))  # fmt: skip
    drawn = np.asarray(sampler.get_samples(group_by_chain=True)["law"])
    extra = sampler.get_extra_fields()
    diagnostics = {
        "least_effective": float(np.min(effective_sample_size(drawn))),
        "worst_r_hat": float(np.max(split_gelman_rubin(drawn))),
        "diverging": int(np.sum(extra["diverging"])),
        "mean_steps": float(np.mean(extra["num_steps"])),
        "draws": int(drawn.shape[0] * drawn.shape[1]),
        "dimensions": int(sum(leaf.size for leaf in jax.tree.leaves(start)) / options.chains),
    }
    flat = drawn.reshape(-1, drawn.shape[-1]) @ root.T + scores.mean(axis=0)
    laws, _ = jax.vmap(lambda z: unpack(z, two.hyper, two.design.shape[1]))(jnp.asarray(flat))
    return laws, diagnostics


def _scores(two: Population) -> np.ndarray:
    """Return draws of the two stages as scores, which `unpack` turns into laws."""
    laws, hyper = jax.tree.map(np.asarray, two.laws), two.hyper
    num, size = laws.mean.shape
    rows = np.zeros((num, num_scores(size, two.design.shape[1])))
    partial_places = [(row, column) for row in range(size) for column in range(row)]
    sd = np.sqrt(np.sum(laws.factor**2, axis=-1))
    unit = laws.factor / sd[..., None]
    left = np.ones((num, size))
    partials = []
    for row, column in partial_places:
        r = unit[:, row, column] / np.sqrt(left[:, row])
        left[:, row] *= 1.0 - r**2
        partials.append(np.arctanh(r))
    share = laws.outlier_share
    usual = np.log(OUTLIER_SHARE / (1.0 - OUTLIER_SHARE))
    parts = [
        (laws.mean - hyper.mean) / hyper.mean_sd,
        (laws.effects / hyper.effect_sd).reshape(num, -1),
        np.log(sd / hyper.spread),
        np.stack(partials, axis=1),
        (np.log(share / (1.0 - share)) - usual)[:, None] / OUTLIER_SD,
    ]
    rows[:] = np.concatenate(parts, axis=1)
    return rows


def _compared(two: Population, one: Law) -> list[dict[str, Any]]:
    rows = []
    for place, name in enumerate(two.evidence.names):
        for kind, of in (
            ("median", lambda law, place=place: np.exp(np.asarray(law.mean)[:, place])),
            ("spread", lambda law, place=place: np.expm1(np.asarray(law.sd)[:, place])),
            ("supplier", lambda law, place=place: np.asarray(law.effects)[:, 0, place]),
        ):
            (low, at, high), (low_1, at_1, high_1) = (
                np.quantile(of(law), [0.025, 0.5, 0.975]) for law in (two.laws, one)
            )
            rows.append(
                {"kind": kind, "parameter": name, "two": [low, at, high],
                 "one": [low_1, at_1, high_1]}
            )  # fmt: skip
    return rows


def _lines(content: dict[str, Any], fleet: Fleet) -> list[str]:
    said = content["diagnostics"]
    minutes = fleet.minutes
    lines = [
        f"`python tests/studies/{content['command']}`: {content['machines']} machines "
        f"({int(np.sum(minutes == SHORT_MIN))} with 30 minutes), {content['minutes']:.0f} min, "
        f"NUTS in {said['dimensions']} dimensions from the readings' own likelihood: "
        f"{said['draws']} draws, {said['mean_steps']:.0f} steps each, least effective sample size "
        f"{said['least_effective']:.0f}, worst R-hat {said['worst_r_hat']:.3f}, "
        f"{said['diverging']} divergent.",
        "",
        "| | two stages (95 %) | one stage (95 %) | apart | over the sd | width, two over one |",
        "|---|---|---|---|---|---|",
    ]
    for row in content["compared"]:
        (low, at, high), (low_1, at_1, high_1) = row["two"], row["one"]
        sd = (high_1 - low_1) / 3.92
        apart = f"{100 * (at / at_1 - 1):+.1f} %" if row["kind"] != "supplier" else "–"
        lines.append(
            f"| {row['kind']} of {row['parameter']} | {at:.4g} ({low:.4g} … {high:.4g}) | "
            f"{at_1:.4g} ({low_1:.4g} … {high_1:.4g}) | {apart} | {(at - at_1) / sd:+.2f} | "
            f"{(high - low) / (high_1 - low_1):.2f} |"
        )
    return lines


if __name__ == "__main__":
    main()
