"""What a search for effects has found: the network that the tests ask for, and its rivals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lptn.effects import AbstractEffect

from ..fit.fit import RIVAL, SAME_OPTIMUM, distinct, finished, sharing
from ..fit.fit_result import Fit
from ..fit.restricted import estimate_loggers, estimate_noise
from ..io.programs import refuse_wrong_sums
from ..model.catalogue import all_effects
from ..model.discrepancy import with_heat
from ..model.model import Model
from ..model.noise import from_scores
from ..model.parameters import collect
from ..model.problem import Problem
from ..posterior.fit_checks import holding_heat
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.record import Finding
from .engine import Candidate, Engine, Library, Refit, library, ruled_out
from .search import POSSIBLE, Member, Search, Set


def with_catalogue(
    model: Model,
    motor: Motor,
    tests: Sequence[Blocks],
    kinds: Sequence[type[AbstractEffect]] | None = None,
    held_out: Sequence[Blocks] = (),
) -> tuple[Library, Model]:
    """Return the effects that tests allow to be searched, and the model with all of them.

    Args:
        model: Network with its known effects.
        motor: The machine.
        tests: Reduced records to calibrate on.
        kinds: The effects that are wanted; by default the catalogue and installed ones.
        held_out: Tests that must have what an effect needs too.
    """
    wanted = [kind for kind in kinds or all_effects() if kind not in model.effects]
    blocked = ruled_out(wanted, motor)
    usable = library(
        [kind for kind in wanted if kind.card.id not in blocked],
        model.topology(),
        [*tests, *held_out],
        num_events=len(tests),
    )
    usable = replace(usable, unavailable={**usable.unavailable, **blocked})
    return usable, model.extended(usable.kinds)


NUM_DRAWS = 4000
"""Draws over the sets that the tests do not tell apart."""

ROUNDS, SETTLED = 6, 0.02
"""Most rounds of noise and least squares, and the change of all scores at which they end [prior
standard deviations]."""

FAR = 4.0
"""How far from an optimum another one is looked for [standard deviations of its linear model]."""

MOST_FROM_FAR = 25
"""Of a search from there."""


@dataclass(frozen=True)
class Found:
    """Networks with effects, each fitted and weighed by its evidence."""

    library: Library  # What was searched, and what could not be.
    search: Search  # The fitted sets.
    best: Member  # The most probable set.
    core: Member  # The set near it that the coarse evidence asks for: these effects are named.
    # The core, and the sets that could be in its place, with probabilities [1].
    around: Mapping[Set, float]
    # The most probable set that holds the core, which is in the model: what it has beside the core
    # the tests ask for, though not beyond doubt. Left out, it would be taken up by the network's
    # parameters.
    full: Member
    # The network alone and the network with the full set, as fits that can be sampled.
    fits: tuple[Fit, Fit]

    @property
    def fit(self) -> Fit:
        """The network that the tests ask for."""
        return self.fits[1]

    @property
    def by_evidence(self) -> list[Candidate]:
        """The effects that are named, the strongest first."""
        return sorted(self.core.effects, key=lambda each: -self.log_bayes(each))

    @property
    def ids(self) -> tuple[str, ...]:
        """Their ids."""
        return tuple(dict.fromkeys(each.id for each in self.by_evidence))

    @property
    def allowed_for(self) -> tuple[str, ...]:
        """Ids of the effects in the model that are not named, in alphabetical order."""
        return tuple(sorted({each.id for each in self.full.effects} - set(self.ids)))

    def probability(self, effect: Candidate) -> float:
        """Return the probability of an effect of the core, among what could be in its place [1]."""
        return sum(p for effects, p in self.around.items() if effect in effects)

    def rivals(self, effect: Candidate) -> dict[Candidate, float]:
        """Return the effects that may be there in place of one, with probabilities [1]."""
        found: dict[Candidate, float] = {}
        for effects, p in self.around.items():
            if effect not in effects:
                for other in effects - self.core.effects:
                    found[other] = found.get(other, 0.0) + p
        return dict(sorted(found.items(), key=lambda each: -each[1]))

    def tied(self, effect: Candidate) -> dict[Candidate, float]:
        """Return those of its rivals that the tests do not tell from an effect."""
        return {each: p for each, p in self.rivals(effect).items() if p > POSSIBLE}

    def log_bayes(self, effect: Candidate) -> float:
        """Return the log Bayes factor of the core over the core without an effect [nat]."""
        fewer = self.search.fitted[self.core.effects - {effect}]
        return self.core.log_evidence - fewer.log_evidence

    def undecided(self, *, seed: int = 0) -> tuple[Model, dict[str, np.ndarray]] | None:
        """Return the network with all effects, and draws of its parameters by name [their units],
        over the sets that tests do not tell apart; None where they tell one.

        Args:
            seed: Of the draws.
        """
        if not any(self.tied(each) for each in self.core.effects):
            return None
        rng = np.random.default_rng([seed, 31])
        engine = self.search.engine
        of_set = rng.multinomial(NUM_DRAWS, [*self.around.values()])
        rows = []
        for effects, num in zip(self.around, of_set, strict=True):
            member = self.search.fitted[effects]
            free = list(member.free)
            at_fit = self.search.engine_of(member)
            columns = at_fit.whiten(from_scores(member.noise_z), member.jacobian)
            factor = np.linalg.cholesky(
                np.linalg.inv(columns.T @ columns + np.eye(columns.shape[1]))
            )
            drawn = member.z[free] + rng.standard_normal((num, len(free))) @ factor.T
            rows.append(np.tile(member.z, (num, 1)))
            low, high = engine.bounds(free)
            at = member.z[free]
            rows[-1][:, free] = np.clip(drawn, np.minimum(low, at), np.maximum(high, at))
        return engine.problem.model, engine.draws_in_general(np.concatenate(rows))

    @property
    def familywise_p(self) -> float:
        """Bound of the chance that clean tests ask as loudly for any effects [1].

        Where the network alone is true, the mean Bayes factor of any mixture of others is 1, so
        that it exceeds a number with at most one over that number as its chance (Markov).
        """
        none = self.search.fitted[frozenset()]
        return float(min(1.0, np.exp(min(0.0, none.log_weight - self.best.log_weight))))


def find(
    model: Model,
    motor: Motor,
    tests: Sequence[Blocks],
    *,
    kinds: Sequence[type[AbstractEffect]] | None = None,
    held_out: Sequence[Blocks] = (),
    start: Fit | None = None,
) -> Found | None:
    """Search for the effects that tests ask for; None where no effect can be searched.

    Args:
        model: Network with its known effects.
        motor: The machine.
        tests: Reduced records to calibrate on.
        kinds: The effects that are searched; by default the catalogue and installed ones.
        held_out: Tests that must have what an effect needs too.
        start: Fit of the network alone, if there is one.
    """
    refuse_wrong_sums()
    usable, extended = with_catalogue(model, motor, tests, kinds, held_out)
    if not usable.candidates:
        return None
    engine = Engine(Problem.of(extended, motor, tests))
    engine = engine.with_loggers(start.problem.loggers if start else {})
    search = Search(engine, usable.candidates)
    z = search.placed(np.zeros(len(engine.slots)), ())
    if start is not None:
        for score, slot in zip(start.z, start.slots, strict=True):
            place = engine.find(slot.parameter.name, slot.test)
            if place is not None:
                z[place] = score
    best = search.run(z)
    core, around = search.decided(*search.settled(best))
    full = search.fullest(core)
    alone = start or as_fit(search, search.fitted[frozenset()], model)
    chosen = as_fit(search, full, model) if full.effects else alone
    return Found(usable, search, best, core, around, full, (alone, chosen))


def asked_findings(found: Found, *, is_plain: bool) -> list[Finding]:
    """Return what is to be said of the effects that tests ask for, and of those kept out.

    Args:
        found: The search.
        is_plain: Whether the network was left without them.
    """
    return [*_in_some_tests(found), *_of_the_core(found, is_plain=is_plain)]


def _of_the_core(found: Found, *, is_plain: bool) -> list[Finding]:
    """Return what is said of the effects that are named."""
    if not found.core.effects:
        return []
    alone, chosen = found.fits
    problem = chosen.problem
    told = ", ".join(
        f"{each.id} ({100.0 * found.probability(each):.0f} %)" for each in found.by_evidence
    )
    before, after = (fit.stats["rmse_white_K"] for fit in (alone, chosen))
    gap = f"error {before:.2f} K without, {after:.2f} K with"
    if is_plain:
        return [
            Finding(
                id="effects_left_out",
                severity="warning",
                message=f"the tests ask for {told}, which --plain leaves out: {gap} them.",
                where=problem.label,
                remedy="Calibrate without --plain.",
            ),
        ]
    beside = ""
    if found.allowed_for:
        beside = (
            f" The model allows for {', '.join(found.allowed_for)} too: with that the tests are "
            "more probable, though not beyond doubt."
        )
    ambiguous = [
        Finding(
            id="effect_ambiguous",
            severity="warning",
            message=f"these tests do not tell {each.id} "
            f"({100.0 * found.probability(each):.0f} %) from "
            + ", ".join(f"{other.id} ({100.0 * p:.0f} %)" for other, p in tied.items())
            + f": {each.id} is in the model; the network's 95 % intervals allow for the others.",
            where=problem.label,
            remedy=f"To tell them apart: {each.kind.card.separating_test}. Where the cause is "
            "known, name it with --with.",
            values={each.id: found.probability(each), **{o.id: p for o, p in tied.items()}},
        )
        for each in found.core.effects
        if (tied := found.tied(each))
    ]
    return [
        *ambiguous,
        Finding(
            id="effects_in_model",
            severity="note",
            message=f"the tests ask for {told}: these are in the model ({gap} them).{beside}",
            where=problem.label,
            remedy="Use the parameters together with the effects; --plain calibrates without.",
        ),
    ]


def _in_some_tests(found: Found) -> list[Finding]:
    """Return which channels some of the tests lack, so that no test is searched for effects."""
    return [
        Finding(
            id="channel_in_some_tests",
            severity="warning",
            message=f"{', '.join(without)} has no {channel}, which other tests have: effects that "
            f"need it are sought in none ({', '.join(ids)}).",
            where=found.fits[1].problem.label,
            remedy=f"State it: {channel} under [constants] holds for a test that has no such "
            "column (a speed is 0 where the rotor stood). Or calibrate without that test.",
        )
        for (channel, without), ids in found.library.in_some.items()
    ]


def as_fit(search: Search, member: Member, model: Model) -> Fit:
    """Return the network with a set of effects as a fit that can be sampled.

    Where unmodelled heat would keep it from tests that least squares follows, that is held down by
    `heatrun.posterior.fit_checks.holding_heat`.

    Args:
        search: What was searched.
        member: The set.
        model: The network without the effects.
    """
    full = search.engine.problem
    chosen = model.extended(each.kind for each in member.effects)
    problem = Problem.of(chosen, full.motor, full.tests)
    owners = {each.id: [o.test for o in member.effects if o.id == each.id]
              for each in member.effects if each.test is not None}  # fmt: skip
    by_test = [
        {
            name: replace(parameter, fixed=parameter.centre)
            if index not in owners.get(name.partition(".")[0], [index])
            else parameter
            for name, parameter in parameters.items()
        }
        for index, parameters in enumerate(problem.parameters.by_test)
    ]
    problem = replace(
        problem,
        parameters=collect([test.name for test in full.tests], by_test),
        loggers=member.loggers,
    )
    reached_K = search.reached_K(member)

    def fitted(problem: Problem) -> Fit:
        return _settled(search, problem, member, reached_K)

    return holding_heat(fitted(problem), refit=fitted)


def _settled(search: Search, problem: Problem, member: Member, reached_K: float) -> Fit:
    """Return the fit after rounds of noise, unmodelled heat and least squares, from the found
    optimum and from where the tests hold the network least: a slow winding behind a fast sensor
    and a fast one behind a slow sensor, for example, read much alike.
    """
    engine = search.engine
    order = [engine.find(s.parameter.name, s.test) for s in problem.parameters.slots]
    slots = [slot for slot in order if slot is not None]
    problem, found, noise_z, shift = _alternated(engine, problem, slots, member.z, member.noise_z)
    at_noise = engine.with_noise_of(problem)
    others = [
        at_noise.refit(start, slots, from_scores(noise_z), MOST_FROM_FAR)
        for start in _least_held(at_noise, found, noise_z)
    ]
    nearest = min([found, *others], key=lambda each: each.chi2)
    if nearest.chi2 < found.chi2 - 2.0 * SAME_OPTIMUM:
        others.append(found)
        problem, found, noise_z, shift = _alternated(engine, problem, slots, nearest.z, noise_z)
    rivals = [each.z[slots] for each in others if each.chi2 < found.chi2 + 2.0 * RIVAL]
    z = found.z[slots]
    return finished(
        problem, z, noise_z, found.residual, found.jacobian,
        sharing(problem, noise_z, distinct([z, *rivals])),
        is_converged=shift < 10 * SETTLED,
        stats={"rmse_white_K": reached_K},
    )  # fmt: skip


def _alternated(
    engine: Engine, problem: Problem, slots: Sequence[int], z: np.ndarray, noise_z: np.ndarray
) -> tuple[Problem, Refit, np.ndarray, float]:
    """Alternate noise, unmodelled heat and least squares until no score moves; return the problem,
    the optimum, the scores of the noise and the last change of the scores.
    """
    residual, jacobian = engine.linearise(z, slots)
    found, shift = None, np.inf
    for _ in range(ROUNDS):
        problem = with_heat(problem, z[slots])
        linear = z[slots], residual, jacobian
        problem = replace(problem, loggers=estimate_loggers(problem, *linear, start=noise_z))
        noise_z = estimate_noise(problem, *linear, start=noise_z)
        found = engine.with_noise_of(problem).refit(z, slots, from_scores(noise_z))
        shift = float(np.max(np.abs(found.z[slots] - z[slots])))
        z, residual, jacobian = found.z, found.residual, found.jacobian
        if shift < SETTLED:
            break
    assert found is not None
    return problem, found, noise_z, shift


def _least_held(engine: Engine, found: Refit, noise_z: np.ndarray) -> list[np.ndarray]:
    """Return scores far out on both sides along the combination of the network's parameters that
    the tests hold least, the others following by the linear model.
    """
    free = list(found.free)
    columns = engine.whiten(from_scores(noise_z), found.jacobian)
    covariance = np.linalg.inv(columns.T @ columns + np.eye(len(free)))
    network = [i for i, slot in enumerate(free) if engine.slots[slot].parameter.role == "network"]
    width, ways = np.linalg.eigh(covariance[np.ix_(network, network)])
    out = covariance[:, network] @ ways[:, -1] / np.sqrt(width[-1])
    starts = [found.z.copy(), found.z.copy()]
    for start, side in zip(starts, (-FAR, FAR), strict=True):
        start[free] += side * out
    return starts
