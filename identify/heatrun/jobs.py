"""A calibration or a discovery from bench files to the written folder.

A discovery is a calibration with the story of the missing effects.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from .calibration import BenchTest, Calibration, Settings, calibrate, identity, manifest
from .discovery.discovery import tell
from .discovery.result import assemble
from .errors import InputError
from .io.texts import LANGUAGES, Texts
from .model.catalogue import all_effects
from .model.network_text import network_text
from .posterior.fit_checks import holding_heat
from .posterior.posterior import normal_draws
from .posterior.predict import predict
from .record.findings import OUTPUT_FAILED, Attempts
from .record.motor import Motor
from .results.discovery import DiscoveryResult
from .runs.run_folder import RunFolder, free_place, refuse_unwritable
from .runs.stated_duty import parse_rating
from .runs.write import write_run
from .work import Progress, Work, work_of_calibration, work_of_discovery

Say = Callable[[str], None]


def silent(sentence: str) -> None:
    """Say nothing."""


WRITERS = "heatrun.reports.of_run", "heatrun.reports.discovery", "xarray", "h5netcdf"
"""What draws and writes a run; nothing that is fitted needs it."""


def load_writers() -> None:
    """Load `WRITERS` beside the fit, whose compiled code leaves Python free for half of its time.

    What cannot be loaded says so where it is used.
    """

    def load() -> None:
        for name in WRITERS:
            with suppress(Exception):
                import_module(name)

    Thread(target=load, name="writers").start()


@dataclass(frozen=True)
class Place:
    """Where a run goes."""

    # The run folder; an unfinished run of the same inputs there is taken up, and a finished one of
    # the same replaced.
    path: Path
    # Whether the user wants the run there; else it gets a number where another run stands.
    is_named: bool = True
    is_replacing: bool = False  # Whether another run there is replaced.

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
        load_writers()
        with folder.dropped_if_refused():
            found = calibrate(motor, tests, settings, folder=folder, work=work)
        work.at("writing", "writing the run")
        from .reports.of_run import with_sheet

        run = write_run(folder, found.motor, found.result, found.posteriors, found.predictions)
        work.at("writing", "writing the sheet", 0.5)
        found = replace(found, result=with_sheet(run, folder))
        written = folder.finish(manifest(found, settings))
        work.finish()
    return found, written


@dataclass(frozen=True)
class Job:
    """A discovery with its result and its run folder."""

    calibration: Calibration  # The network with the effects.
    result: DiscoveryResult  # What stands in `discovery.json`.
    path: Path  # The run folder.


def discover_into(
    place: Place,
    motor: Motor,
    tests: Sequence[BenchTest],
    settings: Settings,
    *,
    say: Say = silent,
    progress: Progress | None = None,
) -> Job:
    """Search for missing effects and write the run folder with its reports.

    Args:
        place: Where it goes.
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        settings: What is asked, with the base network alone.
        say: Told that an unfinished run is taken up, where that is so.
        progress: Called with a sentence and the share done, 1 when the folder is there.

    Raises:
        InputError: As `heatrun.jobs.calibrate_into`, or if no effect can be searched.
    """
    refuse_unwritable(place.path)
    (form,) = settings.forms
    files = [[str(p), hashlib.sha256(p.read_bytes()).hexdigest()] for p in settings.files]
    same = identity(
        motor,
        tests,
        command="discover",
        effects=files,
        network=network_text(form),
        known=[kind.card.id for kind in settings.effects],
        method=settings.method,
        seed=settings.seed,
    )
    folder = place.begin(same, say)
    work = work_of_discovery(form.name, len(tests), settings.method, progress)
    with work, folder.dropped_if_refused():
        job = _written(folder, motor, tests, settings, work)
    work.finish()
    return job


def _written(
    folder: RunFolder, motor: Motor, tests: Sequence[BenchTest], settings: Settings, work: Work
) -> Job:
    """Return a discovery whose folder is written."""
    settings = replace(settings, kinds=settings.kinds or all_effects())
    load_writers()
    calibration = calibrate(motor, tests, settings, folder=folder, work=work)
    asked = calibration.asked
    if asked is None:
        raise InputError(
            "the tests have the inputs of none of the effects that are to be searched.",
            where=", ".join(test.record.name for test in tests),
            remedy="Map more channels, such as speed_rpm, or calibrate.",
        )
    found = tell(asked, calibration.screened, command=_next(motor, tests), work=work)
    name = list(calibration.posteriors)[-1]
    if asked.core.effects:  # a network that misses them: what it says is for comparison alone
        base = normal_draws(holding_heat(asked.fits[0], seed=settings.seed), seed=settings.seed)
    else:
        base = calibration.posteriors[name]
    before = [predict(base, test.blocks, seed=settings.seed) for test in tests]
    result = assemble(
        found, calibration, before, base, command=settings.command, seed=settings.seed
    )
    work.at("writing", "writing the report")
    from .reports.discovery import draw_all, write_report
    from .reports.of_run import with_sheet

    folder.write_json("discovery.json", result)
    attempts = Attempts(OUTPUT_FAILED)
    say = Texts(motor.certificate.language or LANGUAGES[0])
    pairs = list(zip(before, calibration.predictions[name], strict=True))
    figures = attempts.of(
        "the figures of the discovery",
        lambda: draw_all(
            pairs,
            [test.role for test in tests],
            [test.blocks for test in tests if test.role == "calibration"],
            found.where_before,
            found.where_after,
            folder.partial / "discovery",
            say,
        ),
        [],
    )
    attempts.of(
        "the report of the discovery",
        lambda: write_report(result, figures, folder.partial / "discovery.pdf", say),
        None,
    )
    whole = replace(
        calibration.result,
        findings=(*calibration.result.findings, *attempts.findings),
        verdict=replace(calibration.result.verdict, sentence=found.verdict.sentence),
    )
    calibration = replace(calibration, result=whole)
    run = write_run(
        folder, calibration.motor, whole, calibration.posteriors, calibration.predictions
    )
    work.at("writing", "writing the sheet", 0.6)
    calibration = replace(calibration, result=with_sheet(run, folder))
    path = folder.finish(manifest(calibration, settings))
    return Job(calibration, result, path)


def _next(motor: Motor, tests: Sequence[BenchTest]) -> str:
    """Return the command that looks at what is left with a body more."""
    files = " ".join(source.path for test in tests for source in test.record.sources)
    return f"heatrun discover {motor.path or 'MOTOR.toml'} {files} --model three"
