"""What an observer knows of noise, of heat that the network misses, and of constant errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from ..model.bodies import OWN, own_name, told_bodies
from ..model.draws import Draws, courses
from ..model.model import Model
from ..model.parameters import Parameter, qualified
from ..record.blocks import Blocks
from ..record.samples import BLOCK_S
from ..results.model import FittedModel
from ..results.values import known
from ..runs.run import Run
from .rerun import RunAndTest
from .variables import Corrections

if TYPE_CHECKING:
    from ..posterior.predict import Prediction

POWER = ("power_gain", *OWN, *map(own_name, OWN))
"""Errors of the instruments that the losses are made with."""


@dataclass(frozen=True)
class Missed:
    """What the observer knows of noise, of heat that the network misses, and of constant errors."""

    heat: float  # Standard deviation of the heat over the mean loss [1].
    heat_s: float  # Its correlation time [s].
    # Standard deviation of the slow part of the readings' noise [K]; no larger than a sensor's
    # constant error may be.
    slow_K: float
    slow_s: float  # Its correlation time [s].
    white_K: float  # Standard deviation of the white part in a mean of `BLOCK_S` [K].
    sensor_K: float  # Standard deviation of the constant error of the sensor [K].
    # Standard deviation of a temperature from the parameters that there is without a rise [K].
    sink_K: float = 0.0
    share: float = 0.0  # That of a rise from the parameters, over the rise [1].
    losses: float = 0.0  # That of the losses that are passed, over the losses [1].
    resolution_K: float = 0.0  # Step of the readings [K].
    # Standard deviation of a change soon after a step of the load, over the change [1].
    answer: float = 0.0
    misfit_K: float = 0.0  # That of what the network misses with the time of `slow_K` [K].
    # What parameters are multiplied with, one sd off in the direction that the run tells least of
    # [1], by name: nodes that it did not read are off by that beside one that it did. The spread
    # above is what there is besides.
    aside: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, run: Run, network: str | None, found: RunAndTest, whole: RunAndTest, bias_K: float
    ) -> Missed:
        """Return what a run says of a network.

        The losses are meant as the run corrects them. What it leaves open of that is in the
        parameters: they are drawn for losses that are given.

        Args:
            run: The run.
            network: Name of the network; None for the last one.
            found: The test that is exported.
            whole: The same with all effects of the run; where `found` has fewer, its readings of
                the losses are taken as they are.
            bias_K: RMS by which a simpler network is elsewhere: readings stray from it so far.
        """
        model, record = run.result.models[run.choose(network)], found.record
        from ..posterior.predict import predict

        noise = model.noise
        said, heat = found.model.adequacy, known(noise.unmodelled_heat)
        heat = said.unmodelled_heat if heat is None else heat
        priors = run.model(network).parameters.by_test[0]
        sink = record[f"{found.motor.sink}_degC"]
        # a drive's instruments are of the class of the bench's, and need not be the same ones
        offset, gain = (
            priors[name].sd if name in priors else 0.0 for name in ("sensor_offset", "sensor_gain")
        )
        # a network of too few nodes errs slowly, and its readings do not
        slow = math.hypot(noise.sd_K, bias_K)
        own = min(slow, offset or slow)
        rise = float(np.sqrt(np.nanmean((record["winding_degC"] - sink) ** 2)))
        ours = priors.get("ambient_offset")
        draws = _for_given_losses(run, network)
        predicted = predict(draws, whole.blocks)
        nodes = [node for node in found.model.form.nodes if node in predicted.nodes]
        aside, moved = least_told(draws, whole.blocks, nodes)
        sink_K, share = _spread(predicted, moved, float(np.nanmean(sink)), bias_K)
        errors = {name: priors[name].sd for name in POWER
                  if name in priors and priors[name].fixed is None}  # fmt: skip
        its, theirs = (Corrections.of(each.values) for each in (whole, found))
        for name in ("power_gain", *OWN):  # where they differ, the readings are meant
            left = getattr(its, name) - getattr(theirs, name)
            errors[name] = math.hypot(errors.get(name, 0.0), left)
        losses, rest = of_losses(errors, found.blocks)
        heat = math.hypot(heat, rest, _moved_copper(priors, found))
        share = max(share, _at_rest(model, losses))
        sink_K = max(sink_K, ours.sd if ours else 0.0)
        resolution_K = max(each.resolution_K for each in found.blocks.loggers)
        return cls(heat, said.heat_time_s, own, noise.time_s, noise.white_K,
                   math.hypot(offset, gain * rise), sink_K, share, losses, resolution_K,
                   math.hypot(_least_known(model, found.model), losses),
                   math.sqrt(slow**2 - own**2), aside)  # fmt: skip

    def widened(self, more: float) -> Missed:
        """Return it where the network misses some times the slow noise besides [1]."""
        return replace(self, misfit_K=math.hypot(self.misfit_K, more * self.slow_K))

    def heat_W(self, losses: float, W_per_K: float, time_s: float) -> tuple[float, float]:
        """Return the standard deviation of the missed heat [W], and its correlation time [s].

        Args:
            losses: Mean loss [W].
            W_per_K: Conductance from the sensed node to what surrounds it.
            time_s: Time constant of that node.
        """
        slow, fast = self.heat * losses, self.misfit_K * W_per_K
        fast *= math.sqrt(1.0 + time_s / self.slow_s)  # such heat moves the node by the misfit
        both = max(slow**2 + fast**2, 1e-30)
        return math.sqrt(both), (slow**2 * self.heat_s + fast**2 * self.slow_s) / both

    def reading(self, step: float) -> float:
        """Return the standard deviation of the white part of one reading [K].

        Args:
            step: Time between readings [s].
        """
        white = self.white_K**2 * max(1.0, BLOCK_S / step)
        return math.sqrt(max(white, self.resolution_K**2 / 12.0) + 1e-6)


def _for_given_losses(run: Run, network: str | None) -> Draws:
    """Return the draws of a run for losses that are known, as the run corrects them."""
    draws = run.draws(network)
    vectors = draws.vectors.copy()
    for place, slot in enumerate(draws.parameters.slots):
        if slot.parameter.name in POWER:
            vectors[:, place] = np.median(vectors[:, place])
    return replace(draws, vectors=vectors)


def names_of_laws(model: Model) -> set[str]:
    """Return the names of the parameters of a network and its effects."""
    return {each.name for each in model.form.parameters} | {"Rs0"} | {
        qualified(kind, part) for kind in model.effects for part in kind.card.parameters
    }  # fmt: skip


def least_told(
    draws: Draws, test: Blocks, nodes: Sequence[str]
) -> tuple[dict[str, float], dict[str, Float[np.ndarray, " block"]]]:
    """Return the direction in which the draws leave nodes open most beside the one that is read.

    That is the first principal component of how far they are from it in a test, instruments and
    starts as stated, and the parameters that go with it.

    Returns:
        What the parameters are multiplied with one sd in that direction [1], by name; and by how
        much that moves each node [K].
    """
    from ..posterior.predict import of_test

    names, drawn = names_of_laws(draws.model), of_test(draws, test, fitted_as=None)
    middle = drawn.middle()
    rows = test.with_bodies(told_bodies(middle, test))
    values = {n: v if n in names else np.full_like(v, middle[n]) for n, v in drawn.values.items()}
    course = courses(draws.model, values, rows).nodes
    beside = [course[node] - course[draws.model.form.measured_node] for node in nodes]
    apart = np.concatenate(beside, axis=1)
    told = np.all(np.isfinite(apart), axis=1)  # a draw that is too stiff for the steps says nothing
    apart = apart[told] - apart[told].mean(axis=0)
    score = np.sqrt(len(apart)) * np.linalg.eigh(apart @ apart.T)[1][:, -1]
    aside = {}
    for name in names & values.keys():
        v = values[name][told]
        logs = np.log(v) if np.all(v > 0.0) else v / (middle[name] or 1.0)
        along = float(np.mean((logs - logs.mean()) * score))
        aside[name] = math.exp(along) if np.all(v > 0.0) else 1.0 + along
    pair = {n: middle[n] * np.where(np.arange(len(v)) == 0, 1.0, aside.get(n, 1.0))
            for n, v in values.items()}  # fmt: skip
    course = courses(draws.model, pair, rows).nodes
    return aside, {node: course[node][-1] - course[node][0] for node in nodes}


def _at_rest(model: FittedModel, losses: float) -> float:
    """Return the standard deviation of the steady rise over the rise, for losses that are given
    [1]; 0 where the run has none.

    The readings of their own test hold the draws together; at rest these lie farther apart.

    Args:
        model: The network.
        losses: Standard deviation of the losses, which the run's rise has in it, over these [1].
    """
    rest = model.derived.get("steady_rise_K")
    value, sd = (None, None) if rest is None else (known(rest.value), known(rest.sd))
    return math.sqrt(max(0.0, (sd / value) ** 2 - losses**2)) if value and sd else 0.0


def _moved_copper(priors: Mapping[str, Parameter], found: RunAndTest) -> float:
    """Return the heat that an error of the current moves between nodes, over the mean loss [1]."""
    current, motor, test = priors.get("current_gain"), found.motor, found.blocks
    resistance = found.values.get("Rs0", motor.phase_resistance_ohm)
    if current is None or current.fixed is not None or resistance is None:
        return 0.0
    B, reference = motor.resistance_coefficient_degC, motor.reference_temperature_degC
    warm = (B + float(np.nanmean(found.record["winding_degC"]))) / (B + reference)
    copper = motor.phases * resistance * warm * float(np.mean(test.means["current_squared"]))
    return 2.0 * current.sd * copper / max(float(np.mean(np.abs(test.means["losses"]))), 1e-3)


def of_losses(errors: Mapping[str, float], test: Blocks) -> tuple[float, float]:
    """Return what errors of instruments make of the losses, in two parts, RMS over the test.

    Args:
        errors: Size by name, one of `POWER` [their units].
        test: The test.

    Returns:
        The part that goes with the losses, over these [1]; and the rest, over their mean [1].
    """
    losses = test.means["losses"]
    square, mean = max(float(losses @ losses), 1e-6), max(float(np.mean(np.abs(losses))), 1e-3)
    beside = {"power_gain": "losses", "shaft_power_gain": "shaft_power", "torque_offset": "speed"}
    share = rest = 0.0
    for name, size in errors.items():
        signal = beside.get(name.removeprefix("own_"))
        moved = size * (
            np.ones_like(losses) if signal is None else test.means.get(signal, 0.0 * losses)
        )
        along = float(moved @ losses) / square
        share = math.hypot(share, along)
        rest = math.hypot(rest, float(np.sqrt(np.mean((moved - along * losses) ** 2))) / mean)
    return share, rest


def _spread(
    predicted: Prediction,
    moved: Mapping[str, Float[np.ndarray, " block"]],
    sink: float,
    bias: float,
) -> tuple[float, float]:
    """Return the standard deviation of a temperature from the parameters, in two parts.

    Args:
        predicted: What the run predicts of its test.
        moved: What of it has a direction of its own, for each node [K].
        sink: Mean temperature of the sink [degC].
        bias: RMS by which a simpler network is elsewhere [K].

    Returns:
        That which there is without a rise [K], and that of a rise over the rise [1].
    """
    squares, variances = [], []
    for node, own in moved.items():
        lower, upper = predicted.nodes_95[node]
        squares.append((predicted.nodes[node] - sink) ** 2)
        variances.append(np.maximum(((upper - lower) / (2 * 1.96)) ** 2 - own**2, 0.0))
    square = np.concatenate(squares)
    both = np.column_stack([np.ones(square.size), square])
    (at_rest, by_rise), _ = nnls(both, np.concatenate(variances))
    half = 0.5 * bias**2  # nothing says whether it goes with the rise
    by_rise += half / max(float(np.mean(square)), 1.0)
    return math.sqrt(at_rest + half), math.sqrt(by_rise)


def _least_known(fitted: FittedModel, model: Model) -> float:
    """Return the largest relative standard deviation of what shapes a change: capacities,
    resistances and the lag of a sensor [1].
    """
    names = {each.name for each in model.form.parameters} | {"sensor_lag.tau"}
    return max((each.sd / abs(each.value) for name, each in fitted.parameters.items()
                if name in names and each.value), default=0.0)  # fmt: skip
