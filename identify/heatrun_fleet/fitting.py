"""The fit of the machines of a batch: the one place that chooses how they are fitted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from heatrun.arithmetic import refuse_wrong_sums
from heatrun.inference.fitting.fit import fit
from heatrun.inference.fitting.fit_result import Fit
from heatrun.inference.fitting.held_heat import holding_heat
from heatrun.inference.problem import Problem

from .batch.fit import fit_batch
from .batch.layout import NotBatched, key_of, why_not

FEWEST = 16
"""Machines of one kind in a batch from which on they are fitted together: half the width of a
compiled program, which takes as long to compile as ten machines to fit."""

TOO_FEW = "too few machines of its kind in the batch"


class Fitted(NamedTuple):
    """What came of the fits of a batch.

    Attributes:
        fits: The fit of each problem, or what it raised.
        alone: Why a problem was fitted by itself, by its place; the others were fitted together.
    """

    fits: list[Fit | Exception]
    alone: dict[int, str]


def fit_machines(problems: Sequence[Problem], seed: int, num_planned: int) -> Fitted:
    """Return the fit of each problem.

    Machines fitted together get the numbers that each gets alone, to a relative 1e-6 and mostly far
    closer; the same numbers to the last bit whatever stands beside them.

    Args:
        problems: One per machine.
        seed: Of the draws of the starts, the same for each machine, as a single calibration has
            it: a machine's fit does not depend on its place in the fleet.
        num_planned: Machines that the batch was planned with. One of them that is worked out
            alone, after workers died on the batch, is fitted as it would have been there.

    Raises:
        InputError: If compiled sums are wrong here, which is no fault of a machine's.
    """
    refuse_wrong_sums()
    alone = _alone(problems, num_planned)
    together = [place for place in range(len(problems)) if place not in alone]
    found: dict[int, Fit] = {}
    try:
        batch = fit_batch([problems[place] for place in together], seed=seed)
    except MemoryError:
        raise  # of the process, not of a machine
    except Exception as error:  # of one machine, which its own fit will tell
        alone |= dict.fromkeys(together, f"{type(error).__name__}: {error}"[:300])
    else:
        for place, result in zip(together, batch, strict=True):
            if isinstance(result, NotBatched):
                alone[place] = result.reason
            else:
                found[place] = result
    fits = [_one(problem, found.get(place), seed) for place, problem in enumerate(problems)]
    return Fitted(fits, alone)


def _alone(problems: Sequence[Problem], num_planned: int) -> dict[int, str]:
    """Return the problems that are not fitted together with others, and why."""
    if num_planned < FEWEST:
        return dict.fromkeys(range(len(problems)), TOO_FEW)
    alone = {place: reason for place, each in enumerate(problems) if (reason := why_not(each))}
    if len(problems) > 1:
        keys = {place: key_of(p) for place, p in enumerate(problems) if place not in alone}
        count = Counter(keys.values())
        alone |= {place: TOO_FEW for place, key in keys.items() if count[key] < FEWEST}
    return alone


def _one(problem: Problem, found: Fit | None, seed: int) -> Fit | Exception:
    """Return the fit of one, or that of the batch, that follows its tests."""
    try:
        return holding_heat(found or fit(problem, seed=seed, throw=False), seed=seed)
    except MemoryError:
        raise
    except Exception as error:  # whatever one machine raises, the others are fitted
        return error
