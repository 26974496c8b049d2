"""`prova.mat` of a run with the script that integrates it: for Simulink, MATLAB and Octave."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from .. import __version__
from ..bench.record import Finding
from ..errors import InputError
from ..io.file_set import together
from ..io.whole_files import writable, write_whole
from ..runs.result import describe_finding
from .course import simulate_variables
from .rerun import RunAndTest, read_run_test
from .variables import SCALARS, UNITS, Corrections, thesis_variables

MAT_FILE = "prova.mat"
SCRIPT = "run_prova.m"

HEADER_TEXT_BYTES = 116
"""Free text at the start of a MATLAB 5 file; MAT-File Format, "Level 5 MAT-file header"."""

MARK = b"MATLAB 5.0 MAT-file, heatrun "

LARGEST_UNSAID_K = 0.5
"""Corrections that move the winding by more are worth a warning: that is the standard uncertainty
of the sensors' own offsets [K]."""


def export_mat(
    run: Path,
    *,
    folder: Path | None = None,
    test: str | None = None,
    network: str | None = None,
    is_corrected: bool = False,
) -> dict[str, Any]:
    """Write `prova.mat` of a run, and the script that integrates it beside it.

    Args:
        run: The run folder.
        folder: Where the two files go; None for the run folder itself.
        test: As `read_run_test`.
        network: As `read_run_test`.
        is_corrected: Whether the corrections of losses and sink that the run found are applied
            to `Pd` and `Te`; else these are the record's own samples, as `Tw_m` always is.

    Returns:
        As plain data: the files, test, order, variables with value or shape and unit, the RMSE
        of `lptn.simulate` on these variables to `Tw_m`, the same as the sensor of the run would
        read the winding, how far the corrections move the winding [K], notes and findings.

    Raises:
        InputError: As `read_run_test` and `thesis_variables`; and if the files cannot be written
            or something that heatrun has not written would be lost.
    """
    found = read_run_test(run, test=test, network=network)
    variables, notes = thesis_variables(
        found.record, found.values, found.motor, _thesis_network(found)
    )
    corrections = Corrections.of(found.values)
    corrected = corrections.applied(variables, _speed(found, corrections))
    plain, full = simulate_variables(variables), simulate_variables(corrected)
    difference = float(np.max(np.abs(full.winding - plain.winding)))
    findings = () if is_corrected else _left_out(corrections, difference, found.record.name)
    if is_corrected:
        variables, plain = corrected, full
        notes = (*notes, f"Is, Pd and Te are corrected as in the run: {_words(corrections)}.")
    reading = replace(plain, winding=corrections.reading(plain.winding, variables["Te"].ravel()))
    target = folder or run
    script = files("heatrun.export").joinpath("templates", SCRIPT).read_bytes()
    _write(target, {MAT_FILE: mat_bytes(variables), SCRIPT: script}, found.inputs)
    return {
        "files": [str(target / MAT_FILE), str(target / SCRIPT)],
        "run": str(run),
        "test": found.record.name,
        "is_held_out": found.is_held_out,
        "order": found.model.name,
        "is_corrected": is_corrected,
        "variables": {name: _describe(name, value) for name, value in variables.items()},
        "rmse_K": plain.rmse(variables["Tw_m"]),
        "rmse_reading_K": reading.rmse(variables["Tw_m"]),
        "corrections_K": difference,
        "notes": list(notes),
        "findings": [describe_finding(finding) for finding in findings],
    }


def _thesis_network(found: RunAndTest) -> str:
    """Return the network of a run that the thesis has variables for.

    Raises:
        InputError: If its model has effects, or is another network.
    """
    effects = [kind.card.id for kind in found.model.effects]
    if effects or found.model.name not in SCALARS:
        what = f"effects ({', '.join(effects)})" if effects else f"the network {found.model.name}"
        raise InputError(
            f"the model of this run has {what}, which {MAT_FILE} has no variables for.",
            where=str(found.run),
            remedy="Export a run of `heatrun calibrate` on the same tests.",
        )
    return found.model.name


def mat_bytes(variables: Mapping[str, np.ndarray]) -> bytes:
    """Return a MATLAB 5 file, uncompressed; the same variables give the same bytes.

    Args:
        variables: Arrays by name, of two dimensions.
    """
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, dict(variables), format="5", do_compression=False)
    text = MARK + __version__.encode()  # SciPy puts the time there
    return text.ljust(HEADER_TEXT_BYTES) + buffer.getvalue()[HEADER_TEXT_BYTES:]


def _speed(found: RunAndTest, corrections: Corrections) -> np.ndarray | None:
    """Return the speed at the samples [rpm] where a torque offset needs it."""
    if not corrections.torque_offset:
        return None
    time = found.record.time_s
    speed = found.record.channels.get("speed_rpm", np.full(time.size, np.nan))
    is_read = np.isfinite(speed)
    if not np.any(is_read):
        raise InputError(
            "the run has a torque offset, and this test has no speed to apply it to.",
            where=found.record.name,
            remedy="Map speed_rpm, or export another test.",
        )
    return np.interp(time, time[is_read], speed[is_read])


def _left_out(corrections: Corrections, difference: float, test: str) -> tuple[Finding, ...]:
    if difference <= LARGEST_UNSAID_K:
        return ()
    return (
        Finding(
            id="corrections_left_out",
            severity="warning",
            message=f"The run corrects losses, sink and timing ({_words(corrections)}), for which "
            f"{MAT_FILE} has no variables; the record's own samples take the winding up to "
            f"{difference:.2g} K elsewhere (limit {LARGEST_UNSAID_K} K).",
            where=test,
            remedy="Pass --corrected to have them applied to Is, Pd and Te.",
            test=test,
            values={"corrections_K": difference},
        ),
    )


def _words(corrections: Corrections) -> str:
    units = {"power_gain": "", "torque_offset": " N m", "ambient_offset": " K",
             "load_timing": " s"}  # fmt: skip
    given = {name: getattr(corrections, name) for name in units}
    return ", ".join(f"{n} = {v:.3g}{units[n]}" for n, v in given.items() if v) or "by nothing"


def _describe(name: str, value: np.ndarray) -> dict[str, Any]:
    described: dict[str, Any] = {"shape": list(value.shape), "unit": UNITS[name]}
    if value.size == 1:
        described["value"] = float(value[0, 0])
    return described


def _write(folder: Path, contents: Mapping[str, bytes], inputs: tuple[Path, ...]) -> None:
    for name, content in contents.items():
        _refuse_loss(folder / name, content, inputs)
    with writable("the export", folder), together(folder, "export") as files:
        for name, content in contents.items():
            write_whole(files.aside / name, content)


def _refuse_loss(path: Path, content: bytes, inputs: tuple[Path, ...]) -> None:
    """Refuse to replace what heatrun has not written: a recording, or an edited script."""
    try:
        existing = path.read_bytes()
    except OSError:
        return  # it is not there, or writing fails with its own words
    is_input = any(path.resolve() == source.resolve() for source in inputs)
    is_ours = existing.startswith(MARK) or existing == content
    if is_input or not is_ours:
        what = "one of the run's records" if is_input else "not as heatrun writes it"
        raise InputError(
            f"{path} exists and is {what}; it is left as it is.",
            remedy="Choose another --out, or move it away.",
        )
