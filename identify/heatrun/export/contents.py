"""The MAT file of a run, the thesis' own or that of any network with effects, in its folder.

Nothing in the folder is lost that cannot be made again.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ..errors import InputError
from ..io.file_set import together
from ..io.own_files import EXPORT
from ..io.whole_files import is_other, writable, write_whole
from ..model.network_form import NetworkForm
from ..model.network_text import BUILT_IN, network_named
from ..version import __version__
from .course import simulate_variables
from .network_course import simulate_network
from .network_file import SCRIPT as NETWORK_SCRIPT
from .network_file import UNITS as NETWORK_UNITS
from .network_file import corrected_network, network_variables
from .rerun import RunAndTest
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
class Simulated:
    """What the variables of a file give, at the samples.

    Attributes:
        winding: Temperature of the node that the winding's sensor sits in [degC], shape (time,).
        reading: What the sensor of the run would read [degC], shape (time,).
    """

    winding: np.ndarray
    reading: np.ndarray


@dataclass(frozen=True)
class Contents:
    """A MAT file with its scripts.

    Attributes:
        file: Name of the MAT file.
        scripts: Names of the scripts that go beside it, first the one that integrates it.
        units: Unit of each variable that there may be.
        variables: Gives the variables of a test, and notes on them.
        corrected: Gives the variables with the corrections of the run and what the shaft does.
        simulated: What `lptn` makes of the variables.
    """

    file: str
    scripts: tuple[str, ...]
    units: Mapping[str, str]
    variables: Callable[[RunAndTest], tuple[Variables, tuple[str, ...]]]
    corrected: Callable[[Variables, Corrections, Shaft], Variables]
    simulated: Callable[[Variables, Corrections], Simulated]


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


def _simulated_thesis(variables: Variables, corrections: Corrections) -> Simulated:
    winding = simulate_variables(variables).winding
    return Simulated(winding, corrections.reading(winding, variables["Te"].ravel()))


def _of_network(found: RunAndTest) -> tuple[Variables, tuple[str, ...]]:
    return network_variables(
        found.record,
        found.values,
        found.motor,
        found.model,
        rated_speed=float(found.blocks.inputs.rated_speed),
        rated_current=float(found.blocks.inputs.rated_current),
    )


def _simulated_network(variables: Variables, corrections: Corrections) -> Simulated:
    course = simulate_network(mat_bytes(variables))  # which hold the error of the sensor
    return Simulated(course.sensed, course.reading)


THESIS = Contents(
    file="prova.mat",
    scripts=("run_prova.m", "build_models.m"),
    units=THESIS_UNITS,
    variables=_of_thesis,
    corrected=lambda variables, corrections, shaft: corrections.applied(variables, shaft),
    simulated=_simulated_thesis,
)

NETWORK = Contents(
    file="network.mat",
    scripts=(NETWORK_SCRIPT,),
    units=NETWORK_UNITS,
    variables=_of_network,
    corrected=corrected_network,
    simulated=_simulated_network,
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
