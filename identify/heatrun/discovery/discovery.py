"""What a calibration misses without its effects, told: where, what, how much of the gap is closed.

The search itself is that of every calibration (`heatrun.effects`); nothing here decides anything
anew. First come tests predicted from the others and what is left against noise, then the verdict.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from ..effects.engine import Engine, Refit
from ..effects.found import Found
from ..effects.search import gap, plain_noise
from ..effects.small_effects import SmallEffects
from ..fit.fit import low_frequency_excess
from ..io.quantities import effects_in_words
from ..model.network_form import WINDING
from ..model.noise import scales_of, variance_of_mean
from ..results.discovery import VerdictWord
from ..work import SILENT, Work
from .localise import Where, localise
from .proposed_test import NextTest, next_test

NUM_PARTS = 4
"""Parts that a single test is cut into; each is predicted from the others."""


def folds(engine: Engine, event: int | None = None) -> list[Bool[np.ndarray, " block"]]:
    """Return which blocks each fold leaves out.

    Args:
        engine: The tests.
        event: Index of the test of an event, which only other parts of that test can predict.
    """
    tests = engine.tests
    masks = []
    for index, test in enumerate(tests):
        if event is None and len(tests) > 1:
            parts = [(0, test.num_blocks)]
        elif event is None or index == event:
            cuts = np.linspace(0, test.num_blocks, NUM_PARTS + 1).round().astype(int)
            parts = list(pairwise(cuts))
        else:
            continue
        for begin, end in parts:
            left_out = [np.zeros(each.measured.size, dtype=bool) for each in tests]
            for sensor in test.by_sensor(left_out[index]):  # all that was read meanwhile
                sensor[begin:end] = True
            masks.append(np.concatenate(left_out) & engine.is_observed)
    return [mask for mask in masks if mask.any()]


def left_out_errors(
    engine: Engine, refit: Refit, masks: Sequence[Bool[np.ndarray, " block"]]
) -> Float[np.ndarray, " block"]:
    """Return the errors of the left-out blocks [K], predicted by a fit to the others.

    The model is taken as linear around its fit to everything. Start temperatures of a test that
    is left out as a whole are its own: they are fitted to it, the network is not.

    Args:
        engine: The tests.
        refit: A fit to all blocks.
        masks: Which blocks each fold leaves out.
    """
    noise = refit.noise
    columns, residual = engine.whiten(noise, refit.jacobian), engine.whiten(noise, refit.residual)
    prior = refit.z[list(refit.free)]
    errors = np.full(residual.size, np.nan)
    for mask in masks:
        own = _starts_of_whole_tests(engine, refit, mask)
        kept = ~mask & engine.is_observed
        # whitening mixes neighbours only; rows of kept blocks stand for the kept data
        A, r = columns[kept], residual[kept]
        precision = A.T @ A + np.eye(prior.size)
        step = -np.linalg.solve(precision, A.T @ r + prior)
        if own.any():
            B, rest = columns[mask][:, own], residual[mask] + columns[mask] @ step
            step[own] += -np.linalg.solve(B.T @ B + precision[np.ix_(own, own)], B.T @ rest)
        errors[mask] = (refit.residual + refit.jacobian @ step)[mask]
    return errors


def _starts_of_whole_tests(engine: Engine, refit: Refit, mask: np.ndarray) -> np.ndarray:
    """Return which free slots are start temperatures of a test that is left out as a whole."""
    parts = engine.problem.split(mask)
    whole = [
        index
        for index, (part, test) in enumerate(zip(parts, engine.tests, strict=True))
        if part[test.is_observed].all()
    ]
    slots = [engine.slots[slot] for slot in refit.free]
    return np.array([s.parameter.role == "start" and s.test in whole for s in slots])


def rmse(errors: np.ndarray) -> float:
    """Return the root mean square of the finite errors [K]."""
    return float(np.sqrt(np.mean(errors[np.isfinite(errors)] ** 2)))


WINDOW_S = 600.0
"""Window over which what is slow is looked at [s]."""

FEWEST_WINDOWS = 3
"""Windows that a test has at least [1]: in one shorter than half an hour they are shorter too."""

LONGEST_S = 75.0
"""Correlation time of the residuals from which on they count as a misfit [s]."""

RELEVANT_K = 0.08
"""A slow misfit below this is of no consequence on a bench [K]: instruments, lumping and the
loss balance leave as much."""

RELEVANT_SHARE = 0.5
"""And below this share of the noise of a block mean it cannot be told from it [1]."""

FORM_SHARE = 0.15
"""A law of the catalogue leaves about this share of an effect that it names rightly [1]: the
machine's own law has another exponent, a threshold, a lag."""


@dataclass(frozen=True)
class Adequacy:
    """What is left by a model."""

    excess: float  # Mean squared normalised window mean of the whitened residuals [1]; 1 if white.
    is_excessive: bool  # Whether that is above its limit.
    correlation_s: float  # Correlation time of the residuals, without a limit [s].
    misfit_K: float  # Root mean square of what is slow, less what noise would leave [K].
    rmse_K: float  # Root mean square of all residuals of the same fit, slow and fast [K].
    window_s: float  # Length of the means that count as slow [s].
    noise_K: float  # Standard deviation of the noise of a block mean [K].
    closed_K: float = 0.0  # Gap that the effects in the model have closed [K].
    channel: str = WINDING  # The sensor whose slow misfit is largest; misfit and error are its.
    # The error of the winding, where that of another sensor is told [K].
    winding_rmse_K: float | None = None

    @property
    def words(self) -> str:
        """The misfit beside the whole error, as printed."""
        return (
            f"a slow misfit of {self.misfit_K:.2f} K (means over {self.window_s / 60.0:.0f} min, "
            f"less what noise leaves in them) in an RMSE of {self.rmse_K:.2f} K"
            + ("" if self.channel == WINDING else f" of {self.channel}")
        )

    @property
    def is_relevant(self) -> bool:
        """Whether the misfit is large enough to matter."""
        least = max(RELEVANT_K, RELEVANT_SHARE * self.noise_K, FORM_SHARE * self.closed_K)
        return self.misfit_K > least

    @property
    def is_adequate(self) -> bool:
        """Whether only noise is left, or nothing that matters."""
        return not ((self.is_excessive or self.correlation_s > LONGEST_S) and self.is_relevant)


def adequacy(engine: Engine, refit: Refit, closed_K: float = 0.0) -> Adequacy:
    """Return what a model leaves.

    Args:
        engine: The tests.
        refit: Its fit under the noise that the library's directions leave.
        closed_K: Gap that the effects in the model have closed [K].
    """
    noise = refit.noise
    innovations, lengths = [], []
    slow: dict[str, list[np.ndarray]] = {}
    expected: dict[str, list[np.ndarray]] = {}
    longest_s = 0.0
    whitened = engine.problem.split(engine.whiten(noise, refit.residual))
    raw = engine.problem.split(refit.residual)
    for values, residual, test in zip(whitened, raw, engine.tests, strict=True):
        window_s = min(WINDOW_S, test.duration_s / FEWEST_WINDOWS)
        size = max(2, round(window_s / test.block_s))
        longest_s = max(longest_s, size * test.block_s)
        scales = scales_of(engine.problem.loggers, test)
        by_sensor = (test.by_sensor(rows) for rows in (values, residual, test.is_observed))
        for channel, scale, white, rest, seen in zip(
            (WINDING, *test.fitted), scales, *by_sensor, strict=True
        ):
            innovations.append(white[seen])
            lengths.append(test.block_s)
            num = int(seen.sum()) // size
            if num:
                means = rest[seen][: num * size].reshape(num, size).mean(axis=1)
                slow.setdefault(channel, []).append(means)
                variance = variance_of_mean(noise.scaled(scale), test.block_s, size)
                expected.setdefault(channel, []).append(np.full(num, variance))
    excess, is_excessive = low_frequency_excess(innovations, lengths)
    plain = plain_noise(engine, refit)
    is_slow = float(plain.sd) > RELEVANT_SHARE * float(plain.total())
    misfit = {
        channel: float(np.mean(np.concatenate(slow[channel]) ** 2)
                       - np.mean(np.concatenate(expected[channel])))
        for channel in slow
    }  # fmt: skip
    worst = max(misfit, key=lambda channel: misfit[channel], default=WINDING)
    return Adequacy(
        excess=excess,
        is_excessive=is_excessive,
        correlation_s=float(plain.time) if is_slow else 0.0,
        misfit_K=float(np.sqrt(max(misfit.get(worst, 0.0), 0.0))),
        rmse_K=rmse(refit.residual[engine.sensors[worst]]),
        window_s=longest_s,
        noise_K=float(noise.total()),
        closed_K=closed_K,
        channel=worst,
        winding_rmse_K=rmse(refit.residual[engine.sensors[WINDING]]),
    )


ENOUGH_VISIBLE = 0.5
"""Share of the heat effects that tests must be able to show for "nothing is missing" to mean
anything [1]: half of them. One constant load shows 14 to 38 %, a staircase 52 % and more."""


@dataclass(frozen=True)
class Verdict:
    """What is concluded."""

    word: VerdictWord  # One of the five verdicts.
    sentence: str  # What it means here.


def verdict(
    asked: Found, screened: SmallEffects | None, before: Adequacy, after: Adequacy, command: str
) -> Verdict:
    """Return the verdict."""
    ids = asked.ids
    names = effects_in_words(ids, asked.allowed_for)
    if ids and after.is_adequate:
        tied = {each.id: asked.tied(each) for each in asked.core.effects if asked.tied(each)}
        if tied:
            told = "; ".join(
                f"{name} or {', '.join(f'{o.id} ({100.0 * p:.0f} %)' for o, p in others.items())}"
                for name, others in tied.items()
            )
            return Verdict(
                "ambiguous", f"Missing is {names}; these tests do not tell apart: {told}."
            )
        return Verdict(
            "named",
            f"Missing: {names}. So extended, the network leaves {after.rmse_K:.2f} K in a fit by "
            "least squares, no more than noise.",
        )
    if ids:
        return Verdict(
            "unexplained",
            f"{names}{',' * bool(asked.allowed_for)} explain "
            f"{before.misfit_K - after.misfit_K:.2f} of {before.misfit_K:.2f} K of slow misfit and "
            f"stay in the model; {after.words} is left that no effect of the catalogue accounts "
            f"for. Next: {command}",
        )
    if not before.is_adequate:
        return Verdict(
            "unexplained",
            f"The network leaves {before.words} that no effect of the catalogue accounts for. "
            f"Next: {command}",
        )
    scores = () if screened is None else screened.sights
    heat = [s for s in scores if s.candidate.kind.card.family != "sensor"]
    visible = sum(s.is_visible for s in heat) / max(1, len(heat))
    if visible < ENOUGH_VISIBLE:
        return Verdict(
            "not_identifiable",
            f"No missing effect is seen, but these tests could show only {100 * visible:.0f} % of "
            "the effects: the others are not identifiable from them.",
        )
    return Verdict("adequate", "Nothing is missing that these tests would show.")


@dataclass(frozen=True)
class Discovery:
    """Everything that a discovery found."""

    asked: Found  # Which effects the tests ask for.
    screened: SmallEffects | None  # Which small ones the network may lack.
    # The network alone and with the effects, fitted without unmodelled heat.
    left: tuple[Refit, Refit]
    left_out_K: tuple[float, float]  # Errors of both on parts of the tests left out [K].
    before: Adequacy  # Adequacy of the network alone.
    after: Adequacy  # Adequacy of the network with the effects.
    where_before: Where  # What the network alone misses.
    where_after: Where  # What the network with the effects misses.
    verdict: Verdict  # In a word.
    next_test: NextTest | None  # The test that would separate what is tied; None if nothing is.
    seconds: dict[str, float]  # Time of each stage [s].


def tell(
    asked: Found, screened: SmallEffects | None = None, *, command: str = "", work: Work = SILENT
) -> Discovery:
    """Tell where a network without effects misses its tests, and what the effects change."""
    begun = time.perf_counter()
    work.at("where", "locating what is missing")
    search = asked.search
    none, core = search.fitted[frozenset()], asked.core
    left = search.without_heat(none), search.without_heat(asked.full)
    at_none, engine = search.engine_of(none), search.engine_of(asked.full)
    bare = asked.fits[0].problem.model
    full = bare.extended(each.kind for each in asked.full.effects)
    closed = gap(engine.rms_K(left[0].residual), engine.rms_K(left[1].residual))
    before, after = adequacy(at_none, left[0]), adequacy(engine, left[1], closed)
    where_before = localise(at_none, left[0], bare)
    where_after = localise(engine, left[1], full) if core.effects else where_before
    masks = folds(engine)
    outside = tuple(rmse(left_out_errors(engine, each, masks)) for each in left)
    said = verdict(asked, screened, before, after, command)
    tied = next((each for each in core.effects if asked.tied(each)), None)
    further = None
    if tied is not None:
        rivals = list(asked.tied(tied))
        members = [search.fitted[core.effects - {tied} | {other}] for other in rivals]
        fits = [search.without_heat(member) for member in (core, *members)]
        further = next_test(engine, (tied.id, *(other.id for other in rivals)), fits)
    work.done("where")
    return Discovery(
        asked=asked,
        screened=screened,
        left=left,
        left_out_K=(outside[0], outside[1]),
        before=before,
        after=after,
        where_before=where_before,
        where_after=where_after,
        verdict=said,
        next_test=further,
        seconds={"where": time.perf_counter() - begun},
    )
