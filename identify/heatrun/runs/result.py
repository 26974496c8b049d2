"""The result of a calibration: what stands in `fit.json`."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, replace
from functools import cache
from typing import TypeVar

import numpy as np
from msgspec import UNSET, UnsetType

from lptn.effects import AbstractEffect

from ..fit.fit_result import Fit
from ..model.noise import noise_parameters
from ..model.parameters import Parameter, Slot, qualified
from ..posterior.comparison import body_rows, compare, residual_row, verdict
from ..posterior.identifiability import GRADES, by_uncertainty, forecast, state
from ..posterior.posterior import Posterior
from ..posterior.predict import Prediction, score_difference
from ..posterior.weighted import evaluate
from ..readers.mapping import describe_mapping
from ..record.blocks import Blocks
from ..record.findings import Attempts
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import is_loaded, samples, with_all_heat
from ..results.model import (
    FIT_FORMAT,
    BodyRow,
    Correlation,
    DescribedTest,
    EffectInModel,
    Evidence,
    FitResult,
    FittedModel,
    FittedMotor,
    FittedNoise,
    FittedParameter,
    Identifiability,
    LoggerNoise,
    MaybeMissing,
    PosteriorQuality,
    TestedLoad,
    WindingAtEnd,
)
from ..results.values import Interval, Role, known
from ..version import __version__
from .equilibrium import SteadyRise, Stretch, equilibria
from .figures_of_draws import Budget, DrawValues, budget_of, more_of, over_sets
from .machine import steady_of_network, tested
from .ratings_figures import derive
from .replica import replica

T = TypeVar("T")

IN_MAIN_TABLE = ("network", "resistance", "effect", "known")
"""Roles of the parameters that a user asks for; the others are nuisances."""


def describe_test(
    record: Record, blocks: Blocks, motor: Motor, role: Role, reduction_error_K: float
) -> DescribedTest:
    """Return what is said of a test."""
    source = record.sources[0] if record.sources else None

    def span(channel: str) -> Interval | None:
        if channel not in record or not np.any(np.isfinite(record[channel])):
            return None
        return float(np.nanmin(record[channel])), float(np.nanmax(record[channel]))

    return DescribedTest(
        name=record.name,
        role=role,
        path="" if source is None else source.path,
        sha256="" if source is None else source.sha256,
        reader="" if source is None else source.reader,
        stretch=record.stretch or UNSET,
        notes=(*record.notes, *blocks.notes),
        mapping=tuple(describe_mapping(record)),
        duration_s=record.duration_s,
        num_samples=int(record.time_s.size),
        sample_s=blocks.sample_s,
        step_s=float(blocks.inputs.step),
        block_s=blocks.block_s,
        rounding_K=blocks.rounding_K,
        start_degC=blocks.start_degC,
        current_A=span("phase_current_A"),
        losses_W=span("losses_W"),
        speed_rpm=span("speed_rpm"),
        winding_degC=span("winding_degC"),
        sink_degC=span(f"{motor.sink}_degC"),
        reduction_error_K=reduction_error_K,
        start=record.start or UNSET,
        equilibrium=_at_end(record, motor),
    )


def _at_end(record: Record, motor: Motor) -> WindingAtEnd | UnsetType:
    """Return whether the winding had settled under the last load that was held long enough; unset
    where none was.
    """
    needed = ("winding_degC", f"{motor.sink}_degC", "losses_W")
    if any(channel not in record for channel in needed):
        return UNSET
    time_s, losses = samples(with_all_heat(record, motor), "losses_W")
    heated_s = time_s[is_loaded(losses)]
    last = next(
        (
            one
            for one in reversed(equilibria(record, motor, "winding_degC"))
            if one.is_held and one.stretch is not None and one.stretch.holds(heated_s)
        ),
        None,
    )
    if last is None or last.stretch is None or not last.gradients_K_per_h:
        return UNSET
    more = last.steady if isinstance(last.steady, SteadyRise) else None
    return WindingAtEnd(
        is_reached=last.is_reached,
        gradient_K_per_h=last.gradients_K_per_h[-1],
        gradient_se_K_per_h=last.errors_K_per_h[-1],
        from_s=last.stretch.from_s,
        to_s=last.stretch.to_s,
        continued_K=None if more is None else more.rise_K,
        continued_95_K=None if more is None else more.rise_95_K,
        criterion=motor.equilibrium,
    )


def with_network_rise(test: DescribedTest, prediction: Prediction) -> DescribedTest:
    """Return a test that ended before equilibrium with where the network comes to rest."""
    at = known(test.equilibrium)
    if at is None or at.is_reached is True:
        return test
    rest = steady_of_network(prediction, Stretch(at.from_s, at.to_s))
    if rest is None:
        return test
    middle, low, high = rest.rise_K
    return replace(test, equilibrium=replace(at, network_K=middle, network_95_K=(low, high)))


def describe_effect(kind: type[AbstractEffect]) -> EffectInModel:
    """Return what is said of an effect in a model; its parameters stand with the others."""
    card = kind.card
    names = tuple(qualified(kind, name) for name in card.parameters)
    return EffectInModel(id=card.id, law=card.law, parameters=names)


def describe_model(
    posterior: Posterior,
    predictions: Sequence[Prediction],
    roles: Sequence[Role],
    duties: Sequence[str] = (),
    attempts: Attempts | None = None,
    undecided: DrawValues | None = None,
) -> FittedModel:
    """Return the entry of one network.

    Args:
        posterior: Its draws.
        predictions: One per test.
        roles: Likewise.
        duties: As `heatrun.runs.ratings_figures.derive`.
        attempts: Told which part failed and is left out; None to let the error through.
        undecided: Networks that the tests do not tell apart; None where they tell one.
    """
    fit = posterior.fit
    model = fit.problem.model

    def part(step: str, do: Callable[[], T], otherwise: T) -> T:
        return do() if attempts is None else attempts.of(step, do, otherwise, where=model.title)

    @cache
    def longer() -> dict[str, float]:
        return part("the forecast of a longer test", lambda: forecast(fit), {})

    budget = part("the uncertainty budget", lambda: budget_of(posterior), None)
    main, nuisances = _parameters(posterior, longer)
    others = {} if undecided is None else undecided.values
    for slot in fit.slots:
        if slot.parameter.role == "network":  # not of an effect, which is not in all of them
            main[slot.name] = _widened(main[slot.name], others.get(slot.name))
    if budget is not None:
        main = part("the uncertainty budget", lambda: _with_budgets(main, posterior, budget), main)
    of_noise = noise_parameters(model.adequacy)
    return FittedModel(
        title=model.title,
        nodes=tuple(model.form.nodes),
        sinks=model.form.sinks if model.form.second_sink else UNSET,
        effects=tuple(describe_effect(kind) for kind in model.effects),
        result=fit.result.name,
        message=fit.result.value,
        stats=dict(fit.stats),
        num_modes=len(fit.modes),
        parameters=main,
        nuisances=nuisances,
        correlation=_correlation(posterior),
        noise=FittedNoise(
            sd_K=float(fit.noise.sd),
            time_s=float(fit.noise.time),
            white_K=float(fit.noise.white),
            unmodelled_heat=float(of_noise[-1].value(fit.noise_z[-1])),
            loggers=_loggers(fit),
            prior={p.name: p.prior_interval_95() for p in of_noise},
        ),
        residuals=tuple(
            residual_row(prediction, role)
            for prediction, role in zip(predictions, roles, strict=True)
            if prediction.is_there
        ),
        bodies=_bodies(predictions, roles),
        posterior=_quality(posterior),
        derived=part("the ratings", lambda: derive(posterior, duties, budget, undecided), {}),
        evidence=part("the evidence", lambda: _evidence(posterior), _no_evidence(fit)),
        maybe_missing=_maybe_missing(posterior),
        replica=part(
            "the replica",
            lambda: replica(fit.problem.model, fit.problem.parameters.by_test[0], predictions),
            None,
        )
        or UNSET,
        load=part("the load of the tests", lambda: _load(fit), UNSET),
    )


def _load(fit: Fit) -> TestedLoad | UnsetType:
    """Return the loaded part of the tests; unset where it has no reading."""
    load = tested([test.winding for test in fit.problem.tests]).load
    numbers = [each for each in astuple(load) if each is not None]
    return load if all(map(math.isfinite, numbers)) else UNSET


def _bodies(
    predictions: Sequence[Prediction], roles: Sequence[Role]
) -> tuple[BodyRow, ...] | UnsetType:
    """Return the errors of measured bodies; unset where none was measured."""
    found = [body_rows(p, role) for p, role in zip(predictions, roles, strict=True)]
    return tuple(row for rows in found for row in rows) or UNSET


def _loggers(fit: Fit) -> tuple[LoggerNoise, ...] | UnsetType:
    """Return the noise of each logger, the first first; unset where there is but one."""
    rows = tuple(
        LoggerNoise(
            **logger._asdict(),
            scale=scale,
            tests=tuple(test.name for test in fit.problem.tests if logger in test.loggers),
        )
        for logger, scale in fit.problem.loggers.items()
    )
    return rows or UNSET


def assemble(
    motor: Motor,
    tests: Sequence[DescribedTest],
    findings: Sequence[Finding],
    models: dict[str, FittedModel],
    predictions: Mapping[str, Sequence[Prediction]],
    *,
    command: str,
    seed: int,
) -> FitResult:
    """Return the whole of `fit.json`."""
    roles: list[Role] = [test.role for test in tests]
    pair = tuple(models) if len(models) == 2 else None
    attempts = Attempts()
    scores = comparison = None
    if pair is not None:
        one, other = (predictions[name] for name in pair)
        scores = attempts.of(
            "the difference of the scores", lambda: score_difference(one, other, roles), None
        )
        comparison = attempts.of(
            "the comparison of the networks", lambda: compare(one, other, roles), None
        )
    return FitResult(
        format=FIT_FORMAT,
        heatrun_version=__version__,
        command=command,
        seed=seed,
        motor=FittedMotor(
            name=motor.name,
            phases=motor.phases,
            losses=motor.losses,
            sink=motor.sink,
            insulation_class=motor.insulation_class,
            phase_resistance_ohm=motor.phase_resistance_ohm,
            reference_temperature_degC=motor.reference_temperature_degC,
            resistance_coefficient_degC=motor.resistance_coefficient_degC,
            rated_speed_rpm=motor.scales.speed_rpm,
            rated_current_A=motor.scales.current_A,
            path=motor.path,
            sha256=motor.sha256,
        ),
        tests=tuple(tests),
        findings=(*findings, *attempts.findings),
        verdict=verdict(models, scores),
        models=models,
        comparison=comparison,
    )


def _parameters(
    posterior: Posterior, longer: Callable[[], Mapping[str, float]]
) -> tuple[dict[str, FittedParameter], dict[str, FittedParameter]]:
    """Return the parameters that a user asks for and the nuisances, free ones first."""
    fit = posterior.fit
    draws = posterior.values()
    main: dict[str, FittedParameter] = {}
    nuisances: dict[str, FittedParameter] = {}
    for position, slot in enumerate(fit.slots):
        entry = _free(posterior, slot, position, draws[slot.name].ravel(), longer)
        (main if slot.parameter.role in IN_MAIN_TABLE else nuisances)[slot.name] = entry
    for parameter in fit.problem.parameters.by_test[0].values():
        if parameter.fixed is not None:
            entry = _fixed(parameter, parameter.fixed)
            (main if parameter.role in IN_MAIN_TABLE else nuisances)[parameter.name] = entry
    return main, nuisances


def _correlation(posterior: Posterior) -> Correlation:
    draws = posterior.values()
    names = tuple(slot.name for slot in posterior.fit.slots)
    matrix = np.atleast_2d(np.corrcoef(np.stack([draws[name].ravel() for name in names])))
    return Correlation(names=names, matrix=tuple(tuple(row) for row in matrix.tolist()))


def _quality(posterior: Posterior) -> PosteriorQuality:
    ensembles, weighted = posterior.convergence, posterior.weighted
    drawn = weighted if ensembles is None else ensembles
    return PosteriorQuality(
        method=posterior.method,
        draws=int(posterior.flat.shape[0]),
        ess_min=None if drawn is None else drawn.effective_size,
        autocorrelation_max=None if ensembles is None else ensembles.autocorrelation,
        rhat_max=None if ensembles is None else ensembles.rhat,
        pareto_k=None if weighted is None else weighted.pareto_k,
        verdict=posterior.sentence(),
        is_sound=posterior.is_sound,
        ess_tail_min=UNSET if ensembles is None else ensembles.tail_size,
        agreement_p=UNSET if ensembles is None else ensembles.agreement,
    )


def _maybe_missing(posterior: Posterior) -> tuple[MaybeMissing, ...]:
    effects = () if posterior.plausible is None else posterior.plausible.effects
    return tuple(
        MaybeMissing(
            id=each.id,
            test=each.test,
            probability=each.probability,
            with_effect=dict(each.with_effect),
            without=dict(each.without),
        )
        for each in effects
    )


def _evidence(posterior: Posterior) -> Evidence:
    fit = posterior.fit
    size = fit.vector.size
    num_blocks = int(np.sum(fit.problem.is_observed))
    prior = -0.5 * float(np.sum(fit.vector**2)) - 0.5 * size * float(np.log(2 * np.pi))
    log_likelihood = float(evaluate(fit, fit.vector[None])[0]) - prior
    return Evidence(
        log_evidence=fit.log_evidence,
        aic=2.0 * size - 2.0 * log_likelihood,
        bic=size * float(np.log(num_blocks)) - 2.0 * log_likelihood,
        num_parameters=size,
        num_blocks=num_blocks,
    )


def _no_evidence(fit: Fit) -> Evidence:
    """Return what stands where the evidence could not be worked out."""
    return Evidence(
        log_evidence=math.nan,
        aic=math.nan,
        bic=math.nan,
        num_parameters=fit.vector.size,
        num_blocks=int(np.sum(fit.problem.is_observed)),
    )


def _free(
    posterior: Posterior,
    slot: Slot,
    position: int,
    draws: np.ndarray,
    longer: Callable[[], Mapping[str, float]],
) -> FittedParameter:
    parameter = slot.parameter
    value = posterior.stated[slot.name]
    sd = float(np.std(draws))
    # of the network alone: what effects that it may miss add is type B
    scale = parameter.sd * (abs(value) if parameter.transform == "log" else 1.0)
    type_a = posterior.fit.covariance_type_a[position, position]
    sd_a = min(sd, scale * float(np.sqrt(type_a)))
    low, high = np.quantile(draws, [0.025, 0.975])
    judgement: Identifiability | UnsetType = UNSET
    why: str | UnsetType = UNSET
    if parameter.role in ("effect", "known"):
        is_clear = sd < 0.25 * abs(value - parameter.centre) if value != 0 else False
        judgement = "identified" if is_clear else "weak"
        why = "belongs to an effect of the model."
    if parameter.role in ("network", "resistance"):
        statement = state(posterior, parameter, sd / abs(value), longer)
        judgement, why = statement.verdict, statement.why
    return FittedParameter(
        value=value,
        unit=parameter.unit,
        sd=sd,
        sd_type_a=sd_a,
        sd_type_b=float(np.sqrt(max(sd**2 - sd_a**2, 0.0))),
        interval_95=(float(low), float(high)),
        relative_sd=sd / abs(value) if value != 0 else None,
        prior_95=parameter.prior_interval_95(),
        prior_basis=parameter.basis,
        meaning=parameter.meaning,
        fixed=False,
        identifiability=judgement,
        why=why,
    )


def _widened(entry: FittedParameter, others: np.ndarray | None) -> FittedParameter:
    """Return a parameter whose interval holds that of models which the tests do not tell apart."""
    if others is None or entry.fixed:
        return entry
    both, sd = over_sets(entry.interval_95, entry.sd, others)
    relative_sd = sd / abs(entry.value)
    grade, why = entry.identifiability, entry.why
    if GRADES.index(by_uncertainty(relative_sd)) > GRADES.index(known(grade) or "fixed"):
        grade = by_uncertainty(relative_sd)
        why = "it hangs on an effect that these tests do not tell from another."
    return replace(
        entry,
        interval_95=both,
        sd=sd,
        sd_type_b=float(np.sqrt(max(sd**2 - (entry.sd_type_a or 0.0) ** 2, 0.0))),
        relative_sd=relative_sd,
        identifiability=grade,
        why=why,
    )


def _with_budgets(
    main: Mapping[str, FittedParameter], posterior: Posterior, budget: Budget
) -> dict[str, FittedParameter]:
    """Return parameters with where their uncertainty comes from, those of `_widened` too."""
    found = dict(main)
    for name, values in posterior.values().items():
        if name in main:
            draws = values.ravel()
            more = more_of(main[name].sd, draws)
            found[name] = replace(main[name], budget=budget(draws, *more))
    return found


def _fixed(parameter: Parameter, value: float) -> FittedParameter:
    return FittedParameter(
        value=value,
        unit=parameter.unit,
        sd=0.0,
        sd_type_a=0.0,
        sd_type_b=0.0,
        interval_95=(value, value),
        relative_sd=0.0,
        prior_95=(value, value),
        prior_basis="fixed in the motor or the network file",
        meaning=parameter.meaning,
        fixed=True,
        identifiability="fixed",
        why="fixed in the motor or the network file",
    )
