"""What a calibration misses without its effects, told: where, what, how much of the gap is closed.

The search itself is that of every calibration (`heatrun.effects`); nothing here decides anything
anew.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from ..effects.engine import Refit
from ..effects.extension import with_effects
from ..effects.found import Found
from ..effects.missing import Missing
from ..effects.search import gap
from ..work import SILENT, Work
from .adequacy import Adequacy, adequacy
from .folds import folds, left_out_errors, rmse
from .localise import Where, localise
from .proposed_test import NextTest, next_test
from .verdict import Verdict, verdict


@dataclass(frozen=True)
class Discovery:
    """Everything that a discovery found.

    Attributes:
        asked: Which effects the tests ask for.
        screened: Which small ones the network may lack.
        left: The network alone and with the effects, fitted without unmodelled heat.
        left_out_K: Errors of both on parts of the tests left out [K].
        before: Adequacy of the network alone.
        after: Adequacy of the network with the effects.
        where_before: What the network alone misses.
        where_after: What the network with the effects misses.
        verdict: In a word.
        next_test: The test that would separate what is tied; None if nothing is.
        seconds: Time of each stage [s].
    """

    asked: Found
    screened: Missing | None
    left: tuple[Refit, Refit]
    left_out_K: tuple[float, float]
    before: Adequacy
    after: Adequacy
    where_before: Where
    where_after: Where
    verdict: Verdict
    next_test: NextTest | None
    seconds: dict[str, float]


def tell(
    asked: Found, screened: Missing | None = None, *, command: str = "", work: Work = SILENT
) -> Discovery:
    """Tell where a network without effects misses its tests, and what the effects change.

    Args:
        asked: Which effects the tests ask for.
        screened: Which small ones the network may lack.
        command: What to call next where something is left.
        work: Told how far it is.
    """
    begun = time.perf_counter()
    work.at("where", "locating what is missing")
    search = asked.search
    none, core = search.fitted[frozenset()], asked.core
    left = search.without_heat(none), search.without_heat(core)
    engine = search.engine
    bare = asked.fits[0].problem.model
    full = with_effects(bare, [each.kind for each in core.effects])
    closed = gap(engine.rms_K(left[0].residual), engine.rms_K(left[1].residual))
    before, after = adequacy(engine, left[0]), adequacy(engine, left[1], closed)
    where_before = localise(engine, left[0], bare)
    where_after = localise(engine, left[1], full) if core.effects else where_before
    masks = folds(engine)
    outside = tuple(rmse(left_out_errors(engine, each, masks)) for each in left)
    said = verdict(asked, screened, before, after, command)
    tied = next((each for each in core.effects if asked.tied(each)), None)
    further = None
    if tied is not None:
        rivals = list(asked.tied(tied))
        members = [search.fitted[core.effects - {tied} | {other}] for other in rivals]
        fits = [left[1], *(search.without_heat(member) for member in members)]
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
