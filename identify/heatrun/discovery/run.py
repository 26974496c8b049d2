"""The whole discovery, stage by stage; each stage can be called and looked at alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..errors import InputError
from ..inference.catalogue import all_effects
from ..inference.fitting.fit_result import Fit
from ..inference.fitting.restricted import estimate_loggers
from ..inference.model import Model
from ..inference.networks import NetworkForm
from ..inference.posterior import Posterior, sample, weighted_draws
from ..inference.predict import Prediction, predict
from ..motor import Motor
from ..work import SILENT, Work
from .extended import extended_fit
from .grow import Growth, grow
from .judging.acceptance import gap
from .judging.final_check import Adequacy, adequacy
from .judging.held_out import HeldOut
from .localise import Where, localise
from .proposed_test import NextTest, next_test
from .rivals import Named, confirmed, settle, without
from .screening.engine import Engine, Refit
from .screening.extension import extended_engine
from .screening.library import Library
from .screening.start import base_start
from .ties import Ties, ties
from .traces import Trace, find_traces
from .verdict import Verdict, verdict

Say = Callable[[str], None]


@dataclass(frozen=True)
class Discovery:
    """Everything that a discovery found.

    Attributes:
        engine: The extended model over the calibration tests.
        library: What was searched.
        growth: How the model grew.
        final: Fit of the final model under the saturated noise.
        named: The effects in it, with their rivals.
        dropped: Effects that were accepted and did not stand in the final model: reason by id.
        before: Adequacy of the base model.
        after: Adequacy of the final model.
        where_before: What the base model misses.
        where_after: What the final model misses.
        verdict: In a word.
        next_test: The test that would separate what is tied; None if nothing is.
        traces: Effects that are there and too small to matter, where the verdict is adequate.
        ties: The effect that these tests do not tell from its rivals, where the verdict is
            ambiguous; None elsewhere.
        fits: Base and final model as fits of their own.
        seconds: Time of each stage [s].
    """

    engine: Engine
    library: Library
    growth: Growth
    final: Refit
    named: list[Named]
    dropped: dict[str, str]
    before: Adequacy
    after: Adequacy
    where_before: Where
    where_after: Where
    verdict: Verdict
    next_test: NextTest | None
    traces: list[Trace]
    ties: Ties | None
    fits: tuple[Fit, Fit]
    seconds: dict[str, float]


@dataclass(frozen=True)
class Shown:
    """Base and final model sampled, and what they predict.

    Attributes:
        posteriors: Of the base and of the final model, the latter averaged over effects that
            the tests do not tell apart.
        with_effects: Of the final model with the accepted effect of such a set.
        predictions: By test, of the base and of the final model.
    """

    posteriors: tuple[Posterior, Posterior]
    with_effects: Posterior
    predictions: list[tuple[Prediction, Prediction]]


def discover(
    motor: Motor,
    tests: Sequence[Blocks],
    *,
    order: str | NetworkForm = "second",
    known: tuple[type[AbstractEffect], ...] = (),
    kinds: Sequence[type[AbstractEffect]] | None = None,
    held_out: Sequence[Blocks] = (),
    seed: int = 0,
    say: Say = lambda sentence: None,
    work: Work = SILENT,
) -> Discovery:
    """Find where simulation and measurement disagree, and what is missing.

    Args:
        motor: The machine.
        tests: Reduced records to calibrate on; measured bodies that are nodes of the network are
            fitted as a calibration fits them.
        order: The base network.
        known: Effects that the base network has.
        kinds: The effects that are searched; by default the catalogue and installed ones.
        held_out: Tests that will be predicted. An effect is searched only if they have what it
            needs, and none is added that predicts one of them worse: they take part in the
            selection, and in nothing else.
        seed: Of everything that is drawn.
        say: Told what is being done.
        work: Told how far it is; as `heatrun.work.work_of_discovery`.

    Raises:
        InputError: If something that the model needs is not given.
    """
    watch = _Watch(work)
    bare = Model.of(order, motor, known).scaled(motor, tests)
    bare.refuse_unusable([*tests, *held_out])
    tests = [bare.with_bodies(test) for test in tests]
    found, engine = extended_engine(bare, motor, tests, kinds or all_effects(), held_out)
    say(f"{bare.title}: fitting the network alone")
    work.at("base fit", f"{bare.title}: fitting the network alone")
    start = base_start(engine, seed=seed)
    if not np.all(np.isfinite(start.residual)) or start.chi2 > 1e9:
        raise InputError(
            "the network cannot be fitted to these tests at all.",
            where=engine.problem.label,
            remedy="Run `heatrun calibrate` on them first: it says what is wrong.",
        )
    of_base = start.z[list(start.free)], start.residual, start.jacobian
    engine = engine.with_loggers(estimate_loggers(engine.problem, *of_base))
    watch.lap("base fit")
    gate = HeldOut(engine, held_out) if held_out else None
    growth = grow(
        engine, found.candidates, start.z, start.noise, held_out=gate, seed=seed,
        say=_told(say, work, "search"),
    )  # fmt: skip
    watch.lap("search")
    before = adequacy(engine, growth.base)
    say("holding what was found against its rivals")
    work.at("rivals", "holding what was found against its rivals")
    excess = adequacy(engine, growth.final).excess
    final, named, dropped = settle(engine, growth, excess, gate)
    watch.lap("rivals")
    base_fit = extended_fit(engine, growth.base.z, ())
    while True:
        after = adequacy(engine, final, gap(engine, growth.anchor, final))
        accepted = [each.rival.candidate for each in named]
        last_fit = base_fit
        if named:
            last_fit = extended_fit(engine, final.z, accepted)
        named, gone = confirmed(named, last_fit)
        if not gone:
            break
        dropped += gone
        for rival in gone:
            final = without(engine, final, rival)
    watch.lap("fits")
    say("locating what is missing")
    work.at("where", "locating what is missing")
    where_before = localise(engine, growth.base, bare)
    where_after = where_before
    if named:
        model = replace(bare, effects=(*bare.effects, *(c.kind for c in accepted)))
        where_after = localise(engine, final, model)
    watch.lap("where")
    traces = find_traces(growth, before.excess) if not named else []
    said = verdict(growth, named, before, after, traces)
    is_ambiguous = said.word == "ambiguous"
    tied = ties(engine, final, named) if is_ambiguous else None
    watch.lap("ties")
    after_test = next_test(engine, final, named) if is_ambiguous else None
    watch.lap("next test")
    return Discovery(
        engine=engine,
        library=found,
        growth=growth,
        final=final,
        named=named,
        dropped={rival.candidate.id: rival.reason for rival in dropped},
        before=before,
        after=after,
        where_before=where_before,
        where_after=where_after,
        verdict=said,
        next_test=after_test,
        traces=traces if said.word == "adequate" else [],
        ties=tied,
        fits=(base_fit, last_fit),
        seconds=watch.laps,
    )


def show(
    found: Discovery,
    tests: Sequence[Blocks],
    *,
    method: Literal["emcee", "quick"] = "emcee",
    seed: int = 0,
    folder: Path | None = None,
    work: Work = SILENT,
) -> Shown:
    """Sample the final model and predict all tests with it and with the base model.

    The base model is there for comparison: weighted draws around its fit will do.

    Args:
        found: What was found.
        tests: All tests, calibration and held out.
        method: Sampler of the final model, as `heatrun.inference.posterior.sample`.
        seed: Of everything that is drawn.
        folder: Where checkpoints go; None for none.
        work: As `discover`.
    """
    watch = _Watch(work)
    work.at("posterior", "sampling the posterior")

    def report(sentence: str, share: float) -> None:
        work.at("posterior", sentence, share)

    if found.ties is None:
        last = sample(found.fits[1], method=method, seed=seed, folder=folder, progress=report)
        with_effects = last
    else:
        with_effects = weighted_draws(found.fits[1], seed=seed)
        last = found.ties.posterior(seed=seed)
    base = weighted_draws(found.fits[0], seed=seed) if found.named else last
    watch.lap("posterior")
    pairs = []
    for number, test in enumerate(tests):
        doing = f"predicting test {number + 1} of {len(tests)}"
        work.at("predictions", doing, number / len(tests))
        first = predict(base, test, seed=seed)
        pairs.append((first, predict(last, test, seed=seed) if found.named else first))
    watch.lap("predictions")
    found.seconds.update(watch.laps)
    return Shown((base, last), with_effects, pairs)


def _told(say: Say, work: Work, part: str) -> Say:
    """Return what says a sentence and tells it as work on a part of unknown length."""
    left = 1.0

    def tell(sentence: str) -> None:
        nonlocal left
        left *= 0.75
        say(sentence)
        work.at(part, sentence, 1.0 - left)

    return tell


class _Watch:
    """Time of the stages, each of which is then done."""

    def __init__(self, work: Work) -> None:
        self._work = work
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._work.done(name)
        self._last = now
