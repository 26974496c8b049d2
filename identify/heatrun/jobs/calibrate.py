"""A calibration from tests down to its run folder, for commands and notebooks."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..calibration import BenchTest, Calibration, Settings, calibrate, identity, manifest
from ..model.network_text import network_text
from ..record.motor import Motor
from ..reports.of_run import with_sheet
from ..runs.run_folder import RunFolder, free_place, refuse_unwritable
from ..runs.stated_duty import parse_rating
from ..runs.write import write_run
from ..work import Progress, work_of_calibration

Say = Callable[[str], None]


def silent(sentence: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class Place:
    """Where a run goes.

    Attributes:
        path: The run folder; an unfinished run of the same inputs there is taken up, and a
            finished one of the same replaced.
        is_named: Whether the user wants the run there; else it gets a number where another run
            stands.
        is_replacing: Whether another run there is replaced.
    """

    path: Path
    is_named: bool = True
    is_replacing: bool = False

    def begin(self, same: dict[str, Any], say: Say, further: Sequence[str] = ()) -> RunFolder:
        """Return the folder of a run, begun or taken up.

        Args:
            same: What makes an unfinished run the same as this one.
            say: Told that an unfinished run is taken up, where that is so.
            further: What else stands in the result.
        """
        path = self.path
        if not self.is_named and not self.is_replacing:
            path = free_place(path, same, further)
        folder = RunFolder.begin(path, same, further=further, is_replacing=self.is_replacing)
        if folder.note:
            say(folder.note)
        return folder


def calibrate_into(
    place: Place,
    motor: Motor,
    tests: Sequence[BenchTest],
    settings: Settings,
    *,
    say: Say = silent,
    progress: Progress | None = None,
) -> tuple[Calibration, Path]:
    """Calibrate networks on tests and write the run folder with its sheet.

    Args:
        place: Where it goes.
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        settings: What is asked.
        say: Told that an unfinished run is taken up, where that is so.
        progress: Called with a sentence and the share done, 1 when the folder is there.

    Returns:
        What was found, and the run folder.

    Raises:
        InputError: If something that a model needs is not given, the folder holds another run, or
            it cannot be written.
    """
    refuse_unwritable(place.path)
    same = identity(
        motor,
        tests,
        networks=[network_text(form) for form in settings.forms],
        effects=[kind.card.id for kind in settings.effects],
        plain=settings.is_plain,
        method=settings.method,
        seed=settings.seed,
    )
    # what the sheet says beside the numbers: a run with other words on it is another result
    stated = motor.certificate.as_section()
    # with what a file says; wrong use is said before anything is fitted
    nodes = [form.nodes for form in settings.forms]
    rated_A = motor.rated_current_A
    duties = [repr(parse_rating(each, 1.0, rated_A, nodes)) for each in settings.duties]
    further = (*duties, *([json.dumps(stated, sort_keys=True)] if stated else []))
    folder = place.begin(same, say, further)
    names = [form.name for form in settings.forms]
    work = work_of_calibration(
        names, len(tests), settings.method, progress, num_ratings=len(settings.duties)
    )
    with work:
        with folder.dropped_if_refused():
            found = calibrate(motor, tests, settings, folder=folder, work=work)
        work.at("writing", "writing the run")
        run = write_run(folder, found.motor, found.result, found.posteriors, found.predictions)
        work.at("writing", "writing the sheet", 0.5)
        found = replace(found, result=with_sheet(run, folder))
        written = folder.finish(manifest(found, settings))
        work.finish()
    return found, written
