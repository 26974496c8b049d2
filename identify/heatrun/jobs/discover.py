"""A discovery from bench files to a run folder: a calibration, and the story of its effects."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..attempts import OUTPUT_FAILED, Attempts
from ..calibration import BenchTest, Calibration, Settings, calibrate, identity, manifest
from ..discovery.discovery import tell
from ..discovery.result import assemble
from ..errors import InputError
from ..io.texts import LANGUAGES, Texts
from ..model.catalogue import all_effects
from ..model.network_text import network_text
from ..posterior.fit_checks import holding_heat
from ..posterior.posterior import normal_draws
from ..posterior.predict import predict
from ..record.motor import Motor
from ..reports.discovery import write_report
from ..reports.discovery_figures import draw_all
from ..reports.of_run import with_sheet
from ..results.discovery import DiscoveryResult
from ..runs.run_folder import RunFolder, refuse_unwritable
from ..runs.write import write_run
from ..work import Progress, Work, work_of_discovery
from .calibrate import Place, Say, silent


@dataclass(frozen=True)
class Job:
    """A discovery with its result and its run folder.

    Attributes:
        calibration: The network with the effects.
        result: What stands in `discovery.json`.
        path: The run folder.
    """

    calibration: Calibration
    result: DiscoveryResult
    path: Path


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
        InputError: As `heatrun.jobs.calibrate.calibrate_into`, or if no effect can be searched.
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
