"""A calibration or a discovery from tests down to its run folder, for commands and notebooks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from lptn.effects import AbstractEffect

from ..calibration import BenchTest, Calibration, calibrate, identity, manifest
from ..model.network_form import NetworkForm
from ..model.network_text import network_text
from ..record.motor import Motor
from ..reports.of_run import with_sheet
from ..runs.run_folder import RunFolder, free_place, refuse_unwritable
from ..runs.write import write_run
from ..work import Progress, work_of_calibration, work_of_discovery
from .discover import Job, run_job

Method = Literal["emcee", "quick"]
Say = Callable[[str], None]


def _silent(sentence: str) -> None:
    """Say nothing."""


def calibrate_into(
    path: Path,
    motor: Motor,
    tests: Sequence[BenchTest],
    networks: Sequence[NetworkForm],
    *,
    effects: tuple[type[AbstractEffect], ...] = (),
    method: Method = "emcee",
    seed: int = 0,
    command: str = "",
    duties: Sequence[str] = (),
    is_plain: bool = False,
    is_named: bool = True,
    is_replacing: bool = False,
    say: Say = _silent,
    progress: Progress | None = None,
) -> tuple[Calibration, Path]:
    """Calibrate networks on tests and write the run folder with its sheet.

    Args:
        path: The run folder; an unfinished run of the same inputs there is taken up, and a
            finished one of the same replaced.
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        networks: What is calibrated.
        effects: Known effects that each network has.
        method: As `heatrun.posterior.posterior.sample`.
        seed: Random seed.
        command: As it is to stand in the result.
        duties: Ratings asked for, as `heatrun.runs.ratings_figures.derive`.
        is_plain: As `heatrun.calibration.calibrate`.
        is_named: Whether `path` is where the user wants the run; else it gets a number where
            another run stands there.
        is_replacing: Whether another run at `path` is replaced.
        say: Told that an unfinished run is taken up, where that is so.
        progress: Called with a sentence and the share done, 1 when the folder is there.

    Returns:
        What was found, and the run folder.

    Raises:
        InputError: If something that a model needs is not given, the folder holds another run, or
            it cannot be written.
    """
    refuse_unwritable(path)
    same = identity(
        motor,
        tests,
        networks=[network_text(form) for form in networks],
        effects=[kind.card.id for kind in effects],
        plain=is_plain,
        method=method,
        seed=seed,
    )
    # what the sheet says beside the numbers: a run with other words on it is another result
    stated = motor.certificate.as_section()
    further = (*duties, *([json.dumps(stated, sort_keys=True)] if stated else []))
    if not is_named and not is_replacing:
        path = free_place(path, same, further)
    folder = RunFolder.begin(path, same, further=further, is_replacing=is_replacing)
    if folder.note:
        say(folder.note)
    work = work_of_calibration([form.name for form in networks], len(tests), method, progress)
    with work:
        with folder.dropped_if_refused():
            found = calibrate(
                motor, tests, networks=networks, effects=effects, method=method, seed=seed,
                command=command, duties=duties, is_plain=is_plain, folder=folder, work=work,
            )  # fmt: skip
        work.at("writing", "writing the run")
        run = write_run(folder, motor, found.result, found.posteriors, found.predictions)
        work.at("writing", "writing the sheet", 0.5)
        found = replace(found, result=with_sheet(run, folder))
        written = folder.finish(manifest(found, command, seed))
        work.finish()
    return found, written


def discover_into(
    path: Path,
    motor: Motor,
    tests: Sequence[BenchTest],
    network: NetworkForm,
    *,
    kinds: Sequence[type[AbstractEffect]],
    known: tuple[type[AbstractEffect], ...] = (),
    files: Sequence[Path] = (),
    method: Method = "emcee",
    seed: int = 0,
    command: str = "",
    is_named: bool = True,
    is_replacing: bool = False,
    say: Say = _silent,
    progress: Progress | None = None,
) -> Job:
    """Search for missing effects and write the run folder with its reports.

    Args:
        path: As `calibrate_into`.
        motor: The machine.
        tests: From `heatrun.calibration.load_tests`.
        network: The base network.
        kinds: The effects that are searched.
        known: Effects that the base network has.
        files: Python files that some of the effects came from.
        method: As `calibrate_into`.
        seed: Random seed.
        command: As it is to stand in the result.
        is_named: As `calibrate_into`.
        is_replacing: As `calibrate_into`.
        say: Told that an unfinished run is taken up, where that is so.
        progress: Called with a sentence and the share done, 1 when the folder is there.

    Raises:
        InputError: As `calibrate_into`.
    """
    refuse_unwritable(path)
    same = identity(
        motor,
        tests,
        command="discover",
        effects=[[str(p), hashlib.sha256(p.read_bytes()).hexdigest()] for p in files],
        network=network_text(network),
        known=[kind.card.id for kind in known],
        method=method,
        seed=seed,
    )
    if not is_named and not is_replacing:
        path = free_place(path, same)
    folder = RunFolder.begin(path, same, is_replacing=is_replacing)
    if folder.note:
        say(folder.note)
    work = work_of_discovery(network.name, len(tests), method, progress)
    with work, folder.dropped_if_refused():
        job = run_job(
            motor, tests, folder, order=network, known=known, kinds=kinds, method=method,
            seed=seed, command=command, work=work,
        )  # fmt: skip
    work.finish()
    return job
