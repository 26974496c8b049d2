"""Simpler networks that come nearest to a model, for tools that take no more."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from ..model.bodies import OWN, own_name
from ..model.draws import ABSURD, block_means
from ..model.model import Model
from ..model.parameters import Parameter
from ..posterior.predict import Prediction
from ..record.blocks import Blocks
from ..record.observation import Observation
from ..results.model import Replica

REACH = 5.0
"""A parameter of the replica stays within this factor of the model's, to either side, in logarithms
of e [1]."""


@dataclass(frozen=True, eq=False)
class Followed:
    """A test whose course in a model a simpler network is to follow."""

    test: Blocks  # The test, with the inputs that drive the simpler network.
    course: Float[np.ndarray, " block"]  # Block means of the model [degC], shape (block,).
    # Instruments, starts and what else is not sought, by parameter name [their units].
    values: Mapping[str, float]

    @cached_property
    def observation(self) -> Observation:
        """What drives the simpler network."""
        return self.test.observation().padded(is_seldom=True).simulated()

    def error_K(self, model: Model, parameters: Mapping[str, float]) -> Float[np.ndarray, " block"]:
        """Return the course of a network minus that of the model [K], shape (block,).

        One that is too stiff for the steps of the test leaves the numbers: its error has a square.
        """
        values = {n: np.float64(v) for n, v in {**self.values, **parameters}.items()}
        error = self.test.own(block_means(model, values, self.observation)) - self.course
        return np.nan_to_num(np.clip(error, -ABSURD, ABSURD), nan=ABSURD)


@dataclass(frozen=True, eq=False)
class Nearest:
    """The parameters with which a network comes nearest to another model."""

    parameters: dict[str, float]  # By name [J/K, K/W].
    # Course of the network minus that of the model, by test [K], shape (block,) each.
    errors_K: tuple[np.ndarray, ...]
    # By logarithms of the parameters, weighted [K], shape (row, parameter).
    slope: Float[np.ndarray, "row parameter"]
    weight: Float[np.ndarray, " row"]  # Of each row [1], shape (row,).

    @property
    def rms_K(self) -> float:
        """Root mean square of the errors [K]."""
        return float(np.sqrt(np.mean(np.concatenate(self.errors_K) ** 2)))

    def moved(self, apart: Float[np.ndarray, "draw row"]) -> dict[str, np.ndarray]:
        """Return the parameters that follow other courses, to the first order of their logarithms.

        Args:
            apart: Those courses minus the one that was followed, tests in a row [K].

        Returns:
            By name [J/K, K/W], shape (draw,).
        """
        logs = (apart * self.weight) @ np.linalg.pinv(self.slope).T
        return {
            name: value * np.exp(of_draws)
            for (name, value), of_draws in zip(self.parameters.items(), logs.T, strict=True)
        }


def nearest(
    model: Model, start: Mapping[str, float], tests: Sequence[Followed], *, cold: float = 1.0
) -> Nearest:
    """Return the parameters with which a network comes nearest to other courses.

    Args:
        model: The network.
        start: Where the search starts, by name of what is sought [J/K, K/W].
        tests: What it is to follow.
        cold: How many times an error counts where the network is the colder one [1].
    """

    def named(logs: np.ndarray) -> dict[str, float]:
        return dict(zip(start, np.exp(logs).tolist(), strict=True))

    def errors(logs: np.ndarray) -> list[np.ndarray]:
        return [test.error_K(model, named(logs)) for test in tests]

    def weight(errors: np.ndarray) -> np.ndarray:
        return np.where(errors < 0.0, cold, 1.0)

    def weighted(logs: np.ndarray) -> np.ndarray:
        joined = np.concatenate(errors(logs))
        return weight(joined) * joined

    first = np.log([*start.values()])
    found = least_squares(weighted, first, bounds=(first - REACH, first + REACH), diff_step=1e-4)
    apart = errors(found.x)
    return Nearest(named(found.x), tuple(apart), found.jac, weight(np.concatenate(apart)))


def replica(
    model: Model,
    parameters: Mapping[str, Parameter],
    predictions: Sequence[Prediction],
    kept: Collection[str] = (),
) -> Replica | None:
    """Return the network with fewer effects that behaves most like a model on its fitted tests.

    Its resistances and capacities are those that bring its winding nearest to the model's, with
    exact instruments and the model's start temperatures; what a sensor does to the reading is none
    of the network's, and the same in both. None where the model has no effects.

    Args:
        model: The network with its effects.
        parameters: All that were estimated, as a test sees them, by name.
        predictions: Of all tests.
        kept: Ids of effects that it keeps as they are; without any it is the plain network.
    """
    tests = [p for p in predictions if p.is_there]
    fitted = [p for p in tests if not p.is_held_out]
    names = [p.name for p in model.form.parameters if p.fixed is None]
    if not model.effects or not fitted:
        return None
    left = tuple(e for e in model.effects if e.card.id in kept or e.card.family == "sensor")
    plain, ids = replace(model, effects=left), {effect.card.id for effect in left}
    own_names = {own_name(name) for name in OWN}  # a test's own: its inputs without these mislead
    exact = {
        name: parameter.centre
        for name, parameter in parameters.items()
        if parameter.role == "instrument" and name not in own_names
    }

    def followed(each: Prediction) -> Followed:
        own = {n: v for n, v in each.middle.items()
               if n not in exact and ("." not in n or n.split(".")[0] in ids)}  # fmt: skip
        return Followed(each.test, each.median, exact | own)

    courses = {each.test.name: followed(each) for each in tests}
    start = {name: fitted[0].middle[name] for name in names}
    found = nearest(plain, start, [courses[each.test.name] for each in fitted])
    errors = {}
    for each in tests:
        if np.any(seen := each.test.is_observed):
            apart = courses[each.test.name].error_K(plain, found.parameters)
            errors[each.test.name] = float(np.sqrt(np.mean((each.residual - apart)[seen] ** 2)))
    return Replica(parameters=found.parameters, rmse_K=errors, from_model_K=found.rms_K)
