"""Predictions with bands, what the parameters leave open and the noise adds, and their scores."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from ..io.programs import compiled
from ..model import noise as noise_module
from ..model.bodies import BodyCourse, body_courses, own_errors, own_name, told_bodies
from ..model.discrepancy import heat_columns
from ..model.draws import ABSURD, AT_A_TIME, Draws, PlausibleEffects, courses, of_network
from ..model.model import Model
from ..model.model_parameters import parameters
from ..model.noise import Noise, scales_of
from ..model.parameters import Parameter, null_values
from ..record.balance_errors import together
from ..record.blocks import Blocks
from ..record.observation import Observation
from ..results.values import Role
from .driven import refuse_unstable, start_draws

if TYPE_CHECKING:
    from .posterior import Posterior

FEWEST = 10
"""Blocks below which a standard error cannot be estimated."""

DECIDED = 2.0
"""Standard errors that a difference of scores must be from zero to decide [1]: 95 %."""


@dataclass(frozen=True)
class ScoreDifference:
    """Mean log score per block of one network less that of another, over the held-out tests."""

    difference: float  # Network with more nodes minus the other, mean over the tests [nat].
    standard_error: float  # Of it, from the differences block by block [nat].

    @property
    def is_decided(self) -> bool:
        """Whether it is more than two standard errors from zero."""
        return abs(self.difference) > DECIDED * self.standard_error


def block_scores(prediction: Prediction) -> Float[np.ndarray, " observed"]:
    """Return the log density of each measured block mean under its predicted normal [nat]."""
    seen = prediction.test.is_observed
    return _log_normal(prediction.residual[seen], prediction.sd[seen])


def _log_normal(residual: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Return the log density of residuals under normals of mean zero [nat]."""
    return -0.5 * (residual / sd) ** 2 - np.log(sd * math.sqrt(2.0 * math.pi))


def standard_error(series: Float[np.ndarray, " observed"]) -> float | None:
    """Return the standard error of the mean of a correlated series, None for less than ten values.

    The scores of a test's blocks are no independent draws: an error that lasts ten minutes spoils
    all blocks within. The standard error of their mean is that of an autocorrelated series: it is
    freed of an autoregression of first order, the rest is summed with the weights of Bartlett, and
    the autoregression is put back (prewhitening).

    Returns:
        In the unit of the series. What stays alike over the whole series has its standard
        deviation as standard error, at most.

    Reference: D. W. K. Andrews, J. C. Monahan, An improved heteroskedasticity and autocorrelation
        consistent covariance matrix estimator, Econometrica 60 (1992) 953; W. K. Newey, K. D. West,
        Econometrica 55 (1987) 703; M. G. Kendall, Biometrika 41 (1954) 403 (bias of the
        autocorrelation).
    """
    num = series.size
    if num < FEWEST or not np.all(np.isfinite(series)):
        return None
    x = series - series.mean()
    square = float(x @ x)
    if square == 0.0:
        return 0.0
    phi = float(x[1:] @ x[:-1]) / square
    phi = min(phi + (1.0 + 3.0 * phi) / num, 1.0 - 2.0 / num)
    fresh = x[1:] - phi * x[:-1]
    lags = math.floor(4.0 * (num / 100.0) ** (2.0 / 9.0))
    # Bartlett's weights keep the sum positive
    variance = float(fresh @ fresh) / fresh.size
    for lag in range(1, lags + 1):
        share = 1.0 - lag / (lags + 1.0)
        variance += 2.0 * share * float(fresh[lag:] @ fresh[:-lag]) / fresh.size
    return math.sqrt(max(variance, 0.0) / num) / (1.0 - phi)


def score_difference(
    small: Sequence[Prediction], large: Sequence[Prediction], roles: Sequence[Role]
) -> ScoreDifference | None:
    """Return the difference of two networks' scores; None without a held-out test of ten blocks.

    Args:
        small: Predictions of the network with fewer nodes, one per test.
        large: Those of the other one, in the same order.
        roles: `"calibration"` or `"holdout"`, one per test.
    """
    means, errors = [], []
    for one, two, role in zip(small, large, roles, strict=True):
        if role != "holdout" or not (one.is_there and two.is_there):
            continue
        series = block_scores(two) - block_scores(one)
        error = standard_error(series)
        if error is None:
            return None
        means.append(float(series.mean()))
        errors.append(error)
    if not means:
        return None
    return ScoreDifference(float(np.mean(means)), float(np.linalg.norm(errors)) / len(errors))


NUM_DRAWS = 400
"""Draws behind a band: its 95 % limits are then good to about a tenth of a standard deviation."""

LEVELS = {"50": (0.25, 0.75), "95": (0.025, 0.975)}


@dataclass(frozen=True)
class Prediction:
    """What a posterior says of one test, block by block."""

    model: Model  # Network with effects.
    test: Blocks  # The test.
    # Whether the posterior has not seen it; its start is then taken from its first readings.
    is_held_out: bool
    # Reading at the median of the draws [degC], shape (block,).
    median: Float[np.ndarray, " block"]
    # Limits by level ("50", "95") from the parameters alone [degC].
    parameters: Mapping[str, tuple[np.ndarray, np.ndarray]]
    # Limits by level with the noise of a block mean [degC].
    total: Mapping[str, tuple[np.ndarray, np.ndarray]]
    sd: Float[np.ndarray, " block"]  # Standard deviation with noise [K], shape (block,).
    # Median of the mean temperature of each node over each block [degC].
    nodes: Mapping[str, np.ndarray]
    nodes_95: Mapping[str, tuple[np.ndarray, np.ndarray]]  # Its 95 % limits [degC].
    flows: Mapping[tuple[str, str], np.ndarray]  # Median heat flow by link over each block [W].
    flows_95: Mapping[tuple[str, str], tuple[np.ndarray, np.ndarray]]  # Its 95 % limits [W].
    # The readings themselves, without noise [degC], shape (draw, block).
    draws: Float[np.ndarray, "draw block"]
    # The parameters behind them by name [their units], shape (draw,).
    values: Mapping[str, np.ndarray]
    # Their stated values, of the network without what it may miss [their units].
    middle: Mapping[str, float]
    noise: Noise  # The noise of the winding's readings for each draw.
    # What unmodelled heat does to the winding's readings, as `Observation.heat`.
    heat: Float[np.ndarray, "block column"]
    bodies: tuple[BodyCourse, ...] = ()  # Measured bodies of the test, against the model.

    @property
    def is_there(self) -> bool:
        """Whether the test could be predicted at all; else all of it is NaN, or no number that a
        machine could have.
        """
        return bool(np.all(np.abs(self.median) < ABSURD))

    @property
    def residual(self) -> np.ndarray:
        """Measured minus median [K], shape (block,); NaN where nothing was read."""
        return self.test.measured - self.median

    @property
    def time_s(self) -> np.ndarray:
        """Mean time of each block on the record's own axis [s], shape (block,)."""
        return self.test.time + self.test.first_s

    @property
    def rmse_K(self) -> float:
        """Root mean square of the residuals [K]; NaN where nothing was read."""
        error = self.residual[self.test.is_observed]
        return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")

    @property
    def largest_K(self) -> float:
        """Largest residual by magnitude [K], with its sign; NaN where nothing was read."""
        error = self.residual[self.test.is_observed]
        return float(error[np.argmax(np.abs(error))]) if error.size else float("nan")

    def coverage_95(self) -> float:
        """Return the share of block means inside the 95 % band with noise [1]."""
        low, high = self.total["95"]
        seen = self.test.is_observed
        inside = (self.test.measured >= low) & (self.test.measured <= high)
        return float(np.mean(inside[seen]))

    def innovations(self) -> Float[np.ndarray, " observed"]:
        """Return the residuals freed of what makes neighbours alike [1]: white if all is right.

        That is the slow part of the noise; in a held-out test also what the draws of the
        parameters leave open, which shifts many blocks at once.
        """
        seen = self.test.is_observed
        if not np.any(seen):
            return np.zeros(0)
        spread = (self.draws - self.median).T / np.sqrt(self.draws.shape[0])
        joined = np.nan_to_num(np.column_stack([self.residual, spread]))
        noise = jax.tree.map(lambda draws: np.median(np.asarray(draws)), self.noise)
        padded = self.test.observation(self.heat).padded(is_seldom=True)
        white, _ = noise_module.whiten(self.test.lengthened(joined, is_seldom=True), noise, padded)
        rows = self.test.own(white)[seen]
        error, spread = rows[:, 0], rows[:, 1:]
        if not self.is_held_out:
            return error
        # the covariance is now 1 + spread spread'; its inverse root frees the errors of it
        squares, axes = np.linalg.eigh(spread.T @ spread)
        turned, squares = spread @ axes, np.maximum(squares, np.finfo(float).tiny)
        freed = -np.expm1(-0.5 * np.log1p(squares)) / squares  # of each direction, over its square
        return error - turned @ (freed * (turned.T @ error))

    def log_score(self) -> float:
        """Return the mean log density of a block mean under its predicted normal [nat]."""
        seen = self.test.is_observed
        return float(np.mean(_log_normal(self.residual[seen], self.sd[seen])))


def predict(
    source: Posterior | Draws,
    test: Blocks,
    *,
    fitted_as: str | None = None,
    num_draws: int = NUM_DRAWS,
    seed: int = 0,
) -> Prediction:
    """Predict a test, one that was fitted or any other.

    Args:
        source: A posterior, or draws read back from a run.
        test: A reduced record; its first readings are used for the start of a test that was not
            fitted, all others for nothing.
        fitted_as: Name of the fitted test that this one is; a posterior knows its own tests.
        num_draws: Number of draws.
        seed: Of the noise and of the start.
    """
    if not isinstance(source, Draws):
        owned = [each.name for each in source.fit.problem.tests if each.winding is test]
        fitted_as = owned[0] if owned else fitted_as
        source = source.draws
    drawn = of_test(source, test, fitted_as=fitted_as, num_draws=num_draws, seed=seed)
    middle = drawn.middle()
    known = told_bodies(middle, test)
    rows = test.with_bodies(known)
    heat = heat_columns(source.model, middle, rows)
    observation = rows.observation(heat, scales_of(source.loggers, rows)).padded(is_seldom=True)
    course = courses(source.model, drawn.values, rows)
    refuse_unstable(source.model, drawn.values, course.reading[:, : test.measured.size], test)
    if drawn.plausible is not None:
        course = drawn.plausible.with_effects(course, source.model, source.motor, rows, fitted_as)
    readings, *of_bodies = np.split(course.reading, 1 + len(known), axis=1)
    errors, *of_sensors = np.split(
        rows.own(_errors(drawn.noise, np.int64(seed), observation), axis=1), 1 + len(known), axis=1
    )
    noisy = readings + errors
    fitted = {
        channel: (drawn.stated(means), _limits(means + error)["95"])
        for channel, means, error in zip(known, of_bodies, of_sensors, strict=True)
    }
    medians = {n: drawn.stated(v) for n, v in course.nodes.items()}
    limits = {n: _limits(v)["95"] for n, v in course.nodes.items()}
    return Prediction(
        model=source.model,
        test=test,
        is_held_out=fitted_as is None,
        median=drawn.stated(readings),
        parameters=_limits(readings),
        total=_limits(noisy),
        sd=np.std(noisy, axis=0),
        nodes=medians,
        nodes_95=limits,
        flows={n: drawn.stated(v) for n, v in course.flows.items()},
        flows_95={n: _limits(v)["95"] for n, v in course.flows.items()},
        draws=readings,
        values=drawn.values,
        middle=middle,
        noise=drawn.noise.scaled(scales_of(source.loggers, test)[0]),
        heat=heat[: test.measured.size],
        bodies=body_courses(source.model.form, test, fitted, medians, limits),
    )


def unpredicted(posterior: Posterior, test: Blocks) -> Prediction:
    """Return what stands in for the prediction of a test that failed: NaN throughout."""
    problem = posterior.fit.problem
    size = test.num_blocks
    nothing = np.full(size, np.nan)
    limits = {level: (nothing, nothing) for level in LEVELS}
    nodes = problem.model.form.nodes
    noise = posterior.draws.thin(1, 0).noise()
    return Prediction(
        model=problem.model,
        test=test,
        is_held_out=all(each.winding is not test for each in problem.tests),
        median=nothing,
        parameters=limits,
        total=limits,
        sd=nothing,
        nodes=dict.fromkeys(nodes, nothing),
        nodes_95=dict.fromkeys(nodes, (nothing, nothing)),
        flows={},
        flows_95={},
        draws=np.zeros((0, size)),
        values={},
        middle={},
        noise=noise,
        heat=np.zeros((size, 0)),
    )


@dataclass(frozen=True)
class OfTest:
    """Draws of everything that drives the model through one test."""

    values: dict[str, np.ndarray]  # Draws by parameter name [their units], shape (draw,).
    noise: Noise  # Of the first logger for each draw.
    # Effects behind the draws, None if all are of the model alone.
    plausible: PlausibleEffects | None = None

    def stated(self, draws: np.ndarray) -> Any:
        """Return the median of what hangs on the draws, over those of the network alone."""
        return np.median(of_network(self.plausible, draws), axis=0)

    def middle(self) -> dict[str, float]:
        """Return the stated values of all parameters by name [their units]."""
        return {name: float(self.stated(draws)) for name, draws in self.values.items()}


def of_test(
    draws: Draws, test: Blocks, *, fitted_as: str | None, num_draws: int = NUM_DRAWS, seed: int = 0
) -> OfTest:
    """Return draws of all parameters for one test: what was fitted, and priors for the rest.

    Args:
        draws: Draws of a fit.
        test: The test.
        fitted_as: Name of the fitted test that it is, None if it was not fitted.
        num_draws: Number of draws.
        seed: Of what the fit does not know of the test.
    """
    picked = draws.thin(num_draws, seed)
    # where nothing was free, nothing is uncertain: the most probable values
    rng = np.random.default_rng([seed, 3]) if draws.parameters.num_free else None
    known = parameters(draws.model, draws.motor, [test]).by_test[0]
    values = picked.of_test(fitted_as)
    if "speed" not in test.means:
        values.pop("torque_offset", None)  # nothing that it could act on
    if fitted_as is None:
        known = {**known, **_as_other_tests_tell(picked, test)}
    starts = {name for _, name in draws.model.form.starts}
    size = picked.vectors.shape[0]
    nulls = null_values(draws.model.effects)
    for name, parameter in known.items():
        if name in values or (name in starts and fitted_as is None):
            continue
        is_new = parameter.role == "instrument" and not parameter.per_test
        if parameter.fixed is not None or parameter.role in ("effect", "known") or is_new:
            # an event of another test stays at its null, as does an instrument that a run of an
            # earlier version does not know
            number = nulls.get(name, parameter.centre)
            number = number if parameter.fixed is None else parameter.fixed
            values[name] = np.full(size, number)
        else:
            z = np.zeros(size) if rng is None else rng.standard_normal(size)
            values[name] = parameter.value(z)
    noise = picked.noise()
    if fitted_as is None:
        values |= start_draws(draws.model, test, dict(known), values, noise, draws.loggers, rng)
    return OfTest(values, noise, picked.plausible)


def _as_other_tests_tell(draws: Draws, test: Blocks) -> dict[str, Parameter]:
    """Return the errors that the inputs of a test tell, held against those of the fitted tests."""
    values, told = draws.values(), {own_name(each.name): each for each in test.told}
    fitted = [
        [told[slot.parameter.name]._replace(mean=float(np.mean(seen)), sd=float(np.std(seen)))]
        for slot in draws.parameters.slots
        if slot.parameter.name in told
        for seen in (values[slot.name],)
    ]
    return {each.name: each for each in own_errors(together([*fitted, test.told])[-1])}


@compiled(is_seldom=True)
def _errors(noise: Noise, seed: Int[Array, ""], test: Observation) -> Float[Array, "draw block"]:
    keys = jax.random.split(jax.random.key(seed), noise.sd.shape[0])

    def one(of_draw: tuple[Noise, Array]) -> Float[Array, " block"]:
        return noise_module.draw(of_draw[1], of_draw[0], test)

    return jax.lax.map(one, (noise, keys), batch_size=AT_A_TIME)


def _limits(draws: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {
        name: (np.quantile(draws, low, axis=0), np.quantile(draws, high, axis=0))
        for name, (low, high) in LEVELS.items()
    }
