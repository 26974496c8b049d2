"""The two files that a run may become: the thesis' own, and that of any network with effects."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.io

from ..bench.own_files import EXPORT
from ..inference.networks import BUILT_IN, NetworkForm, network_named
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
