"""The cells of the coverage study: what is drawn, what the fit is told, one row per record."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from bench_package import bench
from coverage_bench import (
    HELD_OUT,
    KINDS,
    PERIOD_S,
    READING_S,
    Errors,
    HiddenHeat,
    SensorNoise,
    Simulated,
    nearest_duration,
    run_test,
    time_constants,
)

import heatrun.runtime  # noqa: F401  (settings of JAX before its first use)

# isort: split

from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.model import Model
from heatrun.model.noise import LARGEST_SCORES, NOISE
from heatrun.model.problem import Problem
from heatrun.posterior.identifiability import between_samples
from heatrun.posterior.posterior import Posterior, sample, weighted_draws
from heatrun.posterior.predict import predict
from heatrun.record.blocks import Blocks
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
TIMES = ("tau_winding", "tau_stator", "tau_fast", "tau_slow")

USUAL = {"current_gain": 0.005, "power_gain": 0.01, "sensor_gain": 0.005, "sensor_offset": 0.5,
         "ambient_offset": 0.5, "Rs0": 0.01}  # fmt: skip
"""Standard deviations of the type B errors as heatrun's own priors state them."""

LARGE = USUAL | {"power_gain": 0.02, "sensor_offset": 1.0, "Rs0": 0.03}
"""Those of a poor bench, which a motor file can declare."""

NONE = dict.fromkeys(USUAL, 0.0)

AS_EXACT = {name: ParameterOverride(fixed=0.0) for name in USUAL if name != "Rs0"}

SBC_SD = 0.3
"""Relative prior sd of the network in the simulation-based calibration, stated in the motor
file; heatrun's own priors span kilowatts to hundreds of kilowatts, and most of their draws burn."""

NUM_STARTS = 4
"""Starts of a fit; the 16 of the command find the same optimum and cost four times as much."""

NUM_NORMAL = 4000
"""Draws from the normal of the covariance."""


@dataclass(frozen=True)
class Cell:
    # Standard deviations of the type B errors drawn.
    errors: Mapping[str, float] = field(default_factory=lambda: NONE)
    # What the motor file says of parameters.
    overrides: Mapping[str, ParameterOverride] = field(default_factory=lambda: AS_EXACT)
    knows_resistance: bool = True  # Rs0 is held at what is stated.
    slower: float = 1.0  # Factor on the correlation time of the noise [1].
    stronger: float = 1.0  # Factor on its level [1].
    grows: float = 1.0  # Factor on its level in the second half of each test [1].
    is_heavy: bool = False  # Student t noise.
    truncates: bool = False  # The logger cuts off.
    from_prior: bool = False  # Network and noise are drawn from the priors of the fit.
    period_s: float = PERIOD_S  # Sampling period of the electrical channels [s].
    prior_test_s: float = 3600.0  # Length of the tests of motors drawn from the prior [s].
    # Standard deviation of stator over winding at the start of each test [K].
    start_sd_K: float = 0.0


_DECLARED = {
    "power_gain": ParameterOverride(sd=LARGE["power_gain"]),
    "sensor_offset": ParameterOverride(sd=LARGE["sensor_offset"]),
    "Rs0": ParameterOverride(relative_sd=float(np.expm1(LARGE["Rs0"]))),
}

CELLS: dict[str, Cell] = {
    "as declared": Cell(USUAL, {}, knows_resistance=False),
    "exact instruments": Cell(),
    "slower noise": Cell(slower=4.0),
    "stronger noise": Cell(stronger=2.0),
    "noise that doubles": Cell(grows=2.0),
    "heavy tails": Cell(is_heavy=True),
    "truncated": Cell(USUAL, {}, knows_resistance=False, truncates=True),
    "large errors, declared": Cell(LARGE, _DECLARED, knows_resistance=False),
    "large errors, not declared": Cell(LARGE, {}, knows_resistance=False),
    "errors taken as none": Cell(USUAL),
    "point samples at 1 Hz": Cell(period_s=1.0),
    "unevenly soaked": Cell(start_sd_K=1.0),
    "prior draws": Cell(USUAL, {}, knows_resistance=False, from_prior=True),
}
"""Cells by name. Record i of every cell has the same motor, tests, scores of errors and shocks."""


@dataclass(frozen=True)
class Case:
    motor: Motor
    machine: Any
    noise: SensorNoise
    errors: Errors
    kind: str
    duration_s: float
    calibration: Simulated
    held_out: Simulated
    heat: HiddenHeat | None = None


def make_case(cell: Cell, seed: int, index: int) -> Case:
    of_motor, of_plan, of_errors, of_test, of_held_out = np.random.default_rng([seed, index]).spawn(
        5
    )
    errors = Errors.drawn(of_errors.standard_normal(len(USUAL)), cell.errors)
    heat = None
    overrides = dict(cell.overrides)
    plan = of_plan.uniform(size=6)
    kind = KINDS[index % len(KINDS)]
    if cell.from_prior:
        machine, priors = _machine_from_prior(of_motor)
        overrides |= priors
        noise, heat = _noise_from_prior(of_plan)
        duration = cell.prior_test_s
    else:
        machine = bench().random_motor(of_motor)
        noise = SensorNoise(
            sd_K=cell.stronger * 0.1 * 5.0 ** plan[0],
            time_s=cell.slower * 5.0 * 24.0 ** plan[1],
            white_sd_K=cell.stronger * 0.05 * 4.0 ** plan[2],
            resolution_K=1.0 if plan[3] < 0.5 else 0.1,
            truncates=cell.truncates,
            is_heavy=cell.is_heavy,
            grows=cell.grows,
        )
        duration = nearest_duration(machine, 1.0 + 2.0 * plan[4])
    if cell.knows_resistance:
        overrides["Rs0"] = ParameterOverride(fixed=_stated(machine, errors))
    motor = Motor(
        "study",
        phase_resistance_ohm=_stated(machine, errors),
        rated_speed_rpm=machine.rated_speed_rpm,
        parameters=overrides,
    )
    starts = cell.start_sd_K * of_errors.standard_normal(2)
    tests = [
        run_test(machine, name, length, errors, noise, rng, cell.period_s, start, heat)
        for name, length, rng, start in (
            (kind, duration, of_test, float(starts[0])),
            (HELD_OUT[kind], 2.0 * duration, of_held_out, float(starts[1])),
        )
    ]
    return Case(motor, machine, noise, errors, kind, duration, *tests, heat)


def _stated(machine: Any, errors: Errors) -> float:
    return machine.phase_resistance_ohm * float(np.exp(-errors.Rs0))


def _machine_from_prior(rng: np.random.Generator) -> tuple[Any, dict[str, ParameterOverride]]:
    machine = bench().reference_motor()
    sd = np.log1p(SBC_SD)
    priors = {
        name: ParameterOverride(value=getattr(machine, name), relative_sd=SBC_SD)
        for name in NETWORK
    }
    drawn = {
        name: getattr(machine, name) * float(np.exp(sd * z))
        for name, z in zip(NETWORK, rng.standard_normal(4), strict=True)
    }
    return replace(machine, **drawn), priors


def _noise_from_prior(rng: np.random.Generator) -> tuple[SensorNoise, HiddenHeat]:
    while True:
        scores = rng.standard_normal(len(NOISE))
        if np.all(scores <= LARGEST_SCORES):
            break
    sd, time_s, white, share = (
        p.centre * float(np.exp(p.sd * z)) for p, z in zip(NOISE, scores, strict=True)
    )
    # the prior is of a 20 s mean
    return SensorNoise(sd, time_s, white * float(np.sqrt(20.0))), HiddenHeat(share)


def run(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run one record and return its row."""
    cell = CELLS[job["cell"]]
    case = make_case(cell, job["seed"], job["index"])
    begin, cpu = time.perf_counter(), time.process_time()
    records = [
        Record("calibration", case.calibration.channels),
        Record("held out", case.held_out.channels),
    ]
    blocks = reduce(records[0], case.motor)
    held_out = reduce(records[1], case.motor, block_s=30.0)
    problem = Problem.of(Model.of("second", case.motor), case.motor, [blocks])
    found = fit(problem, num_starts=NUM_STARTS)
    true = truth(case)
    row: dict[str, Any] = {
        **{name: job[name] for name in ("cell", "index")},
        **_described(case, found),
        "between_K": [
            between_samples(found, record, test, case.motor)
            for record, test in zip(records, (blocks, held_out), strict=True)
        ],
        "bound": bound(found.problem, true, case.noise, case.calibration.start_degC),
    }
    row["laplace"] = {"ranks": ranks(of_covariance(found), true), "sd": _sd_of(found)}
    quick = weighted_draws(found)
    row["quick"] = _judged(quick, held_out, case, true)
    row["quick"]["is_sound"] = quick.is_sound
    row["quick"]["pareto_k"] = quick.weighted.pareto_k
    row["quick"]["ess"] = quick.weighted.effective_size
    if job["emcee"]:
        long = sample(found, method="emcee")
        row["emcee"] = _judged(long, held_out, case, true)
        row["emcee"]["is_sound"] = bool(long.is_sound)
    row["seconds"] = time.perf_counter() - begin
    row["cpu_s"] = time.process_time() - cpu
    return row


def truth(case: Case) -> dict[str, float]:
    """Return the true value of everything that is estimated, by parameter name."""
    network = {name: float(getattr(case.machine, name)) for name in NETWORK}
    errors = {name: getattr(case.errors, name) for name in USUAL}
    return {
        **network,
        **{name: float(tau) for name, tau in time_constants(network).items()},
        **errors,
        "Rs0": case.machine.phase_resistance_ohm,
        "noise_sd": case.noise.sd_K,
        "noise_time": case.noise.time_s,
        "noise_white": case.noise.white_sd_K / float(np.sqrt(20.0)),
        "unmodelled_heat": 0.0 if case.heat is None else case.heat.share,
    }


def ranks(draws: Mapping[str, np.ndarray], true: Mapping[str, float]) -> dict[str, float]:
    """Return the share of the posterior below the truth, by quantity [1]."""
    return {
        name: float((np.sum(values < true[name]) + 0.5) / (values.size + 1))
        for name, values in draws.items()
        if name in true
    }


def _described(case: Case, found: Fit) -> dict[str, Any]:
    return {
        "kind": case.kind,
        "duration_s": case.duration_s,
        "fitted": {name: found.values()[name] for name in NETWORK},
        "noise": [float(found.noise.sd), float(found.noise.time), float(found.noise.white)],
        "unmodelled_heat": float(found.noise.heat),
        "findings": [finding.id for finding in found.findings],
    }


def of_covariance(found: Fit) -> dict[str, np.ndarray]:
    """Return draws from the normal that the covariance stands for, in physical units."""
    size = found.problem.num_parameters
    rng = np.random.default_rng(0)
    z = rng.multivariate_normal(found.z, found.covariance[:size, :size], size=NUM_NORMAL)
    return _with_times(found.problem.parameters.physical(z))


def _with_times(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    flat = {name: np.ravel(v) for name, v in values.items()}
    return flat | time_constants(flat)


def _sd_of(found: Fit) -> dict[str, float]:
    names = found.problem.parameters.names
    sd = np.sqrt(np.diag(found.covariance))
    return {
        name: float(sd[names.index(name)] * found.slots[names.index(name)].parameter.sd)
        for name in NETWORK
    }


def _judged(
    posterior: Posterior, held_out: Blocks, case: Case, true: Mapping[str, float]
) -> dict[str, Any]:
    draws = _with_times(posterior.values())
    size = posterior.fit.problem.num_parameters
    for position, parameter in enumerate(NOISE):
        scores = posterior.flat[:, size + position]
        draws[parameter.name] = parameter.centre * np.exp(parameter.sd * scores)
    prediction = predict(posterior, held_out)
    share = held_out.count[-1]
    end = float(np.mean(case.held_out.sensor_degC[-int(share) :]))
    last = prediction.draws[:, -1]
    low, high = prediction.total["50"]
    return {
        "ranks": ranks(draws, true) | ranks({"end": last}, {"end": end}),
        "sd": {name: float(np.std(np.log(draws[name]))) for name in (*NETWORK, *TIMES)},
        "end_sd_K": float(np.std(last)),
        "share_95": prediction.coverage_95(),
        "share_50": float(np.mean((held_out.measured >= low) & (held_out.measured <= high))),
    }


def bound(
    problem: Problem, true: Mapping[str, float], noise: SensorNoise, start_degC: tuple[float, float]
) -> dict[str, float]:
    """Return the smallest standard deviation of the logarithm of each network parameter [1].

    Reference: H. L. Van Trees, Detection, Estimation, and Modulation Theory, part I, section 2.4
        (the bound with prior information).
    """
    starts = dict(zip(("Tw_start", "Tsr_start"), start_degC, strict=True))
    slots = problem.parameters.slots
    known = {**true, **starts}
    z = np.array(
        [float(slot.parameter.score(known.get(slot.parameter.name, 0.0))) for slot in slots]
    )
    _, jacobian = problem.linearised(z)
    factor = np.linalg.cholesky(covariance(problem.tests[0], noise))
    columns = np.linalg.solve(factor, jacobian[problem.is_observed])
    spread = np.linalg.inv(columns.T @ columns + np.eye(z.size))
    names = problem.parameters.names
    return {
        name: float(np.sqrt(spread[at, at]) * slots[at].parameter.sd)
        for name in NETWORK
        for at in [names.index(name)]
    }


def covariance(test: Blocks, noise: SensorNoise) -> np.ndarray:
    """Return the exact covariance of the observed block means [K^2], shape (block, block).

    The mean of an Ornstein-Uhlenbeck process over a block is correlated with that over another by
    the decay between their samples, summed over both.
    """
    num = round(test.block_s / READING_S)
    keep = float(np.exp(-READING_S / noise.time_s))
    sample = np.arange(num)
    size = int(np.sum(test.is_observed))
    within = float(np.mean(keep ** np.abs(sample[:, None] - sample)))
    lag = np.abs(np.arange(size)[:, None] - np.arange(size))
    between = float(np.mean(keep ** sample[::-1])) * float(np.mean(keep ** (sample + 1)))
    correlation = np.where(lag == 0, within, between * keep ** (num * np.maximum(lag - 1, 0)))
    white = noise.white_sd_K**2 / READING_S + noise.resolution_K**2 / 12.0
    level = np.where(test.time[test.is_observed] > 0.5 * test.duration_s, noise.grows, 1.0)
    drift = noise.sd_K**2 * correlation + white / num * np.eye(size)
    return level[:, None] * drift * level
