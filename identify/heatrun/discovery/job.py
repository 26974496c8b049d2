"""A discovery from bench files to a run folder: a calibration, and the story of its effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from lptn.effects import AbstractEffect

from ..attempts import OUTPUT_FAILED, Attempts
from ..calibration import BenchTest, Calibration, calibrate, manifest
from ..errors import InputError
from ..inference.catalogue import all_effects
from ..inference.networks import NetworkForm
from ..inference.posterior import weighted_draws
from ..inference.predict import predict
from ..motor import Motor
from ..reports.discovery.figures import draw_all
from ..reports.discovery.report import write_report
from ..reports.sheet.of_run import with_sheet
from ..results.discovery import DiscoveryResult
from ..runs.run_folder import RunFolder
from ..runs.write import write_run
from ..work import SILENT, Work
from .result import assemble
from .run import tell


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


def run_job(
    motor: Motor,
    tests: Sequence[BenchTest],
    folder: RunFolder,
    *,
    order: str | NetworkForm = "second",
    known: tuple[type[AbstractEffect], ...] = (),
    kinds: Sequence[type[AbstractEffect]] | None = None,
    method: Literal["emcee", "quick"] = "emcee",
    seed: int = 0,
    command: str = "",
    work: Work = SILENT,
) -> Job:
    """Run a discovery and write its folder.

    Args:
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        folder: Where the result goes.
        order: The base network.
        known: Effects that the base network has.
        kinds: Effects that are searched; by default the catalogue and installed ones.
        method: Sampler of the final model.
        seed: Of everything that is drawn.
        command: As it is to stand in the result.
        work: Told how far it is; as `heatrun.work.work_of_discovery`.

    Raises:
        InputError: If something that the model needs is not given, or no effect can be searched.
    """
    calibration = calibrate(
        motor, tests, networks=(order,), effects=known, kinds=kinds or all_effects(),
        method=method, seed=seed, command=command, folder=folder, work=work,
    )  # fmt: skip
    asked = calibration.asked
    if asked is None:
        raise InputError(
            "the tests have the inputs of none of the effects that are to be searched.",
            where=", ".join(test.record.name for test in tests),
            remedy="Map more channels, such as speed_rpm, or calibrate.",
        )
    found = tell(asked, calibration.screened, command=_next(motor, tests), work=work)
    base = weighted_draws(asked.fits[0], seed=seed)
    before = [predict(base, test.blocks, seed=seed) for test in tests]
    result = assemble(found, calibration, before, base, command=command, seed=seed)
    work.at("writing", "writing the report")
    folder.write_json("discovery.json", result)
    attempts = Attempts(OUTPUT_FAILED)
    name = list(calibration.posteriors)[-1]
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
        ),
        [],
    )
    attempts.of(
        "the report of the discovery",
        lambda: write_report(result, figures, folder.partial / "discovery.pdf"),
        None,
    )
    whole = replace(
        calibration.result,
        findings=(*calibration.result.findings, *attempts.findings),
        verdict=replace(calibration.result.verdict, sentence=found.verdict.sentence),
    )
    calibration = replace(calibration, result=whole)
    run = write_run(folder, motor, whole, calibration.posteriors, calibration.predictions)
    work.at("writing", "writing the sheet", 0.6)
    calibration = replace(calibration, result=with_sheet(run, folder))
    path = folder.finish(manifest(calibration, command, seed))
    return Job(calibration, result, path)


def _next(motor: Motor, tests: Sequence[BenchTest]) -> str:
    """Return the command that looks at what is left with a body more."""
    files = " ".join(source.path for test in tests for source in test.record.sources)
    return f"heatrun discover {motor.path or 'MOTOR.toml'} {files} --model three"
