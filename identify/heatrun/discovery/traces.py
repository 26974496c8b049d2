"""Effects with strong evidence that are too small to matter."""

from __future__ import annotations

from dataclasses import dataclass

from .grow import Growth
from .judging.acceptance import Rival
from .rivals import TIE_NATS, TIE_SHARE
from .screening.library import Candidate

STRONG = 10.0
"""Log evidence above which an effect is there without doubt [nat], however small it is."""


@dataclass(frozen=True)
class Trace:
    """An effect that is there and does not matter.

    Attributes:
        rival: The effect, refitted.
        equivalents: Other effects that explain the same as well.
    """

    rival: Rival
    equivalents: tuple[Candidate, ...]

    @property
    def words(self) -> str:
        """What it is and how much it closes."""
        ids = [self.rival.candidate.id, *dict.fromkeys(c.id for c in self.equivalents)]
        told = ids[0] if len(ids) == 1 else f"{ids[0]} (or {', '.join(ids[1:])})"
        return (
            f"{told}: log Bayes factor {self.rival.delta_log_evidence:+.0f}, it closes "
            f"{self.rival.gap_K:.2f} K, and below {self.rival.least_K:.2f} K nothing is added"
        )


def find_traces(growth: Growth, excess: float) -> list[Trace]:
    """Return the traces in what the final model leaves, the best with its equivalents.

    The others compete with it for the same residuals; whether one of them is there beside it
    would take a fit with it in the model.

    Args:
        growth: How the model grew.
        excess: Of slow residuals of the final model [1]; evidence is worth that much less.
    """
    strong = [
        rival
        for rival in growth.rounds[-1].rivals
        if rival.is_physical and rival.delta_log_evidence > STRONG and rival.gap_K < rival.least_K
    ]
    if not strong:
        return []
    best = max(strong, key=lambda rival: rival.delta_log_evidence)
    tied = TIE_NATS * max(1.0, excess)
    others = [
        rival.candidate
        for rival in strong
        if rival is not best
        and (
            best.delta_log_evidence - rival.delta_log_evidence < tied
            or rival.gap_K**2 > TIE_SHARE * best.gap_K**2
        )
    ]
    return [Trace(best, tuple(others))]
