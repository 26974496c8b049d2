"""Two networks on the same tests, as they stand in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec import UNSET, UnsetType

from .values import NonNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkVerdict:
    """Which of two networks the data favour.

    Attributes:
        order: Name of the network, or `"undecided"`.
        sentence: The verdict in words.
        log_bayes_factor: Of the network with more nodes to the other one [nat]; null if there are
            not two.
        log_score_difference: Mean log score per block of the network with more nodes less that of
            the other one, over the held-out tests [nat]; unset where there is none.
        log_score_difference_se: Its standard error, which allows for neighbouring blocks that err
            alike [nat]; unset likewise.
    """

    order: str
    sentence: str
    log_bayes_factor: float | None
    log_score_difference: float | UnsetType = UNSET
    log_score_difference_se: NonNegative | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """How long two networks stay within an error.

    Attributes:
        test: Name of the test.
        limit_K: The error [K].
        until_s: Time at which the network with fewer nodes leaves it [s]; null if it never does.
        second_until_s: The same for the other network [s].
    """

    test: str
    limit_K: NonNegative
    until_s: float | None
    second_until_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The measured peak of a test and what two networks predict there.

    Attributes:
        test: Name of the test.
        time_s: When [s].
        measured_degC: The peak [degC].
        first_degC: What the network with fewer nodes predicts [degC].
        second_degC: What the other one predicts [degC].
    """

    test: str
    time_s: float
    measured_degC: float
    first_degC: float
    second_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two networks over the same tests.

    Attributes:
        words: The comparison in sentences.
        thresholds: By test and error.
        peak: By test.
    """

    words: tuple[str, ...]
    thresholds: tuple[Threshold, ...]
    peak: tuple[Peak, ...]
