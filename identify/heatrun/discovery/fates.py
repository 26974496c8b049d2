"""What became of every effect of the library, and why: the candidates of `discovery.json`."""

from __future__ import annotations

from dataclasses import replace

from ..effects.library import Candidate
from ..effects.missing import Sight
from ..inference.effect_parameters import qualified
from ..inference.noise import from_scores
from ..results.candidate import CandidateFate, Status
from .run import Discovery


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
            place = f"in the place of {each.id} it has a probability of {100.0 * p:.2g} %"
            return ("tied" if effect in asked.tied(each) else "rejected"), place
    if effect in asked.best.effects:
        return "rejected", (
            "the evidence asks for it, but what it closes of the gap is less than the laws of the "
            "other effects leave open: the intervals allow for it"
        )
    if sight is not None and not sight.is_visible:
        noise = float(from_scores(asked.core.noise_z).total())
        return "not identifiable", (
            f"at its usual size these tests would show {sight.visible_K:.3f} K of it, "
            f"{sight.visibility:.1f} standard deviations of a noise of {noise:.2f} K"
        )
    return "rejected", "the evidence of all effects together does not ask for it"
