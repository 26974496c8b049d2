"""Gradient least squares on whitened residuals, from many starts, with the noise estimated.

The fit goes round in three steps: least squares with white residuals from many starts finds the
basin; noise and unmodelled heat are estimated on the residuals with the parameters integrated out
(restricted maximum likelihood, with the priors as they are); least squares on residuals whitened by
both gives the parameters and their covariance.

Readings that are exactly on time are a corner of the likelihood. What is read late lies on straight
lines between the edges of the steps, so its slope by the delay jumps where the delay passes an
edge. The most probable delay of some tests is that corner itself, where no slope is zero and no
search ends: the delay is held there, and the search finished for all other parameters. The limit of
a share is such a corner too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float
from scipy.special import chdtrc, chdtri

from ..errors import InputError
from ..io.programs import compiled, refuse_wrong_sums
from ..model.discrepancy import no_heat, with_heat
from ..model.kernels import at_once
from ..model.noise import Noise, from_scores, noise_parameters
from ..model.parameters import Form
from ..model.problem import NUM_NOISE, Data, Problem, Structure, whitened
from ..record.record import Finding
from .fit_result import RESULT, Fit, failed
from .restricted import (
    estimate_loggers,
    estimate_noise,
    polished_noise,
    restricted_log_likelihood,
    spread,
    whiten_fit,
)

DELAY = "load_timing"

NEAR = 0.01
"""A delay nearer to none than this may belong there [prior standard deviations]."""

SIDE = 1e-6
"""How far from the corner its two sides are looked at [prior standard deviations]."""


def delays(form: Form) -> list[int]:
    """Return the places of the delays among the scores, whose zero is a reading on time."""
    return [place for place, (name, _, _) in enumerate(form) if name == DELAY]


def near_corner(form: Form, z: Float[np.ndarray, "parameter *machine"]) -> Bool[np.ndarray, "..."]:
    """Return which scores are delays of next to nothing, in the shape of `z`."""
    near = np.zeros(z.shape, dtype=bool)
    near[delays(form)] = np.abs(z[delays(form)]) < NEAR
    return near


def is_corner(
    before: Float[np.ndarray, "parameter *machine"],
    after: Float[np.ndarray, "parameter *machine"],
    held: Bool[np.ndarray, "parameter *machine"],
) -> Bool[np.ndarray, "*machine"]:
    """Return where the held delays are most probable at the corner.

    Args:
        before: Slope of half the sum of squares by the scores, on the side of negative delays.
        after: The same on the other side.
        held: Delays at the corner.
    """
    return np.all(~held | ((before <= 0.0) & (after >= 0.0)), axis=0)


WINDOWS_S = (300.0, 600.0, 1200.0)
"""Windows over which whitened residuals are averaged [s]: ten minutes, halved and doubled; at most
a third of the test, so that a test of minutes is looked at too."""

FLAG = 2.2
"""Excess from which on a model counts as inadequate: it flagged 8 of 8 unknown causes and 2 of 32
known ones on simulated motors."""


def low_frequency_excess(
    innovations: Sequence[np.ndarray], block_s: Sequence[float]
) -> tuple[float, bool]:
    """Return the mean squared normalised window mean of whitened residuals, and if it is flagged.

    The sum of n white residuals has variance n; a slow misfit makes it grow with n^2. Of the
    windows, the one with the largest excess counts.

    Args:
        innovations: Whitened residuals of each test, observed blocks only [1].
        block_s: Length of a block of each test [s].

    Returns:
        The excess [1], 1 if white, and whether it is above both `FLAG` and the 99.9 % quantile
        that white residuals would have in as many windows.
    """
    worst, is_flagged = 0.0, False
    for window_s in WINDOWS_S:
        squares = []
        for values, length in zip(innovations, block_s, strict=True):
            size = max(2, min(round(window_s / length), values.size // 3))
            num = values.size // size
            if num >= 3:
                sums = values[: num * size].reshape(num, size).sum(axis=1)
                squares.append(sums**2 / size)
        if not squares:
            continue
        joined = np.concatenate(squares)
        excess = float(np.mean(joined))
        limit = max(FLAG, float(chdtri(joined.size, 0.001)) / joined.size)
        worst = max(worst, excess)
        is_flagged = is_flagged or excess > limit
    return worst, is_flagged


def ljung_box(innovations: np.ndarray, num_lags: int = 10) -> float:
    """Return the p-value that whitened residuals of one test are white [1].

    Reference: G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models,
        Biometrika 65 (1978) 297-303.
    """
    num = innovations.size
    num_lags = min(num_lags, max(1, num // 5))
    centred = innovations - innovations.mean()
    power = float(np.sum(centred**2))
    if num < 8 or power == 0.0:
        return 1.0
    lags = np.arange(1, num_lags + 1)
    correlation = np.array([np.sum(centred[lag:] * centred[:-lag]) / power for lag in lags])
    statistic = num * (num + 2) * np.sum(correlation**2 / (num - lags))
    return float(chdtrc(num_lags, statistic))


LONGEST_NOISE_S = 150.0
"""Residuals correlated over more than this are a misfit, not noise [s]."""

MUCH_HEAT = 2.0
"""Prior standard deviations from which on the unmodelled heat is a finding [1]."""


def misfit_findings(
    problem: Problem, noise_z: np.ndarray, rmse: float, excess: float, is_flagged: bool
) -> list[Finding]:
    """Return what the noise and the unmodelled heat say of the network.

    Args:
        problem: Model and tests.
        noise_z: Scores of the noise.
        rmse: Of the residuals [K].
        excess: Low-frequency excess of the innovations [1].
        is_flagged: Whether that is above its limit.
    """
    noise = from_scores(noise_z)
    of_heat = noise_parameters(problem.model.adequacy)[-1]
    heat, usual = float(of_heat.value(noise_z[3])), of_heat.prior_interval_95()[1]
    reasons = []
    if noise_z[3] > MUCH_HEAT:
        reasons.append(
            f"it leaves heat of {100.0 * heat:.2g} % of the loss unexplained (up to "
            f"{100.0 * usual:.2g} % is usual)"
        )
    if float(noise.time) > LONGEST_NOISE_S:
        reasons.append(f"its residuals are correlated over more than {LONGEST_NOISE_S:.0f} s")
    if is_flagged:
        reasons.append(f"its slow residuals have {excess:.1f} times the variance of noise")
    if not reasons:
        return []
    return [
        Finding(
            id="misfit",
            severity="warning",
            message=f"the {problem.model.words} is incomplete: {'; '.join(reasons)}. The 95 % "
            "intervals allow for slow heat of this size, not for every cause.",
            where=problem.label,
            remedy="Search for the missing effect with `heatrun discover`.",
            values={
                "rmse_K": rmse,  # of the most probable parameters; that of the run is its median's
                "low_frequency_excess": excess,
                "unmodelled_heat": heat,
                "noise_time_s": float(noise.time),
            },
        )
    ]


def several_optima(problem: Problem, num_modes: int) -> Finding:
    """Return the finding that `num_modes` parameter sets fit about equally well."""
    return Finding(
        id="several_optima",
        severity="warning",
        message=f"the posterior of the {problem.model.words} is "
        f"{'bimodal' if num_modes == 2 else 'multimodal'}: {num_modes} parameter sets fit the "
        "tests about equally well. The 95 % intervals cover all modes.",
        where=problem.label,
        remedy="Add a test in which current and speed change independently, or fix a parameter in "
        "the motor file.",
        values={"num_modes": num_modes},
    )


def not_converged(problem: Problem) -> Finding:
    """Return the finding that the alternation of noise and least squares has not ended."""
    message, _, remedy = RESULT.not_converged.value.partition(". ")
    return Finding(
        id="not_converged",
        severity="warning",
        message=f"{problem.model.title}: {message}.",
        where=problem.label,
        remedy=remedy,
    )


NUM_STARTS, NUM_FIRST = 16, 4
"""Starts of the search: the centre of the prior and draws from it. The first of them tell how much
the network leaves."""

SPREAD = 0.7
"""Spread of the starts in prior standard deviations: a factor of 8 to either side in C and R."""

SAME_OPTIMUM = 0.5
"""Half the sum of squares within which two starts are at the same optimum [nat]."""

MAX_STEPS = 120
"""Steps of one search; a sound one takes ten to thirty."""

TOLERANCE = 1e-5
"""Of a search, relative and in prior standard deviations; a narrow posterior has 5e-3 of these, and
a last step by the slope alone goes farther."""

ROUGHLY = 1e-2
"""The same of the first search, which tells the basins: half of its steps would go into digits that
the noise changes. Within 0.01 nat of the optimum on ordinary motors."""

HOPELESS = 1e10
"""Half the sum of squares from which on a start counts as failed [nat]."""

NUM_ROUNDS = 6
"""Most rounds of noise and least squares; clean records need two."""

ROUGH_K = 1.0
"""White level of the first search [K]. Block means of a misfit are not independent; taken as such
they would outweigh every prior and drive the start temperatures to the impossible."""

RIVAL = 8.0
"""Optima within this of the best (half the sum of squares) may share the posterior [nat]."""

VISIBLE = 0.01
"""Share of the posterior from which on an optimum is one of several [1]."""

DISTINCT = 0.5
"""Optima that differ by more than this in some score are two [prior standard deviations]."""

FINISH = 1e-3
"""Longest step with which a search is finished [prior standard deviations]."""

MOST_AT_CORNER, AT_CORNER = 20, 1e-9
"""Most steps that finish a search with a delay held at the corner, and the length of the last one
[prior standard deviations]."""

SETTLED = 0.02
"""Change of all scores at which the alternation ends [prior standard deviations]."""


def fit(
    problem: Problem, *, num_starts: int = NUM_STARTS, seed: int = 0, throw: bool = True
) -> Fit:
    """Fit a model to tests.

    Args:
        problem: Model and tests.
        num_starts: Starts of the search.
        seed: Of the draws of the starts.
        throw: Raise on failure instead of returning it as a value.

    Raises:
        InputError: If no start leads anywhere, with `throw`; if compiled sums are wrong here.
    """
    refuse_wrong_sums()
    problem = replace(problem, heat=no_heat(problem))
    starts = start_scores(problem, num_starts, seed)
    found = _search(problem, _white(ROUGH_K), starts[:NUM_FIRST], ROUGHLY)
    level, first = ROUGH_K, found[0][int(np.argmin(found[1]))]
    if np.any(np.isfinite(found[1])):
        implied = implied_level(problem, problem.linearised(first)[0])
        level = 1.5 * implied if implied >= ROUGH_K else ROUGH_K
    if level > ROUGH_K:
        found = _search(problem, _white(level), starts, ROUGHLY)
    elif num_starts > NUM_FIRST:
        others = _search(problem, _white(level), starts[NUM_FIRST:], ROUGHLY)
        found = tuple(np.concatenate(parts) for parts in zip(found, others, strict=True))
    z, cost, steps = found
    if not np.any(np.isfinite(cost)):
        if throw:
            raise InputError(RESULT.no_start.value, where=problem.label)
        return failed(problem)
    best = int(np.argmin(cost))
    is_same = cost - cost[best] < SAME_OPTIMUM * max(1.0, 1e-3 * cost[best])
    (nearest,), _, more = _search(problem, _white(level), z[best][None])
    rmse_white = problem.rmse_K(problem.linearised(nearest)[0])

    problem, state = _settle(problem, nearest)
    problem, state, modes = _explore(problem, state, z)
    return finished(
        problem, state.z, state.noise_z, state.residual, state.jacobian, modes,
        is_converged=state.is_converged,
        stats={
            "num_starts": num_starts,
            "num_at_best": int(np.sum(is_same)),
            "num_steps": int(steps[best] + more[0]),
            "rmse_white_K": rmse_white,
        },
    )  # fmt: skip


def finished(
    problem: Problem,
    z: Float[np.ndarray, " parameter"],
    noise_z: Float[np.ndarray, " noise"],
    residual: Float[np.ndarray, " block"],
    jacobian: Float[np.ndarray, "block parameter"],
    modes: Float[np.ndarray, "mode parameter"],
    *,
    is_converged: bool,
    stats: Mapping[str, float],
) -> Fit:
    """Return a fit with its spread and what is to be said of it.

    Args:
        problem: Model and tests, with unmodelled heat.
        z: Scores of the parameters at the optimum.
        noise_z: Scores of the noise.
        residual: Of all tests in a row [K].
        jacobian: Its derivative [K per score].
        modes: As `Fit.modes`.
        is_converged: Whether noise and parameters have settled.
        stats: As `Fit.stats`.
    """
    white = whiten_fit(problem, noise_z, residual, jacobian)
    width = spread(problem, z, noise_z, residual, jacobian, white)
    excess, is_flagged = low_frequency_excess(white.residuals, _lengths(problem))
    rmse = problem.rmse_K(residual)
    findings = misfit_findings(problem, noise_z, rmse, excess, is_flagged)
    if not is_converged:
        findings.append(not_converged(problem))
    if len(modes) > 1:
        findings.append(several_optima(problem, len(modes)))
    return Fit(
        problem=problem,
        z=z,
        noise_z=noise_z,
        covariance=width.covariance,
        covariance_type_a=width.type_a,
        residual=problem.split(residual),
        jacobian=problem.split(jacobian),
        log_evidence=width.log_evidence,
        result=RESULT.converged if is_converged else RESULT.not_converged,
        modes=modes,
        findings=tuple(findings),
        stats={**stats, "low_frequency_excess": excess},
    )


@dataclass(frozen=True)
class _State:
    """Where the alternation of noise and least squares ended."""

    z: np.ndarray
    noise_z: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    is_converged: bool


def _white(level: float) -> Noise:
    """Return white noise of a level [K]."""
    # with a dtype: a plain Python number is another type to the compiler, which would then
    # compile the search once for this noise and once for an estimated one
    return Noise(*(np.asarray(number, dtype=float) for number in (0.0, 1.0, level, 0.0)))


def implied_level(problem: Problem, residual: np.ndarray) -> float:
    """Return the white level [K] at which slow residuals weigh what they are worth.

    Args:
        problem: Model and tests.
        residual: Residuals of all tests in a row [K].
    """
    rmse = problem.rmse_K(residual)
    parts = [
        part[seen] / rmse
        for rows, test in zip(problem.split(residual), problem.tests, strict=True)
        for part, seen in zip(test.by_sensor(rows), test.by_sensor(test.is_observed), strict=True)
    ]
    return rmse * float(np.sqrt(max(low_frequency_excess(parts, _lengths(problem))[0], 1.0)))


def _lengths(problem: Problem) -> list[float]:
    """Return the length of a block of each sensor of each test [s]."""
    return [test.block_s for test in problem.tests for _ in test.loggers]


def start_scores(problem: Problem, num_starts: int, seed: int) -> np.ndarray:
    """Return starts in scores: only the network and the resistance are spread."""
    rng = np.random.default_rng(seed)
    starts = np.zeros((num_starts, problem.num_parameters))
    for position, slot in enumerate(problem.parameters.slots):
        if slot.parameter.role in ("network", "resistance"):
            starts[1:, position] = SPREAD * rng.standard_normal(num_starts - 1)
    return starts


def _search(
    problem: Problem, noise: Noise, starts: np.ndarray, tolerance: float = TOLERANCE
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return optima, half sums of squares and numbers of steps from each start.

    Each start for itself, on all cores: in one batch, all would wait for the slowest, and every
    batch of another size would be compiled anew. A score that ends beyond its limit, such as a
    share above one, is held there, and the others are searched again.
    """
    largest = problem.data.priors.largest
    has_limits = bool(np.any(np.isfinite(largest)))

    def one(start: np.ndarray) -> tuple[np.ndarray, ...]:
        held, total = (np.zeros(largest.size, dtype=bool) if has_limits else None), 0
        while True:
            z, cost, steps = map(
                np.asarray,
                _solve(problem.structure, problem.data, start, noise, np.asarray(tolerance), held),
            )
            total += steps
            if held is None or not np.any(z > largest):
                return z, cost, total
            held, start = held | (z > largest), np.minimum(z, largest)

    found = at_once(one, starts)
    z, cost, steps = (np.stack(parts) for parts in zip(*found, strict=True))
    return z, np.where(cost < HOPELESS, cost, np.inf), steps


@compiled("structure")
def _solve(
    structure: Structure,
    data: Data,
    start: Float[Array, " all"],
    noise: Noise,
    tolerance: Float[Array, ""],
    held: Bool[Array, " all"] | None,
):
    """Return optimum, half its sum of squares, and number of steps; held scores are at limits."""

    def rows(z: Float[Array, " all"], args: tuple[Data, Noise]) -> Float[Array, " residual"]:
        if held is None:
            return whitened(structure, args[0], z, args[1])
        at = jnp.where(held, args[0].priors.largest, z)
        return jnp.concatenate([whitened(structure, args[0], at, args[1]), z - at])

    solution = optx.least_squares(
        rows,
        optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance),  # pyright: ignore[reportArgumentType]
        start,
        args=(data, noise),
        options={"jac": "fwd"},
        max_steps=MAX_STEPS,
        throw=False,
    )
    z = solution.value if held is None else jnp.where(held, data.priors.largest, solution.value)
    return z, solution.state.f_info.as_min(), solution.stats["num_steps"]


def _settle(problem: Problem, z: np.ndarray) -> tuple[Problem, _State]:
    """Alternate noise and least squares until the scores no longer move.

    The responses to unmodelled heat are taken anew at each round's network.
    """
    residual, jacobian = problem.linearised(z)
    noise_z, shift = np.zeros(NUM_NOISE), np.inf
    for _ in range(NUM_ROUNDS):
        problem = with_heat(problem, z)
        problem = replace(problem, loggers=estimate_loggers(problem, z, residual, jacobian))
        noise_z = estimate_noise(problem, z, residual, jacobian)
        noise_z = polished_noise(problem, noise_z, z, residual, jacobian)
        after, _, _ = _search(problem, from_scores(noise_z), z[None])
        ahead = _polished(problem, after[0], noise_z)
        shift = float(np.max(np.abs(ahead - z)))
        z = ahead
        residual, jacobian = problem.linearised(z)
        if shift < SETTLED:
            break
    return problem, _State(z, noise_z, residual, jacobian, shift < 10 * SETTLED)


def _polished(problem: Problem, z: np.ndarray, noise_z: np.ndarray) -> np.ndarray:
    """Return the scores after one more step, which looks at the slope alone.

    A search compares sums of squares, whose last digits hide what is nearer than a millionth of a
    prior standard deviation. Where the step is longer than that finish, the search has not ended,
    and nothing says that the straight step leads down: the scores stay.
    """
    step = _newton(problem, z, noise_z)[0]
    if np.max(np.abs(step)) < FINISH:
        return np.minimum(z - step, problem.data.priors.largest)
    held = near_corner(problem.structure.form, z)
    return _at_corner(problem, z, noise_z, held) if np.any(held) else z


def _newton(
    problem: Problem, z: np.ndarray, noise_z: np.ndarray, held: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return a step to where the slope is zero, and the slope.

    Held scores stay, and those at their limits that the slope leads beyond.
    """
    residual, jacobian = problem.linearised(z)
    white = whiten_fit(problem, noise_z, residual, jacobian)
    columns = white.jacobian
    slope = columns.T @ white.stacked + z
    stays = (z >= problem.data.priors.largest) & (slope < 0.0)
    stays = stays if held is None else stays | held
    curvature = columns.T @ columns + np.eye(z.size)
    curvature = np.where(stays[:, None] | stays, np.eye(z.size), curvature)
    slope_left = np.where(stays, 0.0, slope)
    return np.linalg.solve(curvature, slope_left), slope


def _at_corner(
    problem: Problem, z: np.ndarray, noise_z: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """Return the scores with the held delays at zero, if they are most probable there."""
    at = np.where(held, 0.0, z)
    for _ in range(MOST_AT_CORNER):
        step = _newton(problem, at, noise_z, held)[0]
        at = at - step
        if np.max(np.abs(step)) < AT_CORNER:
            break
    else:
        return z
    before, after = (_newton(problem, at + side * held, noise_z)[1] for side in (-SIDE, SIDE))
    return at if is_corner(before, after, held) else z


def _explore(
    problem: Problem, state: _State, optima: np.ndarray
) -> tuple[Problem, _State, np.ndarray]:
    """Search again from the optima under the final noise; return what is best and all optima.

    Those that hold a visible share of the posterior must be sampled too.
    """
    starts = distinct([state.z, *optima[np.all(np.isfinite(optima), axis=1)]])
    z, cost, _ = _search(problem, from_scores(state.noise_z), np.stack(starts))
    best = int(np.argmin(cost))
    if cost[best] < cost[0] - SAME_OPTIMUM:
        problem, state = _settle(problem, z[best])
    rivals = [z[index] for index in np.argsort(cost) if cost[index] < cost[best] + RIVAL]
    return problem, state, sharing(problem, state.noise_z, distinct([state.z, *rivals]))


def sharing(
    problem: Problem, noise_z: np.ndarray, optima: list[np.ndarray]
) -> Float[np.ndarray, "mode parameter"]:
    """Return the first optimum, and those that hold a visible share of the posterior beside it, by
    the linear model around each.

    Where a search ran out of steps on a slope, nothing is to be sampled around: from there the
    linear model leads away.
    """
    others = [z for z in optima[1:] if _gain(problem, z, noise_z) < SAME_OPTIMUM]
    optima = [optima[0], *others]
    if others:
        mass = np.array(
            [
                float(_log_mass(problem.readings, noise_z, z, *map(problem.lengthened, found)))
                for z in optima
                for found in (problem.linearised(z),)
            ]
        )
        is_kept = mass > np.logaddexp.reduce(mass) + np.log(VISIBLE)
        optima = optima[:1] + [z for z, kept in zip(others, is_kept[1:], strict=True) if kept]
    return np.stack(optima)


def _gain(problem: Problem, z: np.ndarray, noise_z: np.ndarray) -> float:
    """Return what the best step by the linear model gains [nat]."""
    step, slope = _newton(problem, z, noise_z)
    return 0.5 * float(slope @ step)


_log_mass = compiled()(restricted_log_likelihood)


def distinct(optima: list[np.ndarray]) -> list[np.ndarray]:
    """Return the optima without those that an earlier one stands for."""
    kept: list[np.ndarray] = []
    for z in optima:
        if all(np.max(np.abs(z - other)) > DISTINCT for other in kept):
            kept.append(z)
    return kept
