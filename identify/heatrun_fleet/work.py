"""The work of a batch, in this process or in a worker's: rows of machines, as Parquet bytes.

`fit_machines` is the one place that chooses how machines are fitted.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from heatrun.arithmetic import refuse_wrong_sums
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.problem import Problem
from heatrun.posterior.fit_checks import holding_heat
from heatrun.runtime import configure

from .batch.fit import fit_batch
from .batch.layout import NotBatched, key_of, why_not
from .batches import Batch, numerics
from .machine import ChangedInputError, Prepared, lost, prepare, row_of
from .parts import part_bytes
from .rows import Row

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


@dataclass(frozen=True)
class Done:
    """A batch that was worked out.

    Attributes:
        name: Of the batch.
        part: Its rows, as a Parquet file.
        timing: What it took, by name: numbers of seconds.
        lost: Machines that workers died on.
        changed: Why the part must not be kept under the batch's name: a file was changed.
    """

    name: str
    part: bytes
    timing: dict[str, Any]
    lost: tuple[str, ...] = ()
    changed: str = ""


def work_out(batch: Batch) -> Done:
    """Return the rows of a batch.

    Args:
        batch: The machines; their files are read from its folder.

    Raises:
        InputError: If versions or settings are others here than where the batch was made.
    """
    configure()
    _refuse_other_numerics(batch)
    begun, begun_processor = time.monotonic(), time.process_time()
    readied: list[Prepared | Row] = []
    reading: list[float] = []
    for entry in batch.entries:
        start = time.process_time()
        try:
            readied.append(prepare(entry, batch))
        except ChangedInputError as error:
            return Done(batch.name, b"", {}, changed=str(error))
        reading.append(time.process_time() - start)
    start = time.process_time()
    places = [i for i, each in enumerate(readied) if isinstance(each, Prepared)]
    problems = [each.problem for each in readied if isinstance(each, Prepared)]
    found = fit_machines(problems, batch.seed, batch.num_planned)
    fits = dict(zip(places, found.fits, strict=True))
    rows = [row_of(each, fits[i], batch) if isinstance(each, Prepared) else each
            for i, each in enumerate(readied)]  # fmt: skip
    fitting = time.process_time() - start
    timing = {
        "machines": [entry.machine for entry in batch.entries],
        "reading_processor_s": [round(each, 3) for each in reading],
        "fitting_processor_s": round(fitting, 3),
        "fitted_alone": {
            batch.entries[places[place]].machine: why for place, why in found.alone.items()
        },
        "processor_s": round(time.process_time() - begun_processor, 3),
        "wall_s": round(time.monotonic() - begun, 3),
    }
    return Done(batch.name, part_bytes(rows), timing)


def given_up(batch: Batch, deaths: int) -> Done:
    """Return the row of the one machine of a batch on which workers died.

    Args:
        batch: With one machine.
        deaths: How many died.
    """
    (entry,) = batch.entries
    timing = {"machines": [entry.machine], "deaths": deaths}
    return Done(batch.name, part_bytes([lost(entry, batch, deaths)]), timing, (entry.machine,))


def _refuse_other_numerics(batch: Batch) -> None:
    here = numerics()
    for key, expected in batch.numerics.items():
        found = here[key]
        if found == expected:
            continue
        if isinstance(expected, dict):
            key, expected, found = next(
                (f"{key}, {k}", v, found.get(k)) for k, v in expected.items() if found.get(k) != v
            )
        raise InputError(
            f"Expected {key} {expected!r} as where the command runs, a worker has {found!r}.",
            remedy="Install the same packages and set the same variables for the workers: results "
            "must not depend on who works them out.",
        )
