"""Effects that a discovery accepted, their rivals and traces, as they stand in `discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import UNSET, Meta, UnsetType

from .values import Interval, NonNegative, Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """A parameter of an accepted effect.

    Attributes:
        value: Median of the posterior [unit].
        unit: Its unit.
        interval_95: 95 % interval [unit].
    """

    value: float
    unit: str
    interval_95: Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectEvidence:
    """What speaks for an accepted effect.

    Attributes:
        delta_log_evidence: Over the final model without it [nat].
        familywise_p: Probability that a clean record reaches its score [1].
    """

    delta_log_evidence: float
    familywise_p: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Errors on parts of the tests that were left out of the fit.

    Attributes:
        rmse_before_K: Root mean square error without the effect [K].
        rmse_after_K: And with it [K].
    """

    rmse_before_K: NonNegative
    rmse_after_K: NonNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalEffect:
    """Another effect in the place of an accepted one.

    Attributes:
        id: Its name in the catalogue.
        delta_log_evidence: Over the accepted effect [nat].
        share_of_gap: Share of the gap that it closes, the accepted one closing all [1].
        parameters: Its parameters [their units].
        reason: Why it is rejected, or that it is not distinguishable.
        probability: Among the effects that the model is averaged over [1]; unset for others.
    """

    id: str
    delta_log_evidence: float | None
    share_of_gap: float | None
    parameters: dict[str, float | None]
    reason: str
    probability: Probability | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundEffect:
    """An effect that was accepted.

    Attributes:
        id: Its name in the catalogue.
        family: What kind of effect it is.
        law: Its law in words.
        test: Test of an event; null for all other effects.
        probability: Among itself, its rivals and nothing; where the model is averaged over it and
            its equivalents, among these [1].
        equivalents: Effects that these tests cannot separate from it.
        parameters: By name.
        evidence: What speaks for it.
        left_out: Errors on parts left out.
        rivals: Effects in its place, the best first.
    """

    id: str
    family: str
    law: str
    test: str | None
    probability: Probability
    equivalents: tuple[str, ...]
    parameters: Annotated[dict[str, EffectParameter], Meta(min_length=1)]
    evidence: EffectEvidence
    left_out: LeftOut
    rivals: tuple[RivalEffect, ...]

    def equivalents_in_words(self) -> str:
        """Return the effects that the tests do not separate from it, averaged ones with their
        probability; empty without any.
        """
        share = {r.id: r.probability for r in self.rivals if r.probability is not UNSET}
        return ", ".join(
            f"{name} ({100.0 * share[name]:.0f} %)" if name in share else name
            for name in self.equivalents
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceOfEffect:
    """An effect with strong evidence that is too small to matter.

    Attributes:
        id: Its name in the catalogue.
        equivalents: Effects that explain the same as well.
        closes_K: What it closes of the gap [K].
        delta_log_evidence: Over the final model [nat].
    """

    id: str
    equivalents: tuple[str, ...]
    closes_K: NonNegative
    delta_log_evidence: float


Trace = Annotated[TraceOfEffect, Meta(extra_json_schema={"unevaluatedProperties": False})]
"""In a list of traces, which has no other fields within this version of the schema."""
