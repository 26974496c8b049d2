"""The load of a real test simulated with the parameters of a run, of a file, or moved by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from .errors import InputError
from .io.open_file import read_start
from .io.toml_text import LARGEST_BYTES, parse_toml
from .io.whole_files import is_other, numbered, refuse_replacing, together, writable, write_whole
from .model.catalogue import known_effects
from .model.draws import NUM_NOISE, Draws, block_means
from .model.model import Model
from .model.model_parameters import override_names, parameters
from .model.network_form import NetworkForm
from .model.network_text import network_named
from .model.parameters import effect_names
from .posterior.driven import reduce_driven, refuse_coarse_steps, refuse_runaway, virtual_record
from .posterior.predict import Prediction, of_test, predict
from .readers.joined import read_test
from .readers.read import read_raw, read_record
from .record.blocks import Blocks
from .record.motor import Motor, ParameterOverride
from .record.record import Record
from .record.samples import needed_channels, require
from .runs.run import open_run

if TYPE_CHECKING:
    from .runs.run import Run


def simulate_file(
    motor: Motor,
    source: str,
    path: Path,
    network: str | None,
    folder: Path | None,
    seed: int,
    *,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Simulate the load of a test and write the virtual record as CSV.

    Args:
        motor: The machine.
        source: A run folder, a TOML file with parameters by name, or a `prova.mat`.
        path: The test whose currents, losses and sink drive the model.
        network: Name of the network; None for the last one of a run, that of a `prova.mat`, or
            the second order.
        folder: Where `NAME_virtual.csv` goes; None for here, numbered where that name is taken
            by another record.
        seed: Of the draws behind the bands, which a run gives: columns such as
            `winding_95_low_degC`, with the noise of a block mean.
        is_replacing: Whether another record in `folder` is replaced.

    Returns:
        Name of the file, number of rows, network and effects, the error to a measured winding
        where there is one, why there are no bands where there are none, and notes.

    Raises:
        InputError: If parameters are missing, the record lacks a channel, or another record is in
            `folder` under that name.
    """
    record = read_driven(path, motor)
    lacking, notes = "", ()
    if Path(source).is_dir():
        found = open_run(source).predict(record, network=network, motor=motor, seed=seed)
    else:
        given = read_parameters(Path(source), network, motor)
        found = predict_values(given.motor, given.values_for(record), record, given.form)
        lacking, notes = "a file of parameters says nothing of their uncertainty", given.notes
    table = virtual_record(found, record, motor)
    text = table.to_csv(index=False, float_format="%.6g").encode()
    target = (folder or Path()) / f"{record.name}_virtual.csv"
    if folder is None:
        target = next(at for at in numbered(target) if not is_other(at, text))
    elif not is_replacing and is_other(target, text):
        refuse_replacing(target, "another record")
    with writable("the record", target), together(target.parent, "virtual") as files:
        write_whole(files.aside / target.name, text)
    return {
        "file": str(target),
        "num_rows": len(table),
        "network": found.model.name,
        "effects": [kind.card.id for kind in found.model.effects],
        "rmse_K": found.rmse_K if np.isfinite(found.rmse_K) else None,
        "test": record.name,
        "no_bands": lacking,
        "notes": list(notes),
    }


def read_driven(path: Path, motor: Motor) -> Record:
    """Read a test whose current, losses and sink drive a model.

    Args:
        path: As `heatrun.readers.joined.read_test`.
        motor: How its bench measures.

    Raises:
        InputError: If it cannot be read, or lacks one of these channels.
    """
    record = read_test(path, motor)
    require(record, [name for name in needed_channels(record, motor) if name != "winding_degC"])
    return record


def simulate_values(
    motor: Motor, values: Mapping[str, float], record: Record, network: str | NetworkForm
) -> pd.DataFrame:
    """Return the virtual record of given parameters.

    Args:
        motor: The machine.
        values: Parameters by name, those of the motor file's known effects as
            `speed_cooling.g`; a start temperature that is not given is taken from the record's
            first readings, or from the sink where no winding was measured.
        record: Currents, losses and sink.
        network: Name of a network, or the network.

    Raises:
        InputError: If the record lacks a channel, or the model leaves the temperatures at which
            there is a machine.
    """
    found = predict_values(motor, values, record, network)
    return virtual_record(found, record, motor)


def predict_values(
    motor: Motor, values: Mapping[str, float], record: Record, network: str | NetworkForm
) -> Prediction:
    """Return the prediction of given parameters, taken as exact; arguments as `simulate_values`."""
    blocks = reduce_driven(record, motor)
    model = Model.of(network, motor, known_effects(motor))
    draws = exact_draws(model, motor, values, blocks)
    exactly = {p.name: p.fixed for p in draws.parameters.by_test[0].values() if p.fixed is not None}
    refuse_coarse_steps(model, exactly, blocks)
    found = predict(draws, blocks)
    refuse_runaway(found, record.name)
    return found


def exact_draws(model: Model, motor: Motor, values: Mapping[str, float], blocks: Blocks) -> Draws:
    """Return the one draw of parameters that are taken as exact.

    Args:
        model: The network with its effects.
        motor: The machine.
        values: Parameters by name; one that is not given is at the centre of its prior.
        blocks: The test.
    """
    starts = {name for _, name in model.form.starts}
    given = {name: ParameterOverride(fixed=values[name]) for name in starts & set(values)}
    motor = replace(motor, parameters={**motor.parameters, **given})
    known = parameters(model, motor, [blocks])
    fixed = {}
    for name, parameter in known.by_test[0].items():
        if name not in starts and not parameter.per_test:
            default = parameter.centre if parameter.fixed is None else parameter.fixed
            fixed[name] = replace(parameter, fixed=values.get(name, default))
    exact = replace(known, by_test=(fixed,), slots=())
    return Draws(model, motor, exact, np.zeros((1, NUM_NOISE)))


@dataclass(frozen=True)
class ByHand:
    """A model and a test, with the values that it starts from."""

    model: Model  # The network with its effects.
    test: Blocks  # The reduced record.
    values: Mapping[str, float]  # All parameters by name, in their units.

    @classmethod
    def of(cls, record: Record, motor: Motor, run: Run | None = None) -> ByHand:
        """Start from a run, or, without one, from the priors of a second order for this machine.

        Args:
            record: With currents, losses and sink.
            motor: How its bench measures.
            run: Its last network is taken.

        Raises:
            InputError: If the record lacks a channel, or the motor file a parameter.
        """
        if run is not None:
            test = reduce_driven(record, replace(motor, scales=run.motor.scales))
            return cls._of(run.draws(), test, run.fitted_as(record))
        test = reduce_driven(record, motor)
        model = Model.of("second", motor, known_effects(motor)).scaled(motor, [test])
        return cls._of(exact_draws(model, motor, {}, test), test, None)

    @classmethod
    def _of(cls, draws: Draws, test: Blocks, fitted_as: str | None) -> ByHand:
        owner = fitted_as if fitted_as in draws.parameters.tests else None
        return cls(draws.model, test, of_test(draws, test, fitted_as=owner).middle())

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters that are moved, by name: those of the network."""
        return {p.name: p.unit for p in self.model.form.parameters if p.fixed is None}

    def course(self, moved: Mapping[str, float]) -> Float[np.ndarray, " block"]:
        """Return the modelled means of the winding over the blocks [degC].

        Args:
            moved: Parameters with other values than those of the start, by name.
        """
        values = {name: np.float64(value) for name, value in {**self.values, **moved}.items()}
        test = self.test.observation().padded(is_seldom=True).simulated()
        means = block_means(self.model, values, test)
        return self.test.own(means)


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
    """Parameters of a file, taken as exact."""

    path: Path  # The file.
    form: NetworkForm  # The network that they are for.
    values: Mapping[str, float]  # Parameters by name [their units].
    motor: Motor  # The machine, with what the file says of its winding.
    # Start temperatures of the test that the file holds, by name [degC].
    starts: Mapping[str, float] = field(default_factory=dict)
    own_test: Record | None = None  # That test; None if the file holds none.
    notes: tuple[str, ...] = ()  # Sentences on what the file says otherwise than the motor file.

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
