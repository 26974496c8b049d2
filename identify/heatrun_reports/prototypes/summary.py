"""What the report on several prototypes says in a few sentences."""

from __future__ import annotations

from heatrun.reports.printed import signed

from ..analysis.validation import SignalComparison
from ..figures.plot import unit, wording
from ..validation_report import disagreement, lower
from .confront import Compared, Confrontation
from .prototype import OnNetwork

IN_FULL, NAMED = 3, 8
"""So many pairs that do not agree are told in full on the first lines, so many by what does not;
of more there is room for the counts, and the tables tell all."""


def summary(found: Confrontation) -> str:
    """Return what came out in sentences: which pairs agree, and where the others do not."""
    agreeing = [p.name for p in found.pairs if counts(p)[1] and counts(p)[0] == counts(p)[1]]
    others = [pair for pair in found.pairs if pair.name not in agreeing]
    sentences = [f"Agree in all that is judged: {', '.join(agreeing)}."] if agreeing else []
    sentences += [_pair_sentence(pair, len(others)) for pair in others]
    sentences += [_network_sentence(one) for one in found.networks]
    return " ".join(sentences)


def _pair_sentence(pair: Compared, num_told: int) -> str:
    agree, judged = counts(pair)
    if not judged:
        return f"{pair.name}: nothing in common is evidence."
    signals = [s for s in pair.validation.judged if s.verdict != "agrees"]
    figures = [f for f in pair.validation.judged_figures if f.verdict != "agrees"]
    if num_told <= IN_FULL:
        words = [f"{wording(s.channel)} ({_deviation(s)})" for s in signals]
        words += [disagreement(f) for f in figures]
    else:
        words = [wording(s.channel) for s in signals] + [lower(f.label) for f in figures]
    head = f"{pair.name}: {agree} of {judged} agree"
    return f"{head}; not {', '.join(words)}." if num_told <= NAMED else f"{head}."


def _deviation(signal: SignalComparison) -> str:
    if signal.verdict != "biased":
        return signal.verdict
    symbol = unit(signal.channel, is_difference=True)
    return f"biased by {signal.bias:+.2g} {symbol}"


def _network_sentence(one: OnNetwork) -> str:
    parts = [
        f"{wording(s.channel)} {s.verdict} (bias {signed(s.bias, 1)} K, RMSE {s.rmse:.1f} K)"
        for s in one.temperatures
    ]
    return f"Network of the run on {one.prototype.role}: {', '.join(parts)}."


def counts(pair: Compared) -> tuple[int, int]:
    """Return how many signals and figures of a pair agree, and how many are judged."""
    judged = [*pair.validation.judged, *pair.validation.judged_figures]
    return sum(one.verdict == "agrees" for one in judged), len(judged)
