"""Which effects of the catalogue the tests ask for: networks with none, one, two, more of them.

An effect alone needs an absurd size exactly where a second one is missing too, and a network that
misses both bends its instruments towards them. So effects are not let in one at a time. All that
the tests have the inputs for start together, at soft priors about their usual sizes, the
instruments at their own priors, and what the evidence does not ask for is taken out again. Around
a fit the model is linear in the scores (`linear`): the evidence of thousands of sets costs one
linearisation. The best of them are fitted, each with a noise of its own, and the search goes on
around the best until no neighbour is better.

References: D. J. C. MacKay, Bayesian interpolation, Neural Computation 4 (1992) 415-447. J. A.
    Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky, Bayesian model averaging: a tutorial,
    Statistical Science 14 (1999) 382-417.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from ..fit.restricted import estimate_loggers, estimate_noise, log_evidence
from ..model.discrepancy import no_heat, with_heat
from ..model.noise import Loggers, Noise, from_scores
from ..model.parameters import qualified
from .engine import ROUGHLY, Candidate, Engine, Refit, white
from .linear import Linear

Set = frozenset[Candidate]

ODDS = 1.0 / 9.0
"""Of an effect being there, before the tests have spoken [1]; an event shares them among tests."""

ROUGH_K = 1.0
"""White noise of a first fit [K]."""

MOST_EVALUATIONS = 12
"""Most evaluations of a refit; they start near the optimum."""

MOST_ROUNDS = 20
"""Rounds of linearising and fitting around one start."""

NUM_SETTLED, SETTLED = 3, 0.05
"""Rounds of noise and least squares for a set, and the change of the noise's scores at which they
end [1]."""

HOPELESS = 3.0
"""Times what the last round has gained that a set may be behind another, to be fitted on [1]."""

LOST = 35.0
"""Log Bayes factor for a set of fewer effects that no effect without use costs [nat]: one of five
parameters that the tests hold to a thousandth of their priors."""

MOST_RIVALS, MOST_SETTLED = 2, 4
"""Rivals of each effect of the final set that are fitted, and how often one of them may take its
place."""

LONGEST_S, UNLIMITED_S = 60.0, 2000.0
"""Correlation over longer than the first is no noise while causes are sought, and no noise reaches
the second [s]."""

MATTERS_K = 0.05
"""Gap that an effect in the model closes at least [K]: less is within the errors of instruments."""

EXPLAINS = 0.5
"""Share of what an effect explains, in mean squares, that a rival explains at least [1]."""

COARSE = 0.5
"""Share of the evidence that counts for what is in the model [1]: what the laws of the effects
leave open of a real machine is of the size of the noise that is left, and no noise."""

POSSIBLE = 0.05
"""Probability from which on another set is told as possible [1]."""


@dataclass(frozen=True)
class Member:
    """The network with a set of effects, fitted with a noise of its own."""

    effects: Set  # The set.
    free: tuple[int, ...]  # Slots that are fitted.
    # Scores of all slots, NaN for those of absent effects, shape (slot,).
    z: Float[np.ndarray, " slot"]
    noise_z: Float[np.ndarray, " noise"]  # Scores of noise and unmodelled heat.
    loggers: Loggers  # Noise of each logger.
    # Measured minus modelled block means, all tests in a row [K].
    residual: Float[np.ndarray, " block"]
    # Its derivative by the free slots [K per score], shape (block, free).
    jacobian: Float[np.ndarray, "block free"]
    log_evidence: float  # Marginal likelihood, up to what all sets share [nat].
    log_weight: float  # The same with the odds of the effects before the tests have spoken [nat].

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of its effects, in alphabetical order."""
        return tuple(sorted({each.id for each in self.effects}))


@dataclass
class Search:
    """Sets of effects that have been fitted, and the means to fit more."""

    # The network with all effects, none of which is searched by its parameters' roles.
    engine: Engine
    candidates: Sequence[Candidate]  # Those that may be absent.
    # Slots of the network without them; by default all that are none of theirs.
    base: tuple[int, ...] = ()
    fitted: dict[Set, Member] = field(default_factory=dict)  # The best fit of each set.
    _reached: dict[Set, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.own = {each: slots(self.engine, each) for each in self.candidates}
        of_effects = {slot for own in self.own.values() for slot in own}
        rest = tuple(i for i in range(len(self.engine.slots)) if i not in of_effects)
        self.base = self.base or rest

    def log_odds(self, effects: Iterable[Candidate]) -> float:
        """Return the log odds of a set against none, before the tests have spoken [nat]."""
        shared = len(self.engine.tests)
        return sum(float(np.log(ODDS / (shared if e.test is not None else 1))) for e in effects)

    def free(self, effects: Collection[Candidate]) -> tuple[int, ...]:
        """Return the slots of a network with a set of effects."""
        return (*self.base, *sorted(slot for each in effects for slot in self.own[each]))

    def placed(self, z: np.ndarray, effects: Collection[Candidate]) -> np.ndarray:
        """Return scores of which just the effects of a set are there, new ones at their centres."""
        after = z.copy()
        for each, own in self.own.items():
            at = list(own)
            after[at] = np.nan_to_num(after[at]) if each in effects else np.nan
        return after

    def fit(
        self,
        effects: Set,
        z: np.ndarray,
        near: Member | None = None,
        rival: Member | None = None,
    ) -> Member:
        """Fit a set of effects from scores, and return the best fit of that set so far.

        More effects explain no less. A fit that is left far behind one of fewer effects has lost
        its way, to where a step of the network is not stable for example: it is begun again there.

        Args:
            effects: The set.
            z: Scores to start from.
            near: Fit whose noise is started from.
            rival: What the set is held against; where it stays far behind, it is not fitted on.
        """
        found = self._fitted(effects, z, near, rival)
        fewer = [each for each in self.fitted.values() if each.effects < effects]
        surest = max(fewer, key=lambda each: each.log_evidence, default=found)
        if surest.log_evidence - found.log_evidence > LOST:
            found = self._fitted(effects, surest.z, surest, rival)
        return found

    def _fitted(
        self, effects: Set, z: np.ndarray, near: Member | None, rival: Member | None
    ) -> Member:
        free = self.free(effects)
        z = self.placed(z, effects)
        noise_z = None if near is None else near.noise_z
        noise = white(ROUGH_K) if noise_z is None else from_scores(noise_z)
        if near is not None:
            self.engine = self.engine.with_loggers(near.loggers)
        evidence, is_far, found = -np.inf, False, None
        for _ in range(NUM_SETTLED):
            found = self.engine.refit(z, free, noise, most=MOST_EVALUATIONS, fall=ROUGHLY)
            z, before = found.z, noise_z
            self.engine = heated(self.engine, z)
            linear = z[list(free)], found.residual, found.jacobian
            loggers = estimate_loggers(self.engine.problem, *linear, start=before)
            self.engine = self.engine.with_loggers(loggers)
            noise_z = estimate_noise(self.engine.problem, *linear, start=before)
            noise = from_scores(noise_z)
            if before is not None and np.max(np.abs(noise_z - before)) < SETTLED:
                break
            if rival is not None:
                reached = log_evidence(self.engine.problem, noise_z, *linear)
                gained, evidence = reached - evidence, reached
                if is_far := rival.log_evidence - evidence > HOPELESS * gained:
                    break
        assert found is not None
        assert noise_z is not None
        if not is_far:
            found = self.engine.refit(z, free, noise, most=MOST_EVALUATIONS)
            linear = found.z[list(free)], found.residual, found.jacobian
            evidence = log_evidence(self.engine.problem, noise_z, *linear)
        if np.isnan(evidence):  # a network that left the numbers is the least probable one
            evidence = -np.inf
        member = Member(
            effects, free, found.z, noise_z, self.engine.problem.loggers, found.residual,
            found.jacobian, evidence, evidence + self.log_odds(effects),
        )  # fmt: skip
        known = self.fitted.get(effects)
        if known is None or member.log_weight > known.log_weight:
            self.fitted[effects] = member
        return self.fitted[effects]

    @property
    def best(self) -> Member:
        """The most probable set so far."""
        return max(self.fitted.values(), key=lambda each: each.log_weight)

    def climb(self, centre: Member) -> None:
        """Go where steps by the linear evidence lead, as far as a fit confirms them."""
        tried: dict[Candidate, np.ndarray] = {}
        for _ in range(MOST_ROUNDS):
            linear = self.linear(centre, tried)
            path = self._path(centre.effects, linear)
            # where the steps end, halfway there, and the first one: the best that a fit confirms
            for effects in dict.fromkeys(
                [path[-1], path[len(path) // 2], path[min(1, len(path) - 1)]]
            ):
                after = self.fitted.get(effects)
                if after is None:
                    after = self.fit(effects, linear.scores(effects), centre)
                if after.log_weight > centre.log_weight:
                    break
            else:
                break
            centre = after

    def engine_of(self, member: Member) -> Engine:
        """Return the engine with the noise of each logger and the unmodelled heat of a fit."""
        return heated(self.engine.with_loggers(member.loggers), member.z)

    def linear(self, centre: Member, tried: dict[Candidate, np.ndarray] | None = None) -> Linear:
        """Return the linear model around a fitted set.

        Args:
            centre: The set.
            tried: As of `Linear`.
        """
        tried = {} if tried is None else tried
        return Linear(self.engine_of(centre), self.own, self.base, centre, tried)

    def _path(self, effects: Set, linear: Linear) -> list[Set]:
        """Return the sets of single steps uphill in the linear evidence."""

        def weight(each: Set) -> float:
            return linear.log_evidence(each) + self.log_odds(each)

        path = [effects]
        for _ in range(MOST_ROUNDS + len(effects)):
            best = max(neighbours(path[-1], self.candidates), key=weight)
            if weight(best) <= weight(path[-1]):
                break
            path.append(best)
        return path

    def run(self, z: np.ndarray) -> Member:
        """Search from all effects and from none, and return the best set.

        Args:
            z: Scores of the network alone to start from.
        """
        self.fit(frozenset(), z)
        for start in (frozenset(self.candidates), frozenset()):
            self.climb(self.fitted.get(start) or self.fit(start, np.zeros_like(z)))
        return self.best

    def reached_K(self, member: Member) -> float:
        """Return the error that least squares under white noise reaches with a fitted set [K].

        From its scores, or from the network alone where that is nearer: more effects explain no
        less.
        """
        effects = member.effects
        if effects in self._reached:
            return self._reached[effects]
        free, alone = self.free(effects), self.fitted[frozenset()].z
        starts = [self.placed(each, effects) for each in (member.z, alone)]
        off_K = [self.engine.rms_K(self.engine.linearise(each, ())[0]) for each in starts]
        nearest = starts[int(np.argmin(off_K))]
        found = self.engine.with_loggers(member.loggers).refit(
            nearest, free, white(ROUGH_K), most=MOST_EVALUATIONS, fall=ROUGHLY
        )
        self._reached[effects] = self.engine.rms_K(found.residual)
        return self._reached[effects]

    def coarse(self, member: Member) -> float:
        """Return the log weight of a set where the evidence counts by a share only [nat].

        No law is an exact copy of the machine's.

        Reference: J. W. Miller, D. B. Dunson, Robust Bayesian inference via coarsening, Journal of
            the American Statistical Association 114 (2019) 1113-1125.
        """
        return COARSE * member.log_evidence + self.log_odds(member.effects)

    def fewer(self, member: Member) -> list[Member]:
        """Return the fits of a fitted set without each of its effects."""
        return [self._without(member, member.effects - {each}) for each in member.effects]

    def _without(self, member: Member, effects: Set) -> Member:
        return self.fitted.get(effects) or self.fit(effects, member.z, member, member)

    def _spare(
        self, member: Member, is_wanted: Callable[[Member, Member], bool], kept: Set = frozenset()
    ) -> Member | None:
        """Return the fit without an effect that is not wanted, None where all are: tried in the
        order of the linear evidence, so that of a dozen effects not each is fitted without.
        """
        sets = [member.effects - {each} for each in member.effects - kept]
        if not sets:
            return None
        linear = self.linear(member)
        weights = {s: COARSE * linear.log_evidence(s) + self.log_odds(s) for s in sets}
        for effects in sorted(sets, key=lambda each: -weights[each]):
            fewer = self._without(member, effects)
            if not is_wanted(member, fewer):
                return fewer
        return None

    def is_wanted(self, member: Member, fewer: Member) -> bool:
        """Return whether what a set has beside one of fewer effects is wanted in the model."""
        if self.coarse(member) <= self.coarse(fewer):
            return False
        return gap(self.reached_K(fewer), self.reached_K(member)) > MATTERS_K

    def explains(self, rival: Member, member: Member, without: Member) -> bool:
        """Return whether a rival explains what an effect of a set does, for its greater part."""
        own, bare, of_rival = (self.reached_K(each) for each in (member, without, rival))
        return of_rival**2 - own**2 < (1.0 - EXPLAINS) * max(bare**2 - own**2, MATTERS_K**2)

    def settled(self, member: Member) -> tuple[Member, dict[Set, float]]:
        """Return the set near one that the coarse evidence asks for, and its rivals.

        Effects that it does not ask for, or that close next to nothing, are taken out one by one,
        the least first. What these had taken up may speak for a rival of another one then.

        Args:
            member: The most probable set.
        """
        for _ in range(MOST_SETTLED + len(member.effects)):
            spare = self._spare(member, self.is_wanted)
            if spare is not None:
                member = spare
                continue
            around = self.around(member)
            best = self.fitted[max(around, key=lambda each: around[each])]
            if best.effects == member.effects:
                return best, around
            member = best
        return member, self.around(member)

    def around(self, member: Member) -> dict[Set, float]:
        """Return the sets that the tests do not tell from a fitted one, with probabilities [1].

        They have one effect less, or another in the place of one that explains much the same. A
        rival is tried where it explains most without the effect: beside it, its twin explains
        nothing. The best by the linear evidence are fitted.

        Args:
            member: The set, which is among them.
        """
        here = member.effects
        others = []
        for without in self.fewer(member):
            fewer = without.effects
            # under the noise of the set: without the effect, what it does is unmodelled heat
            linear = self.linear(replace(without, noise_z=member.noise_z, loggers=member.loggers))
            rivals = [fewer | {one} for one in self.candidates if one not in here]
            weights = {one: linear.log_evidence(one) + self.log_odds(one) for one in rivals}
            for rival in sorted(rivals, key=lambda one: -weights[one])[:MOST_RIVALS]:
                if rival not in self.fitted:
                    self.fit(rival, linear.scores(rival), member, member)
            tried = [self.fitted[rival] for rival in rivals if rival in self.fitted]
            others += [fewer, *(r.effects for r in tried if self.explains(r, member, without))]
        fitted = [here, *others]
        found = np.array([self.coarse(self.fitted[each]) for each in fitted])
        shares = np.exp(found - np.logaddexp.reduce(found))
        return dict(zip(fitted, shares.tolist(), strict=True))

    def decided(self, core: Member, around: dict[Set, float]) -> tuple[Member, dict[Set, float]]:
        """Return which of the sets that the coarse evidence leaves possible is in the model.

        All of the evidence decides: it is the one that the most probable set holds.

        Args:
            core: The set that the coarse evidence asks for.
            around: Its rivals with their probabilities, as `around`.
        """
        here = core.effects
        rivals = [each for each, p in around.items() if p > POSSIBLE and not each < here]
        chosen = max([here, *rivals], key=lambda each: self._holding(each).log_weight)
        if chosen == here:
            return core, around
        return self.fitted[chosen], self.around(self.fitted[chosen])

    def _holding(self, effects: Set) -> Member:
        """Return the most probable of the fitted sets that hold one."""
        holding = (each for each in self.fitted.values() if each.effects >= effects)
        return max(holding, key=lambda each: each.log_weight)

    def fullest(self, core: Member) -> Member:
        """Return the most probable of the fitted sets that hold one; of none, the empty one.

        It goes without what closes nothing of the gap, all of that together. However little the
        rest closes, left out it would be in the parameters, and in each prediction.
        """
        if not core.effects:
            return core
        full = self._holding(core.effects)
        reached_K = self.reached_K(full)

        def closes(_: Member, fewer: Member) -> bool:
            return self.reached_K(fewer) > reached_K

        while (fewer := self._spare(full, closes, core.effects)) is not None:
            full = fewer
        return full

    def without_heat(self, member: Member) -> Refit:
        """Return a set fitted with noise of up to a minute alone, so that what is slow is left."""
        engine = self.engine.with_loggers(member.loggers)
        engine = engine.with_heat(no_heat(engine.problem))
        found = engine.refit(member.z, member.free, white(ROUGH_K))
        for _ in range(2):
            noise = plain_noise(engine, found, longest_s=LONGEST_S)
            found = engine.refit(found.z, member.free, noise)
        return found


def heated(engine: Engine, z: Float[np.ndarray, " slot"]) -> Engine:
    """Return an engine with what unmodelled heat does at scores, those of absent effects NaN."""
    heat = with_heat(engine.problem, np.nan_to_num(z)).heat
    assert heat is not None
    return engine.with_heat(heat)


def plain_noise(engine: Engine, present: Refit, *, longest_s: float = UNLIMITED_S) -> Noise:
    """Return the noise that a fit leaves, its parameters integrated out.

    Args:
        engine: The tests.
        present: The fit.
        longest_s: Longest correlation time that counts as noise [s].
    """
    linear = present.z[list(present.free)], present.residual, present.jacobian
    scores = estimate_noise(engine.problem, *linear, longest_s=longest_s)
    return from_scores(scores)


def gap(before_K: float, after_K: float) -> float:
    """Return what is closed of a gap: the root of the difference of mean squares [K]."""
    return float(np.sqrt(max(before_K**2 - after_K**2, 0.0)))


def neighbours(effects: Set, candidates: Sequence[Candidate]) -> list[Set]:
    """Return the sets with one effect less, one more, or one exchanged."""
    others = [each for each in candidates if each not in effects]
    less = [effects - {each} for each in effects]
    more = [effects | {each} for each in others]
    return [*less, *more, *(smaller | {each} for smaller in less for each in others)]


def slots(engine: Engine, candidate: Candidate) -> tuple[int, ...]:
    """Return the slots of an effect."""
    found = (
        engine.find(qualified(candidate.kind, name), candidate.test)
        for name in candidate.kind.card.parameters
    )
    return tuple(slot for slot in found if slot is not None)
