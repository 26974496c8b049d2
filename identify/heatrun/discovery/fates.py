"""What became of every effect of the library, and why: the candidates of `discovery.json`."""

from __future__ import annotations

from dataclasses import replace

from msgspec import UNSET

from ..results.candidate import CandidateFate, HeldOutErrors, Status
from .grow import NUM_REFITTED, Round
from .judging.acceptance import WORTH_A_REFIT, Rival
from .run import Discovery
from .screening.screen import VISIBLE, VISIBLE_K, Score


def describe_candidates(found: Discovery) -> tuple[CandidateFate, ...]:
    """Return every effect of the library with what became of it and why."""
    rounds = found.growth.rounds
    rows = []
    for score in rounds[0].scores:
        status, reason, rival = _fate(found, score)
        card = score.candidate.kind.card
        row = CandidateFate(
            id=score.candidate.id,
            family=card.family,
            test=score.candidate.test_name(found.engine.tests),
            status=status,
            reason=reason,
            visibility=score.visibility,
            visible_K=score.visible_K,
            screening_log_bayes=score.log_bayes,
            separating_test=card.separating_test,
        )
        rows.append(row if rival is None else _refitted(row, rival))
    for name, reason in found.library.unavailable.items():
        rows.append(CandidateFate(id=name, status="not available", reason=reason))
    return tuple(rows)


def _refitted(row: CandidateFate, rival: Rival) -> CandidateFate:
    """Return what is said of a candidate with the figures of its refit."""
    held_out = tuple(
        HeldOutErrors(rmse_without_K=without, rmse_with_K=with_it)
        for without, with_it in rival.held_out_K
    )
    return replace(
        row,
        delta_log_evidence=rival.delta_log_evidence,
        rmse_K=rival.rmse_K,
        left_out_K=rival.left_out_K,
        parameters=dict(rival.values),
        held_out=held_out or UNSET,
    )


def _fate(found: Discovery, score: Score) -> tuple[Status, str, Rival | None]:
    candidate = score.candidate
    seen = [(r, rival) for r in found.growth.rounds for rival in r.rivals
            if rival.candidate == candidate]  # fmt: skip
    rival = seen[-1][1] if seen else None
    for each in found.named:
        if each.rival.candidate == candidate:
            return "accepted", "", each.rival
        for swap in each.swaps:
            if swap.candidate == candidate:
                fate = "rejected" if swap.reason else "tied"
                return (
                    fate,
                    swap.reason or f"these tests cannot separate it from {each.rival.candidate.id}",
                    rival,
                )
    if candidate.id in found.dropped:
        return "rejected", f"was accepted at first; {found.dropped[candidate.id]}", rival
    if rival is not None:
        return "rejected", rival.reason or _overtaken(seen[-1][0]), rival
    if not score.is_visible:
        return (
            "not identifiable",
            f"at its typical size these tests would show {score.visible_K:.3f} K of it, "
            f"{score.visibility:.1f} standard deviations (needed {VISIBLE_K:g} K and {VISIBLE:g})",
            None,
        )
    if score.log_bayes > WORTH_A_REFIT:
        return "screened", f"the {NUM_REFITTED} that were refitted score higher", None
    return (
        "screened",
        f"the residuals do not favour it (log Bayes factor {score.log_bayes:+.1f})",
        None,
    )


def _overtaken(round_: Round) -> str:
    assert round_.accepted is not None
    return f"{round_.accepted.candidate.id} explains the residuals better"
