"""The work of a batch, in this process or in a worker's: rows of machines, as Parquet bytes."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from heatrun.errors import InputError
from heatrun.runtime import configure

from .batches import Batch, numerics
from .fitting import fit_machines
from .machine import ChangedInputError, Prepared, lost, prepare, row_of
from .parts import part_bytes
from .rows import Row


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
