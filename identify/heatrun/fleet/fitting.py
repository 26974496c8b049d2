"""The fit of the machines of a batch: the one place that chooses how they are fitted."""

from __future__ import annotations

from collections.abc import Sequence

from ..inference.fitting.fit import fit
from ..inference.fitting.fit_result import Fit
from ..inference.problem import Problem


def fit_machines(problems: Sequence[Problem], seed: int) -> list[Fit | Exception]:
    """Return the fit of each problem, or what it raised.

    Args:
        problems: One per machine.
        seed: Of the draws of the starts, the same for each machine, as a single calibration has
            it: a machine's fit does not depend on its place in the fleet.
    """
    return [_one(problem, seed) for problem in problems]


def _one(problem: Problem, seed: int) -> Fit | Exception:
    try:
        return fit(problem, seed=seed, throw=False)
    except MemoryError:
        raise  # of the process, not of the machine
    except Exception as error:  # whatever one machine raises, the others are fitted
        return error
