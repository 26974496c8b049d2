"""One compiled model with every effect in it, of which any subset can be fitted.

Compiling a model for each candidate would take minutes. All effects are in the model at once
instead; those at their null value change nothing. One function, which returns a test's modelled
block means and their derivatives along some directions, is all that is compiled, and it serves
every test, every candidate, and every combination.

`library` says which effects a discovery searches: those that the tests have the inputs for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from zlib import crc32

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.optimize import least_squares

from lptn import Network
from lptn.effects import AbstractEffect, Quantity, applies

from ..fit.fit_result import Fit
from ..fit.restricted import MANY
from ..io.programs import compiled
from ..model import noise as noise_module
from ..model.catalogue import lacking, unplaced
from ..model.draws import side_by_side
from ..model.kernels import at_once
from ..model.model import Model
from ..model.model_parameters import machine_size
from ..model.network_form import WINDING
from ..model.noise import Loggers, Noise
from ..model.parameters import EVENT, Parameter, sized
from ..model.problem import WORST_RESIDUAL, Problem, with_slopes
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.observation import Observation

LANES, OF_LONG = 32, 8
"""Directions of one call: parameters of the network, of a few tests, and of several effects. One
call of 32 takes 7 ms where two of 24 take 12 (a test of 2560 steps). And those of a long test."""

FEW = 8
"""Columns that are whitened together are filled up to this many, or to a multiple of `MANY`."""

MAX_EVALUATIONS = 30
"""Evaluations of one refit; they start near the optimum and take about six."""

XTOL, FTOL = 1e-4, 1e-4
"""Step and fall of the sum of squares at which a refit ends [1]."""

ROUGHLY = 1e-2
"""The fall at which one ends whose noise is not the last one [1]."""

REACH = 8.0
"""Prior standard deviations that a parameter of the network may go from its prior's centre, or from
where a fit without bounds has put it."""

STEEPEST = 1e3 * WORST_RESIDUAL
"""A derivative [K per score] beyond this, of a network too stiff for the step, has no square."""

BOUNDED = ("effect", "known")
"""Roles of parameters whose amplitudes stay within their physical range."""


@dataclass(frozen=True)
class Refit:
    """A least-squares fit of some parameters under a given noise."""

    free: tuple[int, ...]  # Indices of the free slots, in order.
    z: Float[np.ndarray, " slot"]  # Scores of all slots, shape (slot,).
    # Measured minus modelled block means, all tests in a row [K].
    residual: Float[np.ndarray, " block"]
    # Its derivative by the free slots [K per score], shape (block, free).
    jacobian: Float[np.ndarray, "block free"]
    chi2: float  # Sum of squares of whitened residuals and free scores [1].
    log_det: float  # Log determinant of the posterior precision of the free scores [1].
    noise: Noise  # The noise.

    @property
    def log_evidence(self) -> float:
        """Laplace approximation of the log evidence under the noise, up to a constant [nat]."""
        return -0.5 * self.chi2 - 0.5 * self.log_det


class Engine:
    """The extended model over tests, ready to be evaluated.

    Args:
        problem: A problem whose model holds all effects of the library.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.slots = problem.parameters.slots
        self.tests = problem.tests
        self._padded = [test.observation().padded().simulated() for test in problem.tests]
        self._is_observed = problem.is_observed
        self.kinds = {kind.card.id: kind for kind in problem.model.effects}
        self._lanes = side_by_side(self._padded, LANES, OF_LONG)
        self._size = machine_size(problem.model, problem.motor, problem.tests)
        self._nulls = [self._null(slot.parameter) for slot in self.slots]

    def with_heat(self, heat: tuple[Float[np.ndarray, "block column"], ...]) -> Engine:
        """Return the engine with unmodelled heat in its covariance, compiled as it is.

        Args:
            heat: As `Problem.heat`.
        """
        return self._with(replace(self.problem, heat=heat))

    def with_noise_of(self, problem: Problem) -> Engine:
        """Return the engine with the noise of each logger and the unmodelled heat of a problem."""
        return self._with(replace(self.problem, loggers=problem.loggers, heat=problem.heat))

    def with_loggers(self, loggers: Loggers) -> Engine:
        """Return the engine with the noise of each logger."""
        return self._with(replace(self.problem, loggers=loggers))

    def _with(self, problem: Problem) -> Engine:
        changed = copy(self)
        changed.problem = problem
        return changed

    @property
    def is_observed(self) -> np.ndarray:
        """Which blocks hold a reading, all tests in a row."""
        return self._is_observed

    @cached_property
    def sensors(self) -> dict[str, Bool[np.ndarray, " block"]]:
        """Which blocks hold a reading of a sensor, by channel, the winding's first."""
        channels = np.concatenate(
            [np.repeat((WINDING, *test.fitted), test.num_blocks) for test in self.tests]
        )
        return {
            channel: (channels == channel) & self.is_observed for channel in dict.fromkeys(channels)
        }

    def rms_K(self, rows: Float[np.ndarray, " block"]) -> float:
        """Return the root of the mean squares of rows over all blocks, summed over the sensors [K].

        The sum, not the mean: what one sensor shows weighs the same, however many others there are.

        Args:
            rows: Of all tests; NaN where there is nothing.
        """
        squares = (rows[own & np.isfinite(rows)] ** 2 for own in self.sensors.values())
        return float(np.sqrt(sum(float(np.mean(each)) for each in squares if each.size)))

    def find(self, name: str, test: int | None = None) -> int | None:
        """Return the slot of a parameter by its qualified name, None if it is fixed."""
        for position, slot in enumerate(self.slots):
            if slot.parameter.name == name and slot.test == test:
                return position
        return None

    @property
    def base(self) -> tuple[int, ...]:
        """Slots of the base model."""
        return tuple(i for i, slot in enumerate(self.slots) if slot.parameter.role != "effect")

    def quantity(self, parameter: Parameter) -> Quantity:
        """Return what is usual of an effect's parameter in a machine of this size."""
        effect, name = parameter.name.split(".", 1)
        kind = self.kinds[effect]
        return sized(kind, kind.card.parameters[name], self._size)

    def _null(self, parameter: Parameter) -> float:
        """Return the value of a parameter where its effect is absent."""
        if parameter.role not in BOUNDED:
            return math.nan
        null = self.quantity(parameter).null
        return parameter.centre if null is None else null

    def linearise(
        self, z: np.ndarray, columns: Sequence[int]
    ) -> tuple[Float[np.ndarray, " block"], Float[np.ndarray, "block column"]]:
        """Return residuals of all tests in a row [K] and their derivatives [K per score].

        Args:
            z: Scores of all slots; NaN for those of an effect that is absent.
            columns: Slots that are derived by.
        """
        known = [self.values(z, index) for index in range(len(self.tests))]
        own = [
            [c for c in range(len(columns)) if self.slots[columns[c]].test in (None, index)]
            for index in range(len(self.tests))
        ]
        jobs = [
            (index, mine[first : first + self._lanes])
            for index, mine in enumerate(own)
            for first in range(0, max(len(mine), 1), self._lanes)
        ]

        def some(job: tuple[int, list[int]]) -> tuple[np.ndarray, np.ndarray]:
            index, chunk = job
            values, gains = known[index]
            directions = {name: np.zeros(self._lanes) for name in values}
            for lane, column in enumerate(chunk):
                slot = self.slots[columns[column]]
                directions[slot.parameter.name][lane] = gains[columns[column]]
            means, slope = _course(self.problem.model, values, directions, self._padded[index])
            return np.asarray(means), np.asarray(slope)

        found = at_once(some, jobs) if len(jobs) > 1 else [some(job) for job in jobs]
        means = [np.zeros(0)] * len(self.tests)
        jacobians = [np.zeros((test.measured.size, len(columns))) for test in self.tests]
        for (index, chunk), (means[index], slope) in zip(jobs, found, strict=True):
            jacobians[index][:, chunk] = -self.tests[index].own(slope)[:, : len(chunk)]
        rows: list[np.ndarray] = []
        slopes: list[np.ndarray] = []
        for test, of_test, jacobian in zip(self.tests, means, jacobians, strict=True):
            residual, is_sound = self._sound(test, test.own(of_test))
            rows.append(residual)
            slopes.append(self._followed(jacobian, is_sound))
        return np.concatenate(rows), np.concatenate(slopes)

    def linearise_many(
        self, places: Sequence[tuple[np.ndarray, Sequence[int]]]
    ) -> list[tuple[Float[np.ndarray, " block"], Float[np.ndarray, "block column"]]]:
        """Return what `linearise` does at many places with few columns each, side by side.

        Args:
            places: Scores of all slots, and slots that are derived by.
        """
        lanes = [
            (place, column)
            for place, (_, columns) in enumerate(places)
            for column in (columns or [None])
        ]
        found = [([], []) for _ in places]
        for index, padded in enumerate(self._padded):
            test, known = self.tests[index], [self.values(z, index) for z, _ in places]

            def some(first: int, padded=padded, known=known) -> np.ndarray:
                chunk = lanes[first : first + self._lanes]
                chunk += [(chunk[0][0], None)] * (self._lanes - len(chunk))
                values = {name: np.array([known[p][0][name] for p, _ in chunk])
                          for name in known[0][0]}  # fmt: skip
                directions = {name: np.zeros(self._lanes) for name in values}
                for lane, (place, column) in enumerate(chunk):
                    if column is not None and column in known[place][1]:
                        name = self.slots[column].parameter.name
                        directions[name][lane] = known[place][1][column]
                return np.asarray(_courses(self.problem.model, values, directions, padded))

            rows = np.concatenate(at_once(some, range(0, len(lanes), self._lanes)), axis=1)
            own = test.own(np.moveaxis(rows, -1, 0))
            for place in range(len(places)):
                mine = [lane for lane, (p, _) in enumerate(lanes) if p == place]
                residual, is_sound = self._sound(test, own[:, 0, mine[0]])
                slopes = -own[:, 1, mine[: len(places[place][1])]]
                found[place][0].append(residual)
                found[place][1].append(self._followed(slopes, is_sound))
        return [(np.concatenate(rows), np.concatenate(slopes)) for rows, slopes in found]

    @staticmethod
    def _sound(test: Blocks, means: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals of a test, kept in bounds, and which of them are as they came."""
        residual, seen = test.measured - means, test.is_observed
        is_sound = seen & (np.abs(residual) < WORST_RESIDUAL)
        return np.where(is_sound, residual, np.where(seen, WORST_RESIDUAL, 0.0)), is_sound

    @staticmethod
    def _followed(slopes: np.ndarray, is_sound: np.ndarray) -> np.ndarray:
        """Return the derivatives of a test, 0 where no solver could follow them."""
        return np.where(is_sound[:, None] & (np.abs(slopes) < STEEPEST), slopes, 0.0)

    def whiten(self, noise: Noise, stacked: np.ndarray) -> np.ndarray:
        """Return rows over all blocks (block, ...) whitened test by test."""
        num = stacked.shape[1] if stacked.ndim > 1 else 0
        if num > MANY:  # few shapes are compiled
            chunks = (stacked[:, first : first + MANY] for first in range(0, num, MANY))
            return np.concatenate([self.whiten(noise, chunk) for chunk in chunks], axis=1)
        if num:  # with empty columns
            stacked = np.pad(stacked, ((0, 0), (0, (FEW if num <= FEW else MANY) - num)))
        parts = self.problem.split(stacked)
        rows = np.concatenate([
            test.own(noise_module.whiten(test.lengthened(part), noise, padded)[0])
            for part, test, padded in zip(parts, self.tests, self.problem.readings, strict=True)
        ])  # fmt: skip
        return rows[:, :num] if num else rows

    def refit(
        self,
        z: np.ndarray,
        free: Sequence[int],
        noise: Noise,
        most: int = MAX_EVALUATIONS,
        fall: float = FTOL,
    ) -> Refit:
        """Fit some slots by least squares on whitened residuals, the others held.

        Args:
            z: Scores to start from.
            free: Slots that are fitted.
            noise: The noise.
            most: Evaluations at most.
            fall: Fall of the sum of squares at which it ends [1].
        """
        order = list(free)
        low, high = self.bounds(order)
        base = np.array([self.slots[slot].parameter.role not in BOUNDED for slot in order])
        low[base] = np.minimum(low[base], z[order][base] - REACH)
        high[base] = np.maximum(high[base], z[order][base] + REACH)
        after = z.copy()
        latest: dict[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

        def evaluate(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            key = x.tobytes()
            if key not in latest:
                latest.clear()
                after[order] = x
                residual, jacobian = self.linearise(after, order)
                white = self.whiten(noise, np.column_stack([residual, jacobian]))
                latest[key] = residual, jacobian, white
            return latest[key]

        def rows(x: np.ndarray) -> np.ndarray:
            return np.concatenate([evaluate(x)[2][:, 0], x])

        def slopes(x: np.ndarray) -> np.ndarray:
            return np.concatenate([evaluate(x)[2][:, 1:], np.eye(x.size)])

        solution = least_squares(
            rows,
            np.clip(z[order], low + 1e-9, high - 1e-9),
            jac=slopes,  # pyright: ignore[reportArgumentType]
            bounds=(low, high),
            xtol=XTOL,
            ftol=fall,
            x_scale="jac",
            gtol=1e-6,
            max_nfev=most,
        )
        residual, jacobian, white = evaluate(solution.x)
        after[order] = solution.x
        precision = white[:, 1:].T @ white[:, 1:] + np.eye(len(order))
        return Refit(
            free=tuple(order),
            z=after,
            residual=residual,
            jacobian=jacobian,
            chi2=2.0 * float(solution.cost),
            log_det=float(np.linalg.slogdet(precision)[1]),
            noise=noise,
        )

    def bounds(self, order: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds of scores: amplitudes that cannot change sign stay on their side."""
        low, high = np.full(len(order), -REACH), np.full(len(order), REACH)
        for position, slot in enumerate(order):
            parameter = self.slots[slot].parameter
            if parameter.role not in BOUNDED:
                continue
            quantity = self.quantity(parameter)
            null, is_searched = quantity.null, parameter.role == "effect"
            if is_searched and null is None:
                low[position], high[position] = -2.5, 2.5
            elif is_searched and null is not None:
                below = min(quantity.low, null)
                low[position] = 1.5 * float(parameter.score(below)) if below else 0.0
                high[position] = 1.5 * float(parameter.score(max(quantity.high, null)))
                if null <= quantity.low:
                    low[position] = 0.0
                if null >= quantity.high:
                    high[position] = 0.0
            high[position] = min(high[position], parameter.largest_score)
        return low, high

    def values(self, z: np.ndarray, test: int) -> tuple[dict[str, float], dict[int, float]]:
        """Return values by name for a test, and the derivative of each slot's value by score."""
        values = {
            name: float(parameter.fixed)
            for name, parameter in self.problem.parameters.by_test[test].items()
            if parameter.fixed is not None
        }
        gains = {}
        for position, slot in enumerate(self.slots):
            if slot.test not in (None, test):
                continue
            parameter = slot.parameter
            if np.isnan(z[position]):
                value = self._nulls[position]
                gains[position] = 0.0
            elif parameter.transform == "log":
                value = parameter.centre * float(np.exp(parameter.sd * z[position]))
                gains[position] = parameter.sd * value
            else:
                value = parameter.centre + parameter.sd * float(z[position])
                gains[position] = parameter.sd
            values[parameter.name] = value
        return values, gains

    def draws_in_general(self, z: Float[np.ndarray, "draw slot"]) -> dict[str, np.ndarray]:
        """Return values by name of the machine in general, an event of a test absent.

        Args:
            z: Scores of all slots, those of absent effects NaN.
        """
        values = {
            name: np.full(len(z), float(parameter.fixed))
            for name, parameter in self.problem.parameters.by_test[0].items()
            if parameter.fixed is not None
        }
        for place, slot in enumerate(self.slots):
            if slot.test in (None, 0):
                is_there = np.isfinite(z[:, place]) & (
                    slot.test is None or slot.parameter.role not in BOUNDED
                )
                value = slot.parameter.value(np.nan_to_num(z[:, place]))
                values[slot.parameter.name] = np.where(is_there, value, self._nulls[place])
        return self.problem.model.in_general(values)


@compiled("model")
def _course(
    model: Model,
    values: dict[str, Float[Array, ""]],
    directions: dict[str, Float[Array, " lane"]],
    test: Observation,
) -> tuple[Float[Array, " block"], Float[Array, "block lane"]]:
    """Return the modelled block means [degC] and their derivatives along the directions."""
    return with_slopes(lambda v: model.block_means(v, test), values, directions)


@compiled("model")
def _courses(
    model: Model,
    values: dict[str, Float[Array, " lane"]],
    directions: dict[str, Float[Array, " lane"]],
    test: Observation,
) -> Float[Array, "two lane block"]:
    """Return the modelled block means of many machines [degC], and the derivative of each along a
    direction of its own.
    """

    def one(values: dict[str, Array], direction: dict[str, Array]) -> Array:
        return jnp.stack(jax.jvp(lambda v: model.block_means(v, test), (values,), (direction,)))

    return jax.vmap(one, out_axes=1)(values, directions)


def white(level: float) -> Noise:
    """Return white noise of a level [K]."""
    return Noise(*(np.asarray(number) for number in (0.0, 40.0, level, 0.0)))


def placed(engine: Engine, fit: Fit) -> tuple[np.ndarray, list[int]]:
    """Return a fit among all slots of an engine: their scores, NaN but for its own, and its places.

    The order is that of the fit, where a test may have a parameter that another lacks.
    """
    order = []
    for slot in fit.slots:
        place = engine.find(slot.parameter.name, slot.test)
        assert place is not None, slot.name
        order.append(place)
    z = np.full(len(engine.slots), np.nan)
    z[order] = fit.z
    return z, order


@dataclass(frozen=True)
class Candidate:
    """An effect that could be missing; an event counts once for each test."""

    kind: type[AbstractEffect]  # The effect.
    # Index of the test that an event happens in; None for all other effects.
    test: int | None = None

    def __hash__(self) -> int:
        # that of a class is its address: sets would be searched in another order in each process
        return hash((crc32(self.id.encode()), -1 if self.test is None else self.test))

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id

    def test_name(self, tests: Sequence[Blocks]) -> str | None:
        """Return the test that an event happens in, None for all other effects."""
        return None if self.test is None else tests[self.test].name


@dataclass(frozen=True)
class Library:
    """What is searched, and what cannot be."""

    kinds: tuple[type[AbstractEffect], ...]  # Effects that the tests have the inputs for, in order.
    candidates: tuple[Candidate, ...]  # These as candidates.
    unavailable: dict[str, str]  # Reason by id why an effect is not searched.
    # Ids of the effects that a channel of some of the tests keeps out, by channel and by the names
    # of the tests that lack it.
    in_some: dict[tuple[str, tuple[str, ...]], tuple[str, ...]]


def library(
    kinds: Sequence[type[AbstractEffect]],
    network: Network,
    tests: Sequence[Blocks],
    *,
    num_events: int | None = None,
) -> Library:
    """Return which effects the tests allow to be searched.

    Args:
        kinds: All effects.
        network: The base network.
        tests: The reduced records.
        num_events: Tests that an event can be sought in, the first ones; all by default.
    """
    num_events = len(tests) if num_events is None else num_events
    usable: list[type[AbstractEffect]] = []
    unavailable: dict[str, str] = {}
    in_some: dict[tuple[str, tuple[str, ...]], tuple[str, ...]] = {}
    for kind in kinds:
        lacks = {test.name: lacking(kind, test) for test in tests}
        missing = dict.fromkeys(channel for of_test in lacks.values() for channel in of_test)
        if missing:
            unavailable[kind.card.id] = f"needs the channel {', '.join(missing)} in every test"
            for channel in missing:
                without = tuple(name for name, of_test in lacks.items() if channel in of_test)
                if len(without) < len(lacks):
                    key = channel, without
                    in_some[key] = (*in_some.get(key, ()), kind.card.id)
        elif kind.card.is_at_once and not any(test.jumps_with_load for test in tests):
            unavailable[kind.card.id] = "the samples do not jump as the load steps"
        elif not kind.fits(network):
            unavailable[kind.card.id] = "splits a network of one node, and this one has more"
        elif not applies(kind, network):
            unavailable[kind.card.id] = "acts on a link that this network does not have"
        elif unplaced([kind], network):
            unavailable[kind.card.id] = "adds a node that this network already has"
        else:
            usable.append(kind)
    candidates: list[Candidate] = []
    for kind in usable:
        if kind.card.family == EVENT:
            candidates += [Candidate(kind, index) for index in range(num_events)]
        else:
            candidates.append(Candidate(kind))
    return Library(tuple(usable), tuple(candidates), unavailable, in_some)


def ruled_out(kinds: Sequence[type[AbstractEffect]], motor: Motor) -> dict[str, str]:
    """Return the effects, with the reason, that no test of a machine can show."""
    reasons: dict[str, str] = {}
    if motor.losses == "balance":
        reason = "its heat is in the measured balance of the losses"
        reasons |= {kind.card.id: reason for kind in kinds if kind.card.is_in_balance}
    if motor.phase_resistance_ohm is None and "Rs0" not in motor.parameters:
        reason = "needs [winding] phase_resistance_ohm in the motor file"
        reasons |= {kind.card.id: reason for kind in kinds if kind.rebuilds}
    return reasons
