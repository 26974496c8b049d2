"""A run as a MAT file with the script that integrates it: for Simulink, MATLAB and Octave.

The file is the thesis' own or that of any network with effects; nothing in its folder is lost that
cannot be made again.
"""

import io
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ..errors import InputError
from ..io.own_files import EXPORT
from ..io.whole_files import is_other, numbered, together, writable, write_whole
from ..model.network_form import NetworkForm
from ..model.network_text import BUILT_IN, network_named
from ..record.motor import Motor
from ..record.record import Finding
from ..record.samples import BLOCK_S, integral
from ..version import __version__
from .network_course import NetworkCourse, simulate_network, simulate_variables
from .network_file import SCRIPT as NETWORK_SCRIPT
from .network_file import UNITS as NETWORK_UNITS
from .network_file import corrected_network, network_variables, refuse_unknown
from .rerun import RunAndTest, as_replica, effects_of, read_new_test, read_run_test, shaft_of
from .variables import UNITS as THESIS_UNITS
from .variables import Corrections, Shaft, thesis_variables

HEADER_TEXT_BYTES = 116
"""Free text at the start of a MATLAB 5 file; MAT-File Format, "Level 5 MAT-file header"."""

SOURCES = (b"/* heatrun export:", b"# heatrun export:", b"<!-- heatrun export:",
           b"// heatrun export:")  # fmt: skip
"""How the sources and vectors of an export begin."""


MARK, MARKED = b"heatrun export: ", 128
"""What stands in the first bytes of files that begin with words of their format: JSON, PNG."""

ZIP_FIRST = "documentation/heatrun.txt"
ZIP_WORDS = b"heatrun export: see modelDescription.xml\n"


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive that is known as heatrun's; the same files give the same bytes.

    Args:
        files: Content by path.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(zipfile.ZipInfo(ZIP_FIRST), ZIP_WORDS)  # of 1980, as the others
        for path, content in files.items():
            archive.writestr(zipfile.ZipInfo(path), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


ZIP_BEGIN = zipped({})[: 30 + len(ZIP_FIRST) + len(ZIP_WORDS)]
"""How such an archive begins: header, name and words of its first file."""

Variables = dict[str, Any]


@dataclass(frozen=True)
class Contents:
    """A MAT file with its scripts."""

    file: str  # Name of the MAT file.
    # Names of the scripts that go beside it, first the one that integrates it.
    scripts: tuple[str, ...]
    units: Mapping[str, str]  # Unit of each variable that there may be.
    # Gives the variables of a test, and notes on them.
    variables: Callable[[RunAndTest], tuple[Variables, tuple[str, ...]]]
    # Gives the variables with the corrections of the run and what the shaft does.
    corrected: Callable[[Variables, Corrections, Shaft], Variables]
    # What `lptn` makes of the variables.
    simulated: Callable[[Variables, Corrections], NetworkCourse]


def contents_of(found: RunAndTest) -> Contents:
    """Return the file that holds a model: the thesis' own where it has the variables for it."""
    model = found.model
    is_thesis = (
        model.name in BUILT_IN
        and model.kind == "balance"
        and not model.effects
        and _is_same(model.form, network_named(model.name))
    )
    return THESIS if is_thesis else NETWORK


def mat_bytes(variables: Mapping[str, Any]) -> bytes:
    """Return a MATLAB 5 file, uncompressed; the same variables give the same bytes.

    Args:
        variables: By name arrays of two dimensions, object arrays for cells, dictionaries for
            structs, or text.
    """
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, dict(variables), format="5", do_compression=False)
    text = EXPORT + __version__.encode()  # SciPy puts the time there
    return text.ljust(HEADER_TEXT_BYTES) + buffer.getvalue()[HEADER_TEXT_BYTES:]


def _is_same(form: NetworkForm, other: NetworkForm) -> bool:
    """Whether two networks have the same nodes, links, losses and names; priors may differ."""
    parts = ("names", "nodes", "share", "copper", "sinks", "sensors", "starts")
    links = [[link for link, _ in each.resistance] for each in (form, other)]
    same = all(getattr(form, part) == getattr(other, part) for part in parts)
    return same and links[0] == links[1]


def _of_thesis(found: RunAndTest) -> tuple[Variables, tuple[str, ...]]:
    return thesis_variables(found.record, found.values, found.motor, found.model.name)


def _of_network(found: RunAndTest) -> tuple[Variables, tuple[str, ...]]:
    return network_variables(
        found.record,
        found.values,
        found.motor,
        found.model,
        rated_speed=float(found.blocks.inputs.rated_speed),
        rated_current=float(found.blocks.inputs.rated_current),
    )


THESIS = Contents(
    file="prova.mat",
    scripts=("run_prova.m", "build_models.m"),
    units=THESIS_UNITS,
    variables=_of_thesis,
    corrected=lambda variables, corrections, shaft: corrections.applied(variables, shaft),
    simulated=simulate_variables,
)

NETWORK = Contents(
    file="network.mat",
    scripts=(NETWORK_SCRIPT,),
    units=NETWORK_UNITS,
    variables=_of_network,
    corrected=corrected_network,
    # its variables hold the error of the sensor
    simulated=lambda variables, _: simulate_network(mat_bytes(variables)),
)


def write_export(
    places: Iterable[Path],
    content: Mapping[str, bytes],
    inputs: tuple[Path, ...],
    *,
    is_replacing: bool,
) -> list[Path]:
    """Write files into the first folder that holds no other export.

    Args:
        places: The folders, best first; a single one is where the user wants them.
        content: The files by name.
        inputs: Files that the export was made of.
        is_replacing: Whether another export is replaced.

    Returns:
        Where the files are.

    Raises:
        InputError: If every folder holds another export, a file is there that heatrun has not
            written, or a folder cannot be written to.
    """
    folder, others = Path(), [""]
    for folder in places:
        for name, new in content.items():
            _refuse_loss(folder / name, new, inputs)
        others = [name for name, new in content.items() if is_other(folder / name, new)]
        if is_replacing or not others:
            break
    else:
        raise InputError(
            f"{folder / others[0]} holds another export; it is left as it is.",
            remedy="Choose another --out, or pass --force to replace it.",
        )
    with writable("the export", folder), together(folder, "export") as files:
        for name, new in content.items():
            write_whole(files.aside / name, new)
    return [folder / name for name in content]


def _refuse_loss(path: Path, content: bytes, inputs: tuple[Path, ...]) -> None:
    """Refuse to replace what heatrun has not written: a recording, or an edited script."""
    try:
        existing = path.read_bytes()
    except OSError:
        return  # it is not there, or writing fails with its own words
    is_input = any(path.resolve() == source.resolve() for source in inputs)
    begins = existing.startswith((EXPORT, *SOURCES, ZIP_BEGIN))
    is_ours = begins or MARK in existing[:MARKED] or existing == content
    if is_input or not is_ours:
        what = "one of the run's records" if is_input else "not as heatrun writes it"
        raise InputError(
            f"{path} exists and is {what}; it is left as it is.",
            remedy="Choose another --out, or move it away.",
        )


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
    difference = float(np.max(np.abs(full.sensed - plain.sensed)))
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
        "rmse_K": plain.rmse(plain.sensed),
        "rmse_reading_K": plain.rmse(plain.reading),
        "corrections_K": difference,
        "notes": [*found.notes, *notes],
        "findings": list(findings),
    }


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
    time = found.record.time_s
    total = integral(reading, np.diff(time))
    edges = np.clip(predicted.time_s[:, None] + [-0.5 * BLOCK_S, 0.5 * BLOCK_S], time[0], time[-1])
    exported = np.diff(np.interp(edges, time, total))[:, 0] / np.diff(edges)[:, 0]
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
