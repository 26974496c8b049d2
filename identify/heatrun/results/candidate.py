"""What became of an effect of the library, as it stands in `discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, UnsetType

from .values import NonNegative, known

Status = Literal["accepted", "tied", "rejected", "screened", "not identifiable", "not available"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutErrors:
    """Errors on one held-out test.

    Attributes:
        rmse_without_K: Root mean square error without the effect [K].
        rmse_with_K: And with it [K].
    """

    rmse_without_K: float
    rmse_with_K: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateFate:
    """An effect of the library and what became of it; what was not looked at is unset.

    Attributes:
        id: Its name in the catalogue.
        family: What kind of effect it is.
        test: Test of an event; null for all other effects.
        status: What became of it.
        reason: Why; empty if it was accepted.
        visibility: What a refit would leave of it at its typical size [standard deviations].
        visible_K: The same [K].
        screening_log_bayes: Log Bayes factor of the screening [nat].
        separating_test: Test that would separate it from others, in words.
        delta_log_evidence: Of the refit, over the model without it [nat]; null if it failed.
        rmse_K: Of the calibration tests with it [K]; null likewise.
        left_out_K: Root mean square error on parts left out [K]; null likewise.
        parameters: Its parameters [their units].
        held_out: Errors on each held-out test.
    """

    id: str
    family: str | UnsetType = UNSET
    test: str | UnsetType | None = UNSET
    status: Status
    reason: str
    visibility: NonNegative | UnsetType = UNSET
    visible_K: NonNegative | UnsetType = UNSET
    screening_log_bayes: float | UnsetType = UNSET
    separating_test: str | UnsetType = UNSET
    delta_log_evidence: float | UnsetType | None = UNSET
    rmse_K: NonNegative | UnsetType | None = UNSET
    left_out_K: NonNegative | UnsetType | None = UNSET
    parameters: dict[str, float | None] | UnsetType = UNSET
    held_out: tuple[HeldOutErrors, ...] | UnsetType = UNSET

    @property
    def log_evidence(self) -> float | None:
        """Of the refit, or of the screening where there was none [nat]; None if of neither."""
        is_refitted = self.delta_log_evidence is not UNSET
        return known(self.delta_log_evidence if is_refitted else self.screening_log_bayes)
