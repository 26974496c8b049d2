"""The work of a batch, in this process or in a worker's: machines to rows, as Parquet bytes.

A machine goes from its files to a problem that can be fitted, or to the finding that forbids it.
`fit_machines` is the one place that chooses how machines are fitted.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from heatrun.calibration import Refused, load_tests, refuse_unplaced_bodies, with_scales_of
from heatrun.checks import current_scale_unchecked
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import RESULT, Fit
from heatrun.io.programs import refuse_wrong_sums
from heatrun.model.catalogue import known_effects
from heatrun.model.draws import Draws
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.fit_checks import holding_heat
from heatrun.posterior.predict import predict
from heatrun.record.blocks import Blocks
from heatrun.record.motor import Motor
from heatrun.record.record import Finding
from heatrun.runtime import configure

from .batch.fit import TOO_FEW, NotBatched, fit_batch
from .entries import Entry
from .fleet_file import Batch, digest_or_none, files_by_role, numerics, resolved
from .rows import FAILED, REFUSED, Row, effect_columns, fitted, part_bytes, unfitted
from .shared_effects.pooled import evidence_of

NUM_DRAWS = 400
"""Draws behind the band of a held-out test."""


class ChangedInputError(InputError):
    """A file holds other bytes than when the batch got its name."""


@dataclass(frozen=True)
class Prepared:
    """A machine that can be fitted. Its records are no longer held: a batch has many machines."""

    entry: Entry  # The machine.
    problem: Problem  # Model and tests.
    duration_s: float  # Length of the fitted records in all [s].
    # Records that are predicted only: name, and what they were reduced to.
    holdout: tuple[tuple[str, Blocks], ...]
    findings: tuple[Finding, ...]  # About its rows and records.
    inputs: tuple[Row, ...]  # Its files, for the row.


def prepare(entry: Entry, batch: Batch) -> Prepared | Row:
    """Read and check the tests of a machine.

    Returns:
        What can be fitted, or the row of a machine that is refused.

    Raises:
        ChangedInputError: If a file is another than when the batch was made.
    """
    inputs, name = _inputs(entry, batch), batch.network.name
    if entry.is_refused:
        return unfitted(entry, name, REFUSED, entry.findings, inputs)
    try:
        return _prepared(entry, batch, inputs)
    except (ChangedInputError, MemoryError):
        raise
    except Exception as error:  # the other machines are worked out all the same
        gone = not all(each["sha256"] for each in inputs)
        status, found = _said(error, "missing_file" if gone else "input_error")
    if status == REFUSED:  # what a file held meanwhile is no reason
        for _, path in files_by_role(entry, batch.folder):
            now = digest_or_none(Path(batch.folder) / path)
            _refuse_changed(now, batch.digests[path], path)
    return unfitted(entry, name, status, _placed([*entry.findings, *found], batch.folder), inputs)


def row_of(prepared: Prepared, found: Fit | Exception, batch: Batch) -> Row:
    """Return the row of a machine after its fit, or after what that raised."""
    entry = prepared.entry
    if isinstance(found, Fit):
        try:
            holdout = [_predicted(found, *each, batch.seed) for each in prepared.holdout]
            own = replace(found, findings=_placed(found.findings, batch.folder))
            row = fitted(entry, own, prepared.findings, prepared.inputs,
                         duration_s=prepared.duration_s, holdout=holdout)  # fmt: skip
            if batch.discovers and found.result is not RESULT.no_start:
                row |= effect_columns(evidence_of(found))
            return row
        except MemoryError:
            raise
        except Exception as error:
            found = error
    status, said = _said(found)
    findings = [*prepared.findings, *_placed(said, batch.folder)]
    return unfitted(entry, batch.network.name, status, findings, prepared.inputs)


def _inputs(entry: Entry, batch: Batch) -> tuple[Row, ...]:
    return tuple(
        {"path": path, "role": role, "sha256": batch.digests[path]}
        for role, path in files_by_role(entry, batch.folder)
    )


def _prepared(entry: Entry, batch: Batch, inputs: tuple[Row, ...]) -> Prepared:
    motor_path = Path(batch.folder) / entry.motor
    motor = _motor(str(motor_path), batch.digests[entry.motor])
    _refuse_changed(motor.sha256, batch.digests[entry.motor], entry.motor)
    fits, predicted = ([resolved(test, batch.folder) for test in tests]
                       for tests in (entry.tests, entry.holdout))  # fmt: skip
    tests = load_tests(motor, fits, predicted)
    motor = with_scales_of(tests, motor)
    planned = {each["sha256"] for each in inputs}
    for source in (source for test in tests for source in test.record.sources):
        if source.sha256 not in planned:
            _refuse_changed(source.sha256, "", source.path)
    reduced = [test.blocks for test in tests if test.role == "calibration"]
    effects = known_effects(motor, ",".join(batch.effects))
    model = Model.of(batch.network, motor, effects).scaled(motor, reduced)
    refuse_unplaced_bodies(motor, [model])
    model.refuse_unusable([test.blocks for test in tests])
    problem = Problem.of(model, motor, [model.with_bodies(rows) for rows in reduced])
    findings = [finding for test in tests for finding in test.findings]
    findings += current_scale_unchecked(motor, [test.record for test in tests])
    return Prepared(
        entry=entry,
        problem=problem,
        duration_s=float(sum(t.record.duration_s for t in tests if t.role == "calibration")),
        holdout=tuple((t.record.name, t.blocks) for t in tests if t.role == "holdout"),
        findings=(*entry.findings, *_placed(findings, batch.folder)),
        inputs=inputs,
    )


@lru_cache(maxsize=64)
def _motor(path: str, sha256: str) -> Motor:
    """Return a motor file, read once for all machines that name it."""
    return load_motor(path)


def _refuse_changed(now: str, planned: str, path: str) -> None:
    if now != planned:
        raise ChangedInputError(
            "The file was changed while the fleet was worked out.",
            where=path,
            remedy="Wait until it is whole; the same command goes on from what was finished.",
        )


def _predicted(fit: Fit, name: str, blocks: Blocks, seed: int) -> tuple[str, float, float]:
    """Return name, RMSE [K] and coverage [1] of a held-out test, by draws around the fit."""
    problem = fit.problem
    rng = np.random.default_rng(seed)
    size = fit.vector.size
    root = np.linalg.cholesky(fit.covariance + 1e-12 * np.eye(size))
    vectors = fit.vector + rng.standard_normal((NUM_DRAWS, size)) @ root.T
    draws = Draws(problem.model, problem.motor, problem.parameters, vectors, None, problem.loggers)
    predicted = predict(draws, blocks, num_draws=NUM_DRAWS, seed=seed)
    return name, predicted.rmse_K, predicted.coverage_95()


def _said(error: Exception, id: str = "input_error") -> tuple[str, Sequence[Finding]]:
    """Return the state of a machine after an error, and what is to be said of it."""
    if isinstance(error, Refused):
        return REFUSED, error.findings
    if isinstance(error, InputError):
        return REFUSED, [Finding(id, "error", error.problem, error.where, error.remedy)]
    finding = Finding(
        "internal_error",
        "error",
        f"the machine could not be worked out ({type(error).__name__}: {str(error)[:300]}).",
        remedy="Calibrate it by itself with `heatrun calibrate` and report what that says.",
    )
    return FAILED, [finding]


def _placed(findings: Sequence[Finding], folder: str) -> tuple[Finding, ...]:
    """Return findings whose files are named as in the fleet file, wherever that lies."""
    base = f"{folder}/"

    def placed(text: str) -> str:
        return text.replace(base, "")

    return tuple(
        replace(f, message=placed(f.message), where=placed(f.where), remedy=placed(f.remedy))
        for f in findings
    )


FEWEST = 16
"""Machines of one kind in a batch from which on they are fitted together: half the width of a
compiled program, which takes as long to compile as ten machines to fit."""


class Fitted(NamedTuple):
    """What came of the fits of a batch."""

    fits: list[Fit | Exception]  # The fit of each problem, or what it raised.
    # Why a problem was fitted by itself, by its place; the others were fitted together.
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
    batch: list[Fit | NotBatched] = [NotBatched(TOO_FEW)] * len(problems)
    if num_planned >= FEWEST:
        try:
            batch = fit_batch(problems, seed=seed, fewest=FEWEST if len(problems) > 1 else 1)
        except MemoryError:
            raise  # of the process, not of a machine
        except Exception as error:  # of one machine, which its own fit will tell
            reason = NotBatched(f"{type(error).__name__}: {error}"[:300])
            batch = [reason] * len(problems)
    return Fitted(
        [_one(problem, found, seed) for problem, found in zip(problems, batch, strict=True)],
        {place: each.reason for place, each in enumerate(batch) if isinstance(each, NotBatched)},
    )


def _one(problem: Problem, found: Fit | NotBatched, seed: int) -> Fit | Exception:
    """Return the fit of one, or that of the batch, that follows its tests."""
    try:
        own = fit(problem, seed=seed, throw=False) if isinstance(found, NotBatched) else found
        return holding_heat(own, seed=seed)
    except MemoryError:
        raise
    except Exception as error:  # whatever one machine raises, the others are fitted
        return error


@dataclass(frozen=True)
class Done:
    """A batch that was worked out."""

    name: str  # Of the batch.
    part: bytes  # Its rows, as a Parquet file.
    timing: dict[str, Any]  # What it took, by name: numbers of seconds.
    lost: tuple[str, ...] = ()  # Machines that workers died on.
    changed: str = ""  # Why the part must not be kept under the batch's name: a file was changed.


def work_out(batch: Batch) -> Done:
    """Return the rows of a batch; the files of its machines are read from its folder.

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
    ready = [each for each in readied if isinstance(each, Prepared)]
    found = fit_machines([each.problem for each in ready], batch.seed, batch.num_planned)
    fits = iter(found.fits)
    rows = [row_of(each, next(fits), batch) if isinstance(each, Prepared) else each
            for each in readied]  # fmt: skip
    timing = {
        "machines": [entry.machine for entry in batch.entries],
        "reading_processor_s": [round(each, 3) for each in reading],
        "fitting_processor_s": round(time.process_time() - start, 3),
        "fitted_alone": {ready[place].entry.machine: why for place, why in found.alone.items()},
        "processor_s": round(time.process_time() - begun_processor, 3),
        "wall_s": round(time.monotonic() - begun, 3),
    }
    return Done(batch.name, part_bytes(rows), timing)


def given_up(batch: Batch, deaths: int) -> Done:
    """Return the row of the one machine of a batch on which so many worker processes died."""
    (entry,) = batch.entries
    finding = Finding(
        "worker_lost",
        "error",
        f"the worker process ended {deaths} times while it worked on this machine alone, most "
        "likely for lack of memory.",
        remedy="Give fewer workers (--workers 1) or more memory (--memory), or shorter records; "
        "the same command tries this machine again.",
    )
    row = unfitted(entry, batch.network.name, FAILED, [*entry.findings, finding],
                   _inputs(entry, batch))  # fmt: skip
    timing = {"machines": [entry.machine], "deaths": deaths}
    return Done(batch.name, part_bytes([row]), timing, (entry.machine,))


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
