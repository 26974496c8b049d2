"""Work that ends the worker it runs in, for tests of what happens then; no machine is fitted."""

import os
import signal
from pathlib import Path

from heatrun_fleet.fleet_file import Batch
from heatrun_fleet.machine import Done
from heatrun_fleet.rows import REFUSED, part_bytes, unfitted

ALWAYS, ONCE = "M003", "M001"


def rows_or_death(batch: Batch) -> Done:
    """Return rows without a fit; die at `ALWAYS`, and at `ONCE` the first time."""
    machines = [entry.machine for entry in batch.entries]
    if ALWAYS in machines:
        os.kill(os.getpid(), signal.SIGKILL)
    mark = Path(batch.folder) / "died"
    if ONCE in machines and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return rows_alone(batch)


def rows_alone(batch: Batch) -> Done:
    """Return rows without a fit."""
    machines = [entry.machine for entry in batch.entries]
    rows = [unfitted(entry, "second", REFUSED, (), ()) for entry in batch.entries]
    return Done(batch.name, part_bytes(rows), {"machines": machines})
