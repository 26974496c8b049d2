"""Parameters that stand in a file: a TOML file by name, or the `prova.mat` of the thesis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .bench import Record, read_raw, read_record
from .bench.readers.open_file import read_start
from .errors import InputError
from .inference.catalogue import known_effects
from .inference.effect_parameters import effect_names
from .inference.model_parameters import override_names
from .inference.networks import NetworkForm, network_named
from .io.toml_text import LARGEST_BYTES, parse_toml
from .motor import Motor

LARGEST = 1e30
"""Beyond it no parameter means anything in any unit, and its square is no float64."""

SCALARS = {
    "first": {"Ceqw": "Ceq", "Reqw": "Req", "Two": "Tw_start"},
    "second": {
        "Ceqsr": "Ceq_sr",
        "Ceqw": "Ceq_w",
        "Reqsr": "Req_sr",
        "Reqw": "Req_w",
        "Tso": "Tsr_start",
        "Two": "Tw_start",
    },
}
"""Name in `prova.mat` and name of the parameter, by order. The thesis names the two of its
first-order model Ceq,w and Req,w as well."""

SAME = 1e-3
"""Properties of the winding that differ by a smaller share are the same: a run estimates them."""

MAT_FILES = (b"MATLAB 5.0", b"\x89HDF\r\n")
"""How MAT files begin, versions 5 to 7 and 7.3."""


@dataclass(frozen=True)
class Given:
    """Parameters of a file, taken as exact.

    Attributes:
        path: The file.
        form: The network that they are for.
        values: Parameters by name [their units].
        motor: The machine, with what the file says of its winding.
        starts: Start temperatures of the test that the file holds, by name [degC].
        own_test: That test; None if the file holds none.
        notes: Sentences on what the file says otherwise than the motor file.
    """

    path: Path
    form: NetworkForm
    values: Mapping[str, float]
    motor: Motor
    starts: Mapping[str, float] = field(default_factory=dict)
    own_test: Record | None = None
    notes: tuple[str, ...] = ()

    def values_for(self, record: Record) -> dict[str, float]:
        """Return the parameters for a test; only that of the file starts as the file says.

        Args:
            record: The test.
        """
        is_own = self.own_test is not None and _is_same_test(record, self.own_test)
        return {**self.values, **(self.starts if is_own else {})}


def read_parameters(source: Path, network: str | None, motor: Motor) -> Given:
    """Read a file of parameters.

    Args:
        source: A TOML file with parameters by name, or a `prova.mat`.
        network: Name of the network, or its file; None for what the file is for: a TOML file for
            the second order, a `prova.mat` for the order that it has the variables of.
        motor: The machine.

    Raises:
        InputError: If there is no such file, or a parameter is missing or misnamed.
    """
    if read_start(source, LARGEST_BYTES).startswith(MAT_FILES):
        return _of_mat(source, network, motor)
    form = network_named(network or "second")
    return Given(source, form, parameters_from(source, form, motor), motor)


def parameters_from(
    source: Path, form: NetworkForm, motor: Motor | None = None
) -> dict[str, float]:
    """Return parameters by name from a TOML file.

    Args:
        source: The file.
        form: The network that they are for.
        motor: The machine, whose known effects may have parameters too.

    Raises:
        InputError: If there is no such file, or a parameter is missing or misnamed.
    """
    content = parse_toml(read_start(source, LARGEST_BYTES), str(source), "file of parameters")
    content = content.get("parameters", content)
    if not isinstance(content, dict):
        raise InputError(
            "expected a section [parameters].", where=str(source),
            remedy="Write lines such as Ceq_w = 666.75.",
        )  # fmt: skip
    effects = effect_names(known_effects(motor)) if motor and motor.effects else ()
    needed = [p.name for p in form.parameters if p.fixed is None]
    missing = [name for name in needed if name not in content]
    unknown = [name for name in content if name not in (*override_names(form), *effects)]
    if missing or unknown:
        what = [f"{', '.join(missing)} missing"] if missing else []
        what += [f"{', '.join(unknown)} unknown"] if unknown else []
        raise InputError(
            f"parameters of the {form.title}: {'; '.join(what)}.",
            where=str(source),
            remedy=f"Give {', '.join(needed)} (J/K and K/W).",
        )
    return _numbers(content, form, source)


def _numbers(content: Mapping[str, Any], form: NetworkForm, source: Path) -> dict[str, float]:
    """Return the values as float64, all of them numbers that a parameter can have."""
    bad = [n for n, v in content.items() if isinstance(v, bool) or not isinstance(v, int | float)]
    if bad:
        raise InputError(
            f"{', '.join(bad)}: expected a number.", where=str(source), remedy="Write 666.75."
        )
    units = {parameter.name: parameter.unit for parameter in form.parameters}
    positive = {name for name, unit in units.items() if unit in ("J/K", "K/W")} | {"Rs0"}
    for name, value in content.items():
        # compared before it becomes a float, which a number of 400 digits cannot
        if not abs(value) < LARGEST or (name in positive and not value > 0):
            raise InputError(
                f"{name} = {value!s:.40}: expected a number"
                f"{' above 0' if name in positive else ''} below {LARGEST:g}.",
                where=str(source),
                remedy="Write 666.75.",
            )
    return {name: float(value) for name, value in content.items()}


def _of_mat(source: Path, network: str | None, motor: Motor) -> Given:
    """Return the parameters of a `prova.mat`; `Ceqsr` makes it the second order."""
    said = read_raw(source).constants
    order = "second" if "Ceqsr" in said or "Reqsr" in said else "first"
    if network not in (None, order):
        raise InputError(
            f"the file holds the parameters of the {order} order, asked for is {network}.",
            where=str(source),
            remedy=f"Pass --model {order}, or none.",
        )
    form = network_named(order)
    names = {variable: name for variable, name in SCALARS[order].items() if variable in said}
    needed = {variable for variable, name in SCALARS[order].items() if not name.endswith("_start")}
    missing = sorted(needed - set(names))
    if missing:
        raise InputError(
            f"{', '.join(missing)} missing; expected the variables of a prova.mat.",
            where=str(source),
            remedy="Pass a prova.mat of `heatrun export` or of the thesis, a run folder, or a "
            "TOML file of parameters.",
        )
    values = {name: said[variable] for variable, name in names.items()}
    if "Rrif" in said:
        values["Rs0"] = said["Rrif"] / motor.phases
    values = _numbers(values, form, source)
    starts = {name: values.pop(name) for name in list(values) if name.endswith("_start")}
    machine, notes = _winding(said, values, motor)
    own = read_record(source, motor)
    return Given(source, form, values, machine, starts, own, notes)


def _winding(
    said: Mapping[str, float], values: Mapping[str, float], motor: Motor
) -> tuple[Motor, tuple[str, ...]]:
    """Return the machine with the winding of the file, and what the motor file says otherwise."""
    found = {
        "phase_resistance_ohm": values.get("Rs0"),
        "reference_temperature_degC": said.get("Trif"),
        "resistance_coefficient_degC": said.get("B"),
    }
    stated = {name: value for name, value in found.items() if value is not None}
    notes = tuple(
        f"{name} = {value:.6g} as the file of parameters has it; the motor file says "
        f"{getattr(motor, name):.6g}"
        for name, value in stated.items()
        if getattr(motor, name) is not None and not np.isclose(value, getattr(motor, name), SAME)
    )
    return replace(motor, **stated), notes


def _is_same_test(record: Record, own: Record) -> bool:
    """Whether two records have the same samples of time and winding."""
    return all(
        name in record and name in own and np.array_equal(record[name], own[name], equal_nan=True)
        for name in ("time_s", "winding_degC")
    )
