"""How well the tests determine each parameter, what blocks it, what a longer test gives.

Behind it stands what the reduction of a record to steps costs, in kelvin of the simulated winding.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..fit.fit_result import Fit
from ..model.discrepancy import with_heat
from ..model.parameters import Parameter
from ..model.problem import Problem, information, predict_batch
from ..record.blocks import Blocks, Body
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.reduction import reduce
from ..record.samples import SLOW_LOGGER_S, is_loaded
from .posterior import Posterior

Verdict = Literal["identified", "weak", "not identifiable", "fixed"]

GRADES: tuple[Verdict, ...] = ("fixed", "identified", "weak", "not identifiable")
"""The verdicts, the best first."""

IDENTIFIED = 0.05
"""Relative standard uncertainty up to which a parameter counts as identified [1]."""

WEAK = 0.25
"""Relative standard uncertainty up to which it counts as weak [1]; a factor of 1.6 at 95 %."""

PRIOR_SPEAKS = 0.7
"""Posterior over prior standard deviation from which on the tests do not inform it [1]."""

UNINFORMED = "not informed by the data (posterior = prior)."
LONGER = "Extending the last load to 2 h would give"

LONGER_S = 7200.0
"""Length that a test is imagined to be extended to [s]: two hours of the bench."""


LAST_LOAD_S = 600.0
"""The load that is imagined to go on is the mean over so long [s]."""


@dataclass(frozen=True)
class Statement:
    """What is said of one parameter."""

    verdict: Verdict  # In a word.
    why: str  # What blocks it, or what it rests on; a sentence.


def state(
    posterior: Posterior,
    parameter: Parameter,
    relative_sd: float,
    longer: Callable[[], Mapping[str, float]],
) -> Statement:
    """Judge one parameter of the network or the resistance.

    Args:
        posterior: Draws.
        parameter: Which one; a shared one.
        relative_sd: Its standard uncertainty over its value [1].
        longer: Expected relative sd by name after a test of two hours, from `forecast`; asked for
            where the tests do not identify the parameter.
    """
    if parameter.fixed is not None:
        return Statement(
            "fixed",
            f"fixed in the motor or the network file at {parameter.fixed:g} {parameter.unit}",
        )
    position = posterior.fit.problem.parameters.index(parameter.name)
    contraction = float(np.std(posterior.flat[:, position]))
    if parameter.role == "resistance":
        if contraction > PRIOR_SPEAKS:
            return Statement("not identifiable", UNINFORMED)
        return Statement(
            "identified" if relative_sd <= IDENTIFIED else "weak", "informed by the tests."
        )
    if contraction <= PRIOR_SPEAKS and relative_sd <= IDENTIFIED:
        return Statement(
            "identified", f"the longest test spans {_spans(posterior):.1f} slow time constants."
        )
    gain = longer().get(parameter.name)
    hint = "" if gain is None else f" {LONGER} ±{200 * gain:.1f} % (95 %)."
    if contraction > PRIOR_SPEAKS:
        return Statement("not identifiable", f"{UNINFORMED}{hint}")
    verdict: Verdict = "weak" if relative_sd <= WEAK else "not identifiable"
    return Statement(verdict, f"{_blocking(posterior, parameter, relative_sd)}{hint}")


def by_uncertainty(relative_sd: float) -> Verdict:
    """Judge what the tests inform by its standard uncertainty over its value [1]."""
    if relative_sd <= IDENTIFIED:
        return "identified"
    return "weak" if relative_sd <= WEAK else "not identifiable"


def forecast(fit: Fit) -> dict[str, float]:
    """Return the relative sd of each network parameter [1] if the longest test ran two hours.

    The last load is imagined to go on at the mean of its last ten minutes, though a cool-down came
    behind it, and the linear
    covariance at the fit is taken with the noise as it is. Empty where a test is that long, or
    has no load.
    """
    problem = fit.problem
    longest = int(np.argmax([test.duration_s for test in problem.tests]))
    test = problem.tests[longest]
    if problem.model.change_sd:  # no length of one test tells what the next one will be
        return {}
    if test.duration_s >= LONGER_S or fit.result.name == "no_start":
        return {}
    if not _loaded(test).size:
        return {}
    tests = list(problem.tests)
    longer = extended(test.winding, LONGER_S)
    tests[longest] = longer.with_bodies(test.fitted)
    imagined = with_heat(replace(problem, tests=tuple(tests)), fit.z)
    precision = information(imagined.structure, imagined.data, fit.z, fit.noise)
    sd = np.sqrt(np.diag(np.linalg.inv(np.asarray(precision))))
    return {
        slot.name: float(sd[position] * slot.parameter.sd)
        for position, slot in enumerate(problem.parameters.slots)
        if slot.parameter.role == "network"
    }


def extended(test: Blocks, duration_s: float) -> Blocks:
    """Return a test that goes on with its last load, its readings to come as frequent as before.

    Args:
        test: The reduced test.
        duration_s: Its length then [s].
    """
    per_block = test.weight.shape[1]
    num_more = int(np.ceil((duration_s - test.duration_s) / test.block_s))
    tail = _last_load(test)

    def extend(values: np.ndarray) -> np.ndarray:
        if values.ndim != 1:
            return values
        return np.concatenate([values, np.full(num_more * per_block, np.mean(values[tail]))])

    later = test.time[-1] + test.block_s * np.arange(1, num_more + 1)

    def readings(part: Blocks | Body) -> dict[str, np.ndarray]:
        full = np.nanmax(part.count)
        return {
            "measured": np.concatenate([part.measured, np.zeros(num_more)]),
            "weight": np.concatenate(
                [part.weight, np.full((num_more, per_block), 1.0 / per_block)]
            ),
            "position": np.concatenate([part.position, np.full((num_more, per_block), 0.5)]),
            "count": np.concatenate([part.count, np.full(num_more, full)]),
            "time": np.concatenate([part.time, later]),
        }

    bodies = tuple(replace(body, **readings(body)) for body in test.bodies)
    known, columns = test.load_variance, test.load_columns
    return replace(
        test,
        means={name: extend(values) for name, values in test.means.items()},
        **readings(test),
        bodies=bodies,
        load_variance=None if known is None else np.pad(known, (0, num_more)),
        load_columns=None if columns is None else np.pad(columns, ((0, num_more), (0, 0))),
    )


def _last_load(test: Blocks) -> np.ndarray:
    """Return the steps of the last ten minutes under load; of a test without any, its last ones."""
    num_steps = max(1, int(LAST_LOAD_S / float(test.means["step"])))
    loaded = _loaded(test)
    return (loaded if loaded.size else np.arange(test.means["losses"].size))[-num_steps:]


def _loaded(test: Blocks) -> np.ndarray:
    heats = [test.means["losses"], test.means["current_squared"]]
    return np.flatnonzero(np.logical_or(*(is_loaded(heat) for heat in heats)))


def slow_time_constant(posterior: Posterior) -> float:
    """Return the slow time constant R C of the body that is tied to the sink [s]."""
    values = {name: float(np.median(v)) for name, v in posterior.values().items()}
    for parameters in posterior.fit.problem.parameters.by_test:
        for name, parameter in parameters.items():
            if parameter.fixed is not None:
                values.setdefault(name, parameter.fixed)
    capacitance, resistance = posterior.fit.problem.model.form.body
    return values[capacitance] * values[resistance]


def _blocking(posterior: Posterior, parameter: Parameter, relative_sd: float) -> str:
    spans = _spans(posterior)
    if parameter.name in posterior.fit.problem.model.form.body and spans < 2.5:
        return f"the longest test spans only {spans:.1f} slow time constants."
    change_sd = posterior.fit.problem.model.change_sd
    if change_sd > 0.5 * relative_sd:
        return f"the tests differ in it by some {100.0 * change_sd:.0f} %."
    rival = _partner(posterior, parameter)
    if rival is not None:
        return f"hardly distinguishable from {rival}."
    return "its effect is small against noise and model error."


def _spans(posterior: Posterior) -> float:
    longest = max(test.duration_s for test in posterior.fit.problem.tests)
    return longest / slow_time_constant(posterior)


def _partner(posterior: Posterior, parameter: Parameter) -> str | None:
    """Return the parameter that it is most correlated with, if at all (|r| > 0.8)."""
    slots = posterior.fit.problem.parameters.slots
    position = posterior.fit.problem.parameters.index(parameter.name)
    correlation = np.corrcoef(posterior.flat[:, : len(slots)].T)[position]
    correlation[position] = 0.0
    best = int(np.argmax(np.abs(correlation)))
    if abs(correlation[best]) < 0.8:
        return None
    return f"{slots[best].name} (correlation {correlation[best]:+.2f})"


COARSE_K = 0.05
"""Error of the reduction to steps from which on it is worth a warning [K]."""

BETWEEN_K = 0.25
"""The same for what the load does between its samples [K]. Drive cycles of the study's tuning seed,
point-sampled at 1 Hz, come to 0.5...0.8 K, its staircases and duties to 0.2 K at most."""

LOADS = ("phase_current_A", "losses_W", "speed_rpm")
"""Channels that may change faster than the sampling."""


def check_reduction(
    found: Fit, record: Record, blocks: Blocks, motor: Motor
) -> tuple[float, tuple[Finding, ...]]:
    """Return the error of the reduction to steps [K], and what is to be said about it.

    Two things are lost in it: what the load does within a step, and what it did between two
    samples. Each is measured by simulating the fit once more on other means of the same record.
    """
    error = reduction_error(found, record, blocks, motor)
    findings = [_coarse(blocks, error)] if error > COARSE_K else []
    between = between_samples(found, record, blocks, motor)
    if between > BETWEEN_K:
        findings.append(_lost(record, blocks, between))
    return error, tuple(findings)


def reduction_error(found: Fit, record: Record, blocks: Blocks, motor: Motor) -> float:
    """Return the largest error of a block mean that the reduction to steps causes [K].

    The test is simulated on its steps and on steps of a quarter of the length (no shorter than
    its samples), started alike; arguments as `check_reduction`.
    """
    step = float(blocks.inputs.step)
    shorter = max(step / 4.0, min(blocks.sample_s, step))
    finer = reduce(record, motor, step_s=shorter, block_s=blocks.block_s)
    means = _simulated(found, motor, blocks, [blocks, finer])
    num = min(part.size for part in means)
    seen = blocks.is_observed[:num]
    return float(np.max(np.abs(means[0][:num] - means[1][:num])[seen]))


def between_samples(found: Fit, record: Record, blocks: Blocks, motor: Motor) -> float:
    """Return the error of the block means that a slow logger of the load may cause [K].

    Half the root mean square of what the simulation on every second sample of the load differs
    from that on the others. If the samples are independent of each other, that is the error of
    the simulation on all of them; the smoother the load, the more of an upper limit it is.
    Arguments as `check_reduction`.

    Returns:
        0 for a logger that is fast enough.
    """
    if _period(record) < SLOW_LOGGER_S:
        return 0.0
    halves = [
        replace(blocks, means=reduce(
            _every_second(record, first), motor,
            step_s=float(blocks.means["step"]), block_s=blocks.block_s,
        ).means)
        for first in (0, 1)
    ]  # fmt: skip
    even, odd = _simulated(found, motor, blocks, halves)
    return 0.5 * float(np.sqrt(np.mean((even - odd)[blocks.is_observed] ** 2)))


def _simulated(
    found: Fit, motor: Motor, blocks: Blocks, versions: Sequence[Blocks]
) -> list[np.ndarray]:
    """Return the block means [degC] of versions of a test at the fit, all started as `blocks`."""
    problem = Problem.of(found.problem.model, motor, [blocks])
    names = found.problem.parameters.names
    z = np.zeros(problem.num_parameters)
    for position, slot in enumerate(problem.parameters.slots):
        if slot.name in names:
            z[position] = found.z[names.index(slot.name)]
    means = []
    for version in versions:
        data = replace(problem.data, tests=(version.observation().padded(is_seldom=True),))
        means.append(blocks.own(np.asarray(predict_batch(problem.structure, data, z[None])[0])[0]))
    return means


def _period(record: Record) -> float:
    """Return the median time between two samples of the fastest channel of the load [s]."""
    periods = [
        float(np.median(np.diff(record.time_s[np.isfinite(record[name])])))
        for name in LOADS
        if name in record and np.sum(np.isfinite(record[name])) > 1
    ]
    return min(periods)


def _every_second(record: Record, first: int) -> Record:
    """Return the record with every second sample of the load from `first` on, and its ends."""
    channels = dict(record.channels)
    for name in LOADS:
        if name in channels:
            there = np.flatnonzero(np.isfinite(channels[name]))
            dropped = there[1 - first :: 2]
            channels[name] = channels[name].copy()
            channels[name][np.setdiff1d(dropped, there[[0, -1]])] = np.nan
    return replace(record, channels=channels)


def _coarse(blocks: Blocks, error: float) -> Finding:
    return Finding(
        id="reduction",
        severity="warning",
        message=f"averaging the record over steps of {float(blocks.inputs.step):g} s changes the "
        f"simulated winding temperature by up to {error:.2g} K (limit {COARSE_K} K): the "
        "parameters may be biased.",
        where=blocks.name,
        remedy="The winding responds faster than the steps resolve: record at a shorter interval.",
        test=blocks.name,
        values={"reduction_error_K": error},
    )


def _lost(record: Record, blocks: Blocks, error: float) -> Finding:
    period = _period(record)
    return Finding(
        id="between_samples",
        severity="warning",
        message=f"the load changes faster than it is sampled, every {period:.3g} s (aliasing): the "
        f"simulated winding temperature may be wrong by {error:.2g} K (limit {BETWEEN_K} K). The "
        "95 % intervals allow for it, bands of predicted tests do not.",
        where=blocks.name,
        remedy="Record the load at a shorter interval, or as means over the logger's period; if "
        "the values are such means, nothing is lost.",
        test=blocks.name,
        values={"between_samples_K": error, "period_s": period},
    )
