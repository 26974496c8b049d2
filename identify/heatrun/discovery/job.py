"""A discovery from bench files to a run folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from lptn.effects import AbstractEffect

from ..attempts import OUTPUT_FAILED, Attempts
from ..bench import Finding
from ..bench.checks import current_scale_unchecked
from ..calibration import BenchTest, Calibration, describe_tests, manifest
from ..inference.networks import NetworkForm
from ..motor import Motor
from ..reports.discovery.figures import draw_all
from ..reports.discovery.report import write_report
from ..reports.sheet.of_run import with_sheet
from ..results.discovery import DiscoveryResult
from ..results.values import Role
from ..runs.result import assemble as assemble_fit
from ..runs.result import describe_model
from ..runs.run_folder import RunFolder
from ..runs.write import write_run
from ..work import SILENT, Work
from .result import assemble
from .run import Discovery, Shown, discover, show


@dataclass(frozen=True)
class Job:
    """A discovery with its result and its run folder.

    Attributes:
        found: What was found.
        shown: Posteriors and predictions.
        result: What stands in `discovery.json`.
        path: The run folder.
    """

    found: Discovery
    shown: Shown
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
    say: Callable[[str], None] = lambda sentence: None,
    work: Work = SILENT,
) -> Job:
    """Run a discovery and write its folder.

    Args:
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        folder: Where the result goes.
        order: The base network.
        known: Effects that the base network has.
        kinds: As `heatrun.discovery.run.discover`.
        method: Sampler of the final model.
        seed: Of everything that is drawn.
        command: As it is to stand in the result.
        say: Told what is being done.
        work: Told how far it is; as `heatrun.work.work_of_discovery`.
    """
    fitted = [test.blocks for test in tests if test.role == "calibration"]
    held_out = [test.blocks for test in tests if test.role == "holdout"]
    found = discover(
        motor, fitted, order=order, known=known, kinds=kinds, held_out=held_out, seed=seed, say=say,
        work=work,
    )  # fmt: skip
    say(f"{found.verdict.word}: sampling the model as it is now")
    shown = show(
        found, [test.blocks for test in tests], method=method, seed=seed,
        folder=folder.checkpoints, work=work,
    )  # fmt: skip
    roles: list[Role] = [test.role for test in tests]
    result = assemble(found, shown, roles, command=command, seed=seed)
    say("writing report and sheet")
    work.at("writing", "writing report and sheet")
    folder.write_json("discovery.json", result)
    attempts = Attempts(OUTPUT_FAILED)
    figures = attempts.of(
        "the figures of the discovery",
        lambda: draw_all(
            shown.predictions, roles, fitted, found.where_before, found.where_after,
            folder.partial / "discovery",
        ),
        [],
    )  # fmt: skip
    attempts.of(
        "the report of the discovery",
        lambda: write_report(result, figures, folder.partial / "discovery.pdf"),
        None,
    )
    name = found.fits[1].problem.model.name
    final = _as_calibration(motor, tests, found, shown, name, command, seed, attempts.findings)
    run = write_run(folder, motor, final.result, final.posteriors, final.predictions)
    work.at("writing", "writing the sheet", 0.6)
    with_sheet(run, folder)
    return Job(found, shown, result, folder.finish(manifest(final, command, seed)))


def _as_calibration(
    motor: Motor,
    tests: Sequence[BenchTest],
    found: Discovery,
    shown: Shown,
    network: str,
    command: str,
    seed: int,
    further: Sequence[Finding],
) -> Calibration:
    """Return the final model as a calibration, for its parameter sheet."""
    posterior = shown.posteriors[1]
    predictions = [after for _, after in shown.predictions]
    roles: list[Role] = [test.role for test in tests]
    attempts = Attempts()
    rows, reduced = describe_tests(posterior.fit, tests, motor, attempts)
    findings = [finding for test in tests for finding in test.findings]
    findings += current_scale_unchecked(motor, [test.record for test in tests])
    findings += [*posterior.fit.findings, *reduced]
    models = {network: describe_model(posterior, predictions, roles, attempts=attempts)}
    findings += [*attempts.findings, *further]
    result = assemble_fit(
        motor, rows, findings, models, {network: predictions}, command=command, seed=seed
    )
    in_set = None if found.ties is None else found.ties.named
    accepted = tuple(each.rival.candidate.id for each in found.named if each is not in_set)
    verdict = result.verdict
    if found.named:
        words = posterior.fit.problem.model.words
        parts = [f"with {' and '.join(accepted)}"] if accepted else []
        if in_set is not None:
            parts.append(f"averaged over {' and '.join(in_set.ids)}")
        sentence = (
            f"{words[0].upper()}{words[1:]} {', '.join(parts)}, as the discovery left "
            f"it. {found.verdict.sentence}"
        )
        verdict = replace(verdict, sentence=sentence)
    result = replace(result, verdict=verdict, effects=accepted)
    return Calibration(motor, tuple(tests), {network: posterior}, {network: predictions}, result)
