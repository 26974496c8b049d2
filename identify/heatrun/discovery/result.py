"""The result of a discovery: what stands in `discovery.json`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import UNSET

from ..inference.effect_parameters import qualified
from ..inference.posterior import Posterior
from ..inference.predict import Prediction
from ..results.discovery import (
    DISCOVERY_FORMAT,
    AdequacyBeforeAfter,
    DiscoveryResult,
    LeftByModel,
    LoadStep,
    MotorName,
    NoiseLevels,
    PosteriorWords,
    ProposedTest,
)
from ..results.found_effect import (
    EffectEvidence,
    EffectParameter,
    FoundEffect,
    LeftOut,
    RivalEffect,
    TraceOfEffect,
)
from ..results.gap import (
    ErrorsBeforeAfter,
    ErrorsOnTest,
    Gap,
    HeldOutGap,
    ParameterBeforeAfter,
    ValueWithInterval,
)
from ..results.missing import Localisation, LocalisedMisfit, MissingCourse, MissingSpan
from ..results.values import Interval, Role
from ..version import __version__
from .fates import describe_candidates
from .judging.final_check import Adequacy
from .localise import Span, Where
from .rivals import Named
from .run import Discovery, Shown
from .screening.library import Candidate
from .screening.response import SENSOR
from .traces import Trace
from .verdict import sampled_apart

SELECTED = (
    "The held-out tests took part in the selection of effects: none was added that predicts one of "
    "them worse. Their error after is therefore no independent proof; a further test would be."
)
"""What must be said of held-out tests that were looked at before an effect was added."""


def assemble(
    found: Discovery,
    shown: Shown,
    roles: Sequence[Role],
    *,
    command: str,
    seed: int,
) -> DiscoveryResult:
    """Return the whole of `discovery.json`.

    Args:
        found: What was found.
        shown: Posteriors and predictions of all tests.
        roles: Role of each test.
        command: The command, as it is to stand in the result.
        seed: Of everything that was drawn.
    """
    after = found.after
    pairs = list(zip(shown.predictions, roles, strict=True))
    fitted = [p for p, role in pairs if role != "holdout"]
    held_out = [p for p, role in pairs if role == "holdout"]
    calibration = _gap(fitted, after.noise_K)
    apart = sampled_apart(after, calibration.rmse_after_K)
    return DiscoveryResult(
        format=DISCOVERY_FORMAT,
        heatrun_version=__version__,
        command=command,
        seed=seed,
        motor=MotorName(name=found.engine.problem.motor.name),
        verdict=found.verdict.word,
        sentence=f"{found.verdict.sentence}{apart}",
        effects=tuple(_effect(found, shown, each) for each in found.named),
        dropped=tuple(found.dropped),
        traces=tuple(describe_trace(trace) for trace in found.traces),
        where=tuple(_span(span) for span in found.where_before.spans),
        where_left=tuple(_span(span) for span in found.where_after.spans),
        localisation=Localisation(
            before=_where(found.where_before), after=_where(found.where_after)
        ),
        candidates=describe_candidates(found),
        adequacy=AdequacyBeforeAfter(before=_adequacy(found.before), after=_adequacy(after)),
        calibration=calibration,
        holdout=_held_out(found, _gap(held_out, after.noise_K)) if held_out else None,
        tests=tuple(
            ErrorsBeforeAfter(
                name=before.test.name, role=role, before=_row(before), after=_row(last)
            )
            for (before, last), role in pairs
        ),
        parameters=_parameters(shown),
        noise=NoiseLevels(
            sd_K=float(found.final.noise.sd),
            time_s=float(found.final.noise.time),
            white_K=float(found.final.noise.white),
        ),
        posterior=PosteriorWords(
            before=shown.posteriors[0].sentence(),
            after=shown.posteriors[1].sentence(),
            is_sound=shown.posteriors[1].is_sound,
        ),
        next_test=_next(found),
        seconds=dict(found.seconds),
    )


def _held_out(found: Discovery, gap: Gap) -> HeldOutGap:
    """Return the gap on held-out tests, and whether these decided about an effect."""
    judged = [r for each in found.growth.rounds for r in each.rivals if r.held_out_K]
    return HeldOutGap(
        noise_floor_K=gap.noise_floor_K,
        rmse_before_K=gap.rmse_before_K,
        max_before_K=gap.max_before_K,
        coverage_95_before=gap.coverage_95_before,
        rmse_after_K=gap.rmse_after_K,
        max_after_K=gap.max_after_K,
        coverage_95_after=gap.coverage_95_after,
        took_part_in_selection=bool(judged),
        sentence=SELECTED if judged else "The held-out tests took no part in the selection.",
    )


def describe_trace(trace: Trace) -> TraceOfEffect:
    """Return an effect that is there and too small to matter."""
    return TraceOfEffect(
        id=trace.rival.candidate.id,
        equivalents=tuple(candidate.id for candidate in trace.equivalents),
        closes_K=trace.rival.gap_K,
        delta_log_evidence=trace.rival.delta_log_evidence,
    )


def _effect(found: Discovery, shown: Shown, named: Named) -> FoundEffect:
    rival = named.rival
    kind = rival.candidate.kind
    draws = shown.with_effects.values()
    ties = found.ties if found.ties is not None and found.ties.named is named else None
    names = {name: _slot_name(found, rival.candidate, name) for name in kind.card.parameters}
    return FoundEffect(
        id=rival.candidate.id,
        family=kind.card.family,
        law=kind.card.law,
        test=rival.candidate.test_name(found.engine.tests),
        probability=named.probability if ties is None else ties.probability(rival.candidate),
        equivalents=tuple(candidate.id for candidate in named.equivalents),
        parameters={
            name: EffectParameter(
                value=float(np.median(draws[slot])),
                unit=kind.card.parameters[name].unit,
                interval_95=_interval(draws[slot]),
            )
            for name, slot in names.items()
            if slot in draws
        },
        evidence=EffectEvidence(
            delta_log_evidence=named.delta_log_evidence, familywise_p=named.familywise_p
        ),
        left_out=LeftOut(rmse_before_K=rival.left_out_without_K, rmse_after_K=rival.left_out_K),
        rivals=tuple(
            RivalEffect(
                id=swap.candidate.id,
                delta_log_evidence=-swap.delta_log_evidence,
                share_of_gap=swap.share,
                parameters=dict(swap.values),
                reason=swap.reason or "not distinguishable from these tests",
                probability=UNSET
                if ties is None or swap.reason
                else ties.probability(swap.candidate),
            )
            for swap in named.swaps
        ),
    )


def _slot_name(found: Discovery, candidate: Candidate, name: str) -> str:
    full = qualified(candidate.kind, name)
    test = candidate.test_name(found.engine.tests)
    return full if test is None else f"{full}[{test}]"


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


def _parameters(shown: Shown) -> dict[str, ParameterBeforeAfter]:
    result: dict[str, ParameterBeforeAfter] = {}
    for slot in shown.posteriors[0].fit.slots:
        if slot.parameter.role in ("network", "resistance"):
            before, after = (_figure(posterior, slot.name) for posterior in shown.posteriors)
            result[slot.name] = ParameterBeforeAfter(
                before=before,
                after=after,
                unit=slot.parameter.unit,
                wrong_by=before.value / after.value - 1.0 if after.value else None,
            )
    return result


def _figure(posterior: Posterior, name: str) -> ValueWithInterval:
    draws = posterior.values()[name].ravel()
    return ValueWithInterval(value=float(np.median(draws)), interval_95=_interval(draws))


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
