"""The result of a discovery as `discovery.json` holds it, and what became of every effect."""

from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np
from msgspec import UNSET

from ..calibration import Calibration
from ..effects.engine import Candidate
from ..effects.search import MATTERS_K
from ..effects.search import gap as closed
from ..effects.small_effects import Sight
from ..io.quantities import percent
from ..model.noise import from_scores
from ..model.parameters import qualified
from ..posterior.posterior import Posterior
from ..posterior.predict import Prediction
from ..results.discovery import (
    DISCOVERY_FORMAT,
    AdequacyBeforeAfter,
    CandidateFate,
    DiscoveryResult,
    EffectEvidence,
    EffectParameter,
    ErrorsBeforeAfter,
    ErrorsOnTest,
    FoundEffect,
    Gap,
    HeldOutGap,
    LeftByModel,
    LeftOut,
    LoadStep,
    MotorName,
    NoiseLevels,
    ParameterBeforeAfter,
    PosteriorWords,
    ProposedTest,
    RivalEffect,
    Status,
    TraceOfEffect,
    ValueWithInterval,
)
from ..results.model import Localisation, LocalisedMisfit, MissingCourse, MissingSpan
from ..results.values import Interval, Role
from ..version import __version__
from .discovery import Adequacy, Discovery
from .localise import SENSOR, Span, Where


def describe_candidates(found: Discovery) -> tuple[CandidateFate, ...]:
    """Return every effect of the library with what became of it and why."""
    asked = found.asked
    sights = {} if found.screened is None else {s.candidate: s for s in found.screened.sights}
    rows = [_described(found, each, sights.get(each)) for each in asked.library.candidates]
    rows += [
        CandidateFate(id=name, status="not available", reason=reason)
        for name, reason in asked.library.unavailable.items()
    ]
    return tuple(rows)


def values_of(found: Discovery, effect: Candidate) -> dict[str, float | None]:
    """Return the parameters of an effect in the best set that has it [their units]."""
    search = found.asked.search
    members = [m for m in search.fitted.values() if effect in m.effects]
    if not members:
        return {}
    best = max(members, key=lambda member: member.log_weight)
    values, _ = search.engine.values(best.z, effect.test or 0)
    return {name: values[qualified(effect.kind, name)] for name in effect.kind.card.parameters}


def _described(found: Discovery, effect: Candidate, sight: Sight | None) -> CandidateFate:
    asked = found.asked
    card = effect.kind.card
    status, reason = _fate(found, effect, sight)
    row = CandidateFate(
        id=effect.id,
        family=card.family,
        test=effect.test_name(asked.search.engine.tests),
        status=status,
        reason=reason,
        separating_test=card.separating_test,
        parameters=values_of(found, effect),
        delta_log_evidence=_delta(found, effect),
    )
    if sight is None:
        return row
    return replace(
        row,
        visibility=sight.visibility,
        visible_K=sight.visible_K,
        screening_log_bayes=sight.log_bayes,
    )


def _delta(found: Discovery, effect: Candidate) -> float | None:
    """Return the log evidence that an effect adds to the core, if a fit says so [nat]."""
    asked = found.asked
    if effect in asked.core.effects:
        return asked.log_bayes(effect)
    beside = asked.search.fitted.get(asked.core.effects | {effect})
    return None if beside is None else beside.log_evidence - asked.core.log_evidence


def _fate(found: Discovery, effect: Candidate, sight: Sight | None) -> tuple[Status, str]:
    asked = found.asked
    if effect in asked.core.effects:
        return "accepted", ""
    for each in asked.core.effects:
        p = asked.rivals(each).get(effect)
        if p is not None:
            place = f"in the place of {each.id} it has a probability of {percent(p)}"
            return ("tied" if effect in asked.tied(each) else "rejected"), place
    if effect in asked.full.effects:
        return "rejected", (
            "it is in the model, but not beyond doubt: half of the evidence does not ask for it, "
            f"or it closes less than {MATTERS_K} K"
        )
    if sight is not None and not sight.is_visible:
        noise = float(from_scores(asked.core.noise_z).total())
        return "not identifiable", (
            f"at its usual size these tests would show {sight.visible_K:.3f} K of it, "
            f"{sight.visibility:.1f} standard deviations of a noise of {noise:.2f} K"
        )
    return "rejected", "the evidence of all effects together does not ask for it"


APART = "The held-out tests took no part in the selection."


def assemble(
    found: Discovery,
    calibration: Calibration,
    before: Sequence[Prediction],
    base: Posterior,
    *,
    command: str,
    seed: int,
) -> DiscoveryResult:
    """Return the whole of `discovery.json`.

    Args:
        found: What was found.
        calibration: Of the network with the effects.
        before: All tests as the network alone predicts them.
        base: Its posterior.
        command: The command, as it is to stand in the result.
        seed: Of everything that was drawn.
    """
    after = found.after
    name = list(calibration.posteriors)[-1]
    posterior = calibration.posteriors[name]
    roles: list[Role] = [test.role for test in calibration.tests]
    both = zip(before, calibration.predictions[name], strict=True)
    # that one could not be predicted is a finding of the calibration
    pairs: list[tuple[tuple[Prediction, Prediction], Role]] = [
        (pair, role) for pair, role in zip(both, roles, strict=True)
        if all(each.is_there for each in pair)
    ]  # fmt: skip
    fitted = [p for p, role in pairs if role != "holdout"]
    held_out = [p for p, role in pairs if role == "holdout"]
    asked = found.asked
    noise = found.left[1].noise
    return DiscoveryResult(
        format=DISCOVERY_FORMAT,
        heatrun_version=__version__,
        command=command,
        seed=seed,
        motor=MotorName(name=calibration.motor.name),
        verdict=found.verdict.word,
        sentence=found.verdict.sentence,
        effects=tuple(_effect(found, posterior, each) for each in asked.by_evidence),
        dropped=tuple(sorted({e.id for e in asked.best.effects - asked.full.effects})),
        traces=_traces(found) if found.verdict.word == "adequate" else (),
        where=tuple(_span(span) for span in found.where_before.spans),
        where_left=tuple(_span(span) for span in found.where_after.spans),
        localisation=Localisation(
            before=_where(found.where_before), after=_where(found.where_after)
        ),
        candidates=describe_candidates(found),
        adequacy=AdequacyBeforeAfter(before=_adequacy(found.before), after=_adequacy(after)),
        calibration=_gap(fitted, after.noise_K) if fitted else None,
        holdout=HeldOutGap(
            **asdict(_gap(held_out, after.noise_K)), took_part_in_selection=False, sentence=APART
        )
        if held_out
        else None,
        tests=tuple(
            ErrorsBeforeAfter(name=first.test.name, role=role, before=_row(first), after=_row(last))
            for (first, last), role in pairs
        ),
        parameters=_parameters(base, posterior),
        noise=NoiseLevels(
            sd_K=float(noise.sd), time_s=float(noise.time), white_K=float(noise.white)
        ),
        posterior=PosteriorWords(
            before=base.sentence(), after=posterior.sentence(), is_sound=posterior.is_sound
        ),
        next_test=_next(found),
        seconds=dict(found.seconds),
    )


def _traces(found: Discovery) -> tuple[TraceOfEffect, ...]:
    """Return the effects that the evidence asks for and that are not wanted in the model."""
    search = found.asked.search
    best = found.asked.best
    rows = []
    for each in sorted(best.effects - found.asked.core.effects, key=lambda one: one.id):
        without = search.fitted.get(best.effects - {each})
        if without is not None:
            reached = [search.reached_K(m) for m in (without, best)]
            delta = best.log_evidence - without.log_evidence
            rows.append(TraceOfEffect(id=each.id, equivalents=(), closes_K=closed(*reached),
                                      delta_log_evidence=delta))  # fmt: skip
    return tuple(rows)


def _effect(found: Discovery, posterior: Posterior, effect: Candidate) -> FoundEffect:
    asked = found.asked
    kind = effect.kind
    test = effect.test_name(asked.search.engine.tests)
    draws = posterior.values()
    names = {
        name: qualified(kind, name) if test is None else f"{qualified(kind, name)}[{test}]"
        for name in kind.card.parameters
    }
    rivals = asked.rivals(effect)
    core = asked.core.effects
    fitted = asked.search.fitted
    return FoundEffect(
        id=effect.id,
        family=kind.card.family,
        law=kind.card.law,
        test=test,
        probability=min(1.0, asked.probability(effect)),
        equivalents=tuple(other.id for other in asked.tied(effect)),
        parameters={
            name: EffectParameter(
                value=posterior.stated[slot],
                unit=kind.card.parameters[name].unit,
                interval_95=_interval(draws[slot]),
            )
            for name, slot in names.items()
            if slot in draws
        },
        evidence=EffectEvidence(
            delta_log_evidence=asked.log_bayes(effect), familywise_p=asked.familywise_p
        ),
        left_out=LeftOut(rmse_before_K=found.left_out_K[0], rmse_after_K=found.left_out_K[1]),
        rivals=tuple(
            RivalEffect(
                id=other.id,
                delta_log_evidence=fitted[core - {effect} | {other}].log_evidence
                - asked.core.log_evidence,
                share_of_gap=None,
                parameters=values_of(found, other),
                reason="not distinguishable from these tests"
                if other in asked.tied(effect)
                else f"{effect.id} explains the tests better",
                probability=min(1.0, p),
            )
            for other, p in rivals.items()
        ),
    )


def _span(span: Span) -> MissingSpan:
    is_sensor = span.node == SENSOR
    return MissingSpan(
        test=span.test,
        from_s=span.from_s,
        to_s=span.to_s,
        node=span.node,
        missing_W=UNSET if is_sensor else span.missing,
        missing_K=span.missing if is_sensor else UNSET,
        interval_95=span.interval_95,
    )


def _where(where: Where) -> LocalisedMisfit:
    return LocalisedMisfit(
        nodes=where.node,
        log_evidence=dict(where.log_evidence),
        dependence={node: dict(drivers) for node, drivers in where.dependence.items()},
        courses=tuple(
            MissingCourse(
                test=course.test,
                node=course.node,
                unit=course.unit,
                time_s=tuple(course.time_s.tolist()),
                mean=tuple(course.mean.tolist()),
                sd=tuple(course.sd.tolist()),
            )
            for course in where.courses
        ),
    )


def _adequacy(found: Adequacy) -> LeftByModel:
    return LeftByModel(
        is_adequate=found.is_adequate,
        low_frequency_excess=found.excess,
        correlation_s=found.correlation_s,
        slow_misfit_K=found.misfit_K,
        rmse_K=found.rmse_K,
        noise_K=found.noise_K,
        channel=found.channel,
    )


def _gap(pairs: Sequence[tuple[Prediction, Prediction]], floor: float) -> Gap:
    before, after = ([pair[place] for pair in pairs] for place in (0, 1))
    errors_before, errors_after = _errors(before), _errors(after)
    return Gap(
        noise_floor_K=floor,
        rmse_before_K=float(np.sqrt(np.mean(errors_before**2))),
        max_before_K=float(np.max(np.abs(errors_before))),
        coverage_95_before=_coverage(before),
        rmse_after_K=float(np.sqrt(np.mean(errors_after**2))),
        max_after_K=float(np.max(np.abs(errors_after))),
        coverage_95_after=_coverage(after),
    )


def _errors(predictions: Sequence[Prediction]) -> np.ndarray:
    """Return the errors over all tests in a row [K]."""
    return np.concatenate([p.residual[p.test.is_observed] for p in predictions])


def _coverage(predictions: Sequence[Prediction]) -> float:
    """Return the share of the readings of all tests inside their 95 % band [1]."""
    sizes = [int(p.test.is_observed.sum()) for p in predictions]
    return float(np.average([p.coverage_95() for p in predictions], weights=sizes))


def _row(prediction: Prediction) -> ErrorsOnTest:
    errors = _errors([prediction])
    return ErrorsOnTest(
        rmse_K=float(np.sqrt(np.mean(errors**2))),
        max_K=float(np.max(np.abs(errors))),
        end_K=float(np.mean(errors[-5:])),
        coverage_95=prediction.coverage_95(),
    )


def _parameters(base: Posterior, last: Posterior) -> dict[str, ParameterBeforeAfter]:
    result: dict[str, ParameterBeforeAfter] = {}
    for slot in base.fit.slots:
        if slot.parameter.role in ("network", "resistance"):
            before, after = (_figure(posterior, slot.name) for posterior in (base, last))
            result[slot.name] = ParameterBeforeAfter(
                before=before,
                after=after,
                unit=slot.parameter.unit,
                wrong_by=before.value / after.value - 1.0 if after.value else None,
            )
    return result


def _figure(posterior: Posterior, name: str) -> ValueWithInterval:
    draws = posterior.values()[name].ravel()
    return ValueWithInterval(value=posterior.stated[name], interval_95=_interval(draws))


def _interval(draws: np.ndarray) -> Interval:
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def _next(found: Discovery) -> ProposedTest | None:
    test = found.next_test
    if test is None:
        return None
    return ProposedTest(
        separates=tuple(test.separates),
        what=test.what,
        start=test.start,
        profile=tuple(LoadStep(**step) for step in test.profile),
        expected_log_bayes_factor=test.expected_log_bayes_factor,
    )
