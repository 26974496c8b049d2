"""A run as a MAT file with the script that integrates it: for Simulink, MATLAB and Octave."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..io.whole_files import numbered
from ..record.motor import Motor
from ..record.record import Finding
from .contents import Simulated, contents_of, mat_bytes, write_export
from .network_file import refuse_unknown
from .rerun import RunAndTest, as_replica, effects_of, read_new_test, read_run_test, shaft_of
from .variables import Corrections

LARGEST_UNSAID_K = 0.5
"""Corrections that move the winding by more are worth a warning: that is the standard uncertainty
of the sensors' own offsets [K]."""

MOST_NAMED = 3
"""Effects that may be missing that a warning names, the most probable."""


def export_mat(
    run: Path,
    *,
    folder: Path | None = None,
    test: str | None = None,
    network: str | None = None,
    is_replica: bool = False,
    is_corrected: bool = False,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Write a test of a run as a MAT file, and the scripts for it beside it.

    The built-in networks without effects, and replicas, become `prova.mat`, in the variables of the
    thesis; every other network, every model with effects and every model of a loss map becomes
    `network.mat`.

    Args:
        run: The run folder.
        folder: Where the files go; None for the run folder itself, or a numbered folder in it
            where that holds another export.
        test: As `read_run_test`.
        network: As `read_run_test`.
        is_replica: Whether the plain network nearest to a model with effects goes in its place.
        is_corrected: Whether the corrections of current, losses, sink and timing that the run found
            are applied to the signals; else these are the record's own samples, as `Tw_m` always
            is.
        is_replacing: Whether another export in `folder` is replaced.

    Returns:
        As plain data: the files, test, network (`order`, `title`) and effects, variables with
        value or shape and unit, the RMSE of the winding of `lptn.simulate` on these variables to
        `Tw_m` at the samples (that of a report is of block means), the same of what the sensor of
        the run would read, both None where nothing was read, how far the corrections move the
        winding [K], notes and findings.

    Raises:
        InputError: As `read_run_test`, `thesis_variables` and `network_variables`; and if the
            files cannot be written, another export is in `folder`, or something that heatrun has
            not written would be lost.
    """
    if not is_replica:
        refuse_unknown(effects_of(run, network), str(run))
    found = read_run_test(run, test=test, network=network)
    found = as_replica(found, network)[0] if is_replica else found
    places = [folder] if folder else numbered(run, run / "mat")
    return _export(found, places, is_corrected, is_replacing)


def export_test(
    source: Path,
    test: Path,
    *,
    motor: Motor | None = None,
    folder: Path | None = None,
    network: str | None = None,
    is_replica: bool = False,
    is_corrected: bool = False,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Write any test as a MAT file, with the parameters of a run or of a file.

    Args:
        source: A run folder, a TOML file of parameters, or a `prova.mat`.
        test: The test, as `heatrun.readers.joined.read_test`.
        motor: As `read_new_test`.
        folder: Where the files go; None for a folder `NAME_mat` here, numbered where it holds
            another export.
        network: As `read_new_test`.
        is_replica: As `export_mat`.
        is_corrected: As `export_mat`.
        is_replacing: As `export_mat`.

    Returns:
        As `export_mat`.

    Raises:
        InputError: As `read_new_test`, `thesis_variables` and `network_variables`; and as
            `export_mat`.
        UsageError: As `read_new_test`.
    """
    if source.is_dir() and not is_replica:
        refuse_unknown(effects_of(source, network), str(source))
    found = read_new_test(source, test, motor=motor, network=network)
    found = as_replica(found, network)[0] if is_replica else found
    places = [folder] if folder else numbered(Path(f"{found.record.name}_mat"))
    return _export(found, places, is_corrected, is_replacing)


def _export(
    found: RunAndTest, places: Iterable[Path], is_corrected: bool, is_replacing: bool
) -> dict[str, Any]:
    """Write the files of a test into the first place that is free for them."""
    contents = contents_of(found)
    variables, notes = contents.variables(found)
    corrections = Corrections.of(found.values)
    corrected = contents.corrected(variables, corrections, shaft_of(found, corrections))
    plain = contents.simulated(variables, corrections)
    full = contents.simulated(corrected, corrections)
    difference = float(np.max(np.abs(full.winding - plain.winding)))
    findings: tuple[Finding, ...] = ()
    if is_corrected:
        variables, plain = corrected, full
        loss = "Pol" if "Pol" in variables else "Pd"
        signals = f"Is, {loss}, Te and Te2" if "Te2" in variables else f"Is, {loss} and Te"
        notes = (*notes, f"{signals} are corrected as in the run: {corrections.words()}.")
    else:
        findings = _left_out(corrections, difference, found.record.name, contents.file)
    findings += _effects_left_out(found, full.reading, contents.file)
    content = {contents.file: mat_bytes(variables)}
    for script in contents.scripts:
        content[script] = files("heatrun.export").joinpath("templates", script).read_bytes()
    written = write_export(places, content, found.inputs, is_replacing=is_replacing)
    return {
        "files": [str(path) for path in written],
        "run": str(found.run),
        "test": found.record.name,
        "is_held_out": found.is_held_out,
        "order": found.model.name,
        "title": found.model.title,
        "effects": [kind.card.id for kind in found.model.effects],
        "is_corrected": is_corrected,
        "variables": {
            name: _describe(value, contents.units[name]) for name, value in variables.items()
        },
        **_rmse(plain, variables["Tw_m"]),
        "corrections_K": difference,
        "notes": [*found.notes, *notes],
        "findings": list(findings),
    }


def _rmse(course: Simulated, measured: np.ndarray) -> dict[str, float | None]:
    """Return the RMSE of winding and reading to the readings of the record [K], if it has any."""
    is_read = np.isfinite(measured.ravel())

    def rmse(values: np.ndarray) -> float | None:
        if not np.any(is_read):
            return None
        return float(np.sqrt(np.mean((values - measured.ravel())[is_read] ** 2)))

    return {"rmse_K": rmse(course.winding), "rmse_reading_K": rmse(course.reading)}


def _left_out(
    corrections: Corrections, difference: float, test: str, file: str
) -> tuple[Finding, ...]:
    if difference <= LARGEST_UNSAID_K:
        return ()
    return (
        Finding(
            id="corrections_left_out",
            severity="warning",
            message="The run corrects current, losses, sink and timing "
            f"({corrections.words()}), for which {file} has no variables; the record's own "
            "samples take the winding up to "
            f"{difference:.2g} K elsewhere (limit {LARGEST_UNSAID_K} K).",
            where=test,
            remedy="Pass --corrected to have them applied to current, losses and sink.",
            test=test,
            values={"corrections_K": difference},
        ),
    )


def _effects_left_out(found: RunAndTest, reading: np.ndarray, file: str) -> tuple[Finding, ...]:
    """Say where the run predicts by effects that its network, and so the file, does not have."""
    predicted = found.predicted
    if predicted is None or not predicted.maybe_missing:
        return ()
    exported = np.interp(predicted.time_s, found.record.time_s, reading)
    difference = float(np.nanmax(np.abs(exported - predicted.reading)))
    if not difference > LARGEST_UNSAID_K:
        return ()
    likely, *others = sorted(predicted.maybe_missing.items(), key=lambda each: -each[1])
    spoken = ", ".join(f"{n} {100 * p:.0f} %" for n, p in [likely, *others][:MOST_NAMED])
    return (
        Finding(
            id="effects_left_out",
            severity="warning",
            message="The run's network may miss effects, which its own predictions hold "
            f"({spoken}) and {file} does not: its temperatures are up to {difference:.2g} K "
            f"from those predictions (limit {LARGEST_UNSAID_K} K).",
            where=found.record.name,
            remedy=f"Calibrate with the effect, `--with {likely[0]}`, or with a network of more "
            "nodes, and export that run.",
            test=found.record.name,
            values={"effects_K": difference},
        ),
    )


def _describe(value: Any, unit: str) -> dict[str, Any]:
    """Return shape and unit of a variable, and its value unless it is a signal."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        described: dict[str, Any] = {"shape": list(value.shape), "unit": unit}
        return described | ({"value": float(value[0, 0])} if value.size == 1 else {})
    shape = list(value.shape) if isinstance(value, np.ndarray) else [1, 1]
    return {"shape": shape, "unit": unit, "value": _plain(value)}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, np.ndarray):
        rows = [[_plain(entry) for entry in row] for row in value.tolist()]
        flat = [row[0] if len(row) == 1 else row for row in rows]
        return flat[0] if value.shape == (1, 1) and value.dtype != object else flat
    return value
