"""A test of a run read again from the very files it was made of, or any test with its parameters.

A run folder holds parameters and paths, no signals. What is exported must be what was fitted, so
every file is compared with the SHA-256 in the manifest before a sample of it is used.

Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di
    Torino, 2023, section 4.4.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, UsageError
from ..io.toml_text import parse_toml
from ..model.model import Model, change_name
from ..readers.joined import files_of, read_test
from ..record.blocks import Blocks
from ..record.derive import recorded_shaft_power
from ..record.motor import Motor
from ..record.record import Record
from ..results.values import known
from ..runs.replica import replica
from ..runs.run import Run, RunTest, model_name, open_run
from ..simulation import predict_values, read_driven, read_parameters
from .variables import Corrections, Shaft


@dataclass(frozen=True)
class Predicted:
    """What a run predicts of a test, with the effects that it averages over."""

    time_s: np.ndarray  # Times of the blocks on the record's own axis [s], shape (block,).
    reading: np.ndarray  # Median of the winding's reading [degC], shape (block,).
    # Probability of each effect that the network may miss [1], by its id.
    maybe_missing: Mapping[str, float]


@dataclass(frozen=True)
class RunAndTest:
    """A test of a run with the values that the run found for it."""

    run: Path  # The run folder, or the file of parameters.
    model: Model  # Network with effects.
    motor: Motor  # The machine, from the run's motor file or the one given for a new test.
    # The test at its full rate, under its name in the run; `winding_degC` is NaN throughout where
    # it was not measured.
    record: Record
    # Medians of the posterior, or fixed values, by parameter name without the test; the start of a
    # test that was only predicted as `heatrun.posterior.driven` has it.
    values: Mapping[str, float]
    is_held_out: bool  # Whether the run predicted the test only.
    blocks: Blocks  # The test as it was reduced.
    # Every file that the run was made of, as the manifest names it, and of a new test.
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()  # Sentences on where the values come from.
    # What the run itself predicts, None for a file of parameters.
    predicted: Predicted | None = None


def read_run_test(run: Path, *, test: str | None = None, network: str | None = None) -> RunAndTest:
    """Read a test of a run again.

    Args:
        run: The run folder.
        test: Name of the test; None for the first that was calibrated on.
        network: Name of the network; None for the last one of the run.

    Raises:
        InputError: If the folder is no run, lacks the network or the test, or a file of the test
            is missing or has changed since; the motor file is the copy that the run keeps.
    """
    opened = open_run(run)
    name = opened.choose(network)
    try:
        chosen = _test(opened, test)
        motor = opened.motor
        record = read_test_of_run(opened, chosen)
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"fit.json or the manifest lacks what an export needs "
            f"({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again with this version.",
        ) from error
    return of_record(opened, record, motor, name, is_held_out=chosen.role == "holdout")


def of_record(
    run: Run, record: Record, motor: Motor, network: str | None, *, is_held_out: bool
) -> RunAndTest:
    """Return a record with the values that a run has for it.

    Args:
        run: The run.
        record: One of its tests under its name there, or any other.
        motor: How the bench of the record measures.
        network: Name of the network; None for the last one of the run.
        is_held_out: Whether the run was not fitted to it.

    Raises:
        InputError: If the run cannot predict it.
    """
    found = run.predict(record, network=network, motor=motor)
    values = dict(found.middle)
    if not found.is_held_out:
        values |= _as_written(run, run.choose(network), record.name, values)
    _refuse_negative(values, run.path)
    files = tuple(Path(entry["path"]) for entry in run.manifest["inputs"])
    rows = known(run.result.models[run.choose(network)].maybe_missing) or ()
    missing = {row.id: row.probability for row in rows if row.test in (None, record.name)}
    predicted = Predicted(found.time_s, found.median, missing)
    return RunAndTest(run.path, found.model, motor, record, values, is_held_out, found.test, files,
                      predicted=predicted)  # fmt: skip


def of_no_test(found: RunAndTest) -> RunAndTest:
    """Return a test from `read_run_test` with the values of any other, where the tests of the run
    ask for different parameters.
    """
    shared = {n: v for n, v in found.values.items() if not n.endswith(change_name(""))}
    return found if len(shared) == len(found.values) else replace(found, values=shared)


def as_replica(
    found: RunAndTest, network: str | None = None, kept: Collection[str] = ()
) -> tuple[RunAndTest, float]:
    """Return a test of a run with the network of fewer effects nearest to the run's model.

    As `heatrun.runs.replica` has it: instruments are exact but for what the test's own inputs tell,
    starts are the model's.

    Args:
        found: From `read_run_test` or `of_record`.
        network: Name of the network; None for the last one of the run.
        kept: Ids of effects that a tool takes.

    Returns:
        The test, and how far the network is from the model, RMS over the fitted tests [K].

    Raises:
        InputError: If the run holds none.
    """
    run = open_run(found.run)
    name = run.choose(network)
    nearest = known(run.result.models[name].replica)
    left = tuple(kind for kind in found.model.effects if kind.card.id in kept)
    if left:  # the run holds the plain one
        read = [run.predict(read_test_of_run(run, test), network=name) for test in run.tests]
        priors = run.model(network).parameters.by_test[0]
        nearest = replica(found.model, priors, read, [kind.card.id for kind in left])
    if nearest is None:
        raise InputError(
            f"the {found.model.title} of this run has no replica: that is the plain network for "
            "tools that take no effects, and only a calibration with effects has one.",
            where=str(found.run),
            remedy="Export without --replica.",
        )
    exact = {
        each: parameter.centre
        for each, parameter in run.model(network).parameters.by_test[0].items()
        if parameter.role == "instrument" and each in Corrections.__dataclass_fields__
    }
    values = {each: value for each, value in found.values.items()
              if "." not in each or each.split(".")[0] in kept}  # fmt: skip
    left_out = ", ".join(kind.card.id for kind in found.model.effects if kind not in left)
    errors = ", ".join(f"{test} {error:.2f} K" for test, error in nearest.rmse_K.items())
    note = (
        f"Replica for tools that take fewer effects, not a result: {nearest.numbers()}. It follows "
        f"the model, which also has {left_out}, within {nearest.from_model_K:.2f} K (RMS); its own "
        f"RMSE: {errors}."
    )
    changed = replace(
        found,
        model=replace(found.model, effects=left),
        values=values | exact | nearest.parameters,
        notes=(*found.notes, note),
        predicted=None,
    )
    return changed, nearest.from_model_K


def effects_of(run: Path, network: str | None = None) -> tuple[str, ...]:
    """Return the ids of the effects of a run's model, whether they are still known or not.

    Args:
        run: The run folder.
        network: Name of the network; None for the last one of the run.

    Raises:
        InputError: If the folder is no run, or lacks the network.
    """
    opened = open_run(run)
    name = model_name(opened.choose(network))
    content = parse_toml(opened.file(name), f"{run}, {name}", "model file")
    own = content.get("network", {}).get("effects", [])
    return (*own, *content.get("effects", []))


def _test(run: Run, name: str | None) -> RunTest:
    if name is None:
        calibrated = [test for test in run.tests if test.role == "calibration"]
        if not calibrated:
            raise InputError(
                "the run has no test that was calibrated on.",
                where=str(run.path),
                remedy="Name a test with --test.",
            )
        return calibrated[0]
    for test in run.tests:
        if test.name == name:
            return test
    raise InputError(
        f"the run has no test {name!r}.",
        where=str(run.path),
        remedy=f"Pass --test with one of: {', '.join(test.name for test in run.tests)}.",
    )


def read_test_of_run(run: Run, test: RunTest) -> Record:
    """Return a test, read as the run read it, from files that are still the same.

    Raises:
        InputError: If a file is missing or has changed since, or is read otherwise now.
    """
    record = read_test(run.source(test), run.motor)
    if record.time_s.size != test.said.num_samples:
        raise InputError(
            f"the run saw {test.said.num_samples} samples, this version reads "
            f"{record.time_s.size} from the same file.",
            where=f"{run.path}, {test.name}",
            remedy="Calibrate again with this version.",
        )
    return replace(record, name=test.name)


def _as_written(run: Run, network: str, test: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that stand in `fit.json` for a fitted test, by bare name."""
    written = run.values(network)
    own = {name: f"{name}[{test}]" for name in values}
    names = {name: own[name] if own[name] in written else name for name in values}
    return {name: written[key] for name, key in names.items() if key in written}


def _refuse_negative(values: Mapping[str, float], run: Path) -> None:
    bad = [
        name
        for name, value in values.items()
        if name.startswith(("Ceq", "Req", "Rs0"))
        and not name.endswith(change_name(""))  # a logarithm
        and not 0.0 < value < math.inf
    ]
    if bad:
        raise InputError(
            f"expected {', '.join(bad)} above 0, got "
            f"{', '.join(f'{values[name]:g}' for name in bad)}.",
            where=f"{run}, fit.json",
            remedy="Calibrate again.",
        )


def read_new_test(
    source: Path, test: Path, *, motor: Motor | None = None, network: str | None = None
) -> RunAndTest:
    """Read a test, and give it the parameters of a run or of a file.

    Args:
        source: A run folder, a TOML file of parameters, or a `prova.mat`.
        test: As `heatrun.readers.joined.read_test`.
        motor: How the bench of the test measures; None for the run's own motor file, which the
            run keeps a copy of.
        network: As `heatrun.simulation.simulate_file`.

    Returns:
        The test. One that the run was fitted to has its name and its values there; any other
        starts from the state of the bench and its first readings.

    Raises:
        InputError: As `heatrun.simulation.simulate_file`.
        UsageError: If there is no motor file for a file of parameters.
    """
    files = tuple(path for path, _ in files_of(test))
    if source.is_dir():
        run = open_run(source)
        machine = motor or run.motor
        record = _with_winding(read_driven(test, machine))
        fitted_as = run.fitted_as(record)
        record = record if fitted_as is None else replace(record, name=fitted_as)
        found = of_record(run, record, machine, network, is_held_out=fitted_as is None)
        return replace(found, inputs=(*found.inputs, *files))
    if motor is None:
        raise UsageError(
            "a file of parameters says nothing of the machine: pass --motor MOTOR.toml"
        )
    record = _with_winding(read_driven(test, motor))
    given = read_parameters(source, network, motor)
    found = predict_values(given.motor, given.values_for(record), record, given.form)
    return RunAndTest(
        run=source,
        model=found.model,
        motor=given.motor,
        record=record,
        values=found.middle,
        is_held_out=True,
        blocks=found.test,
        inputs=(source, Path(motor.path), *files) if motor.path else (source, *files),
        notes=given.notes,
    )


def _with_winding(record: Record) -> Record:
    """Return the record with a column of the winding, NaN where nothing was read."""
    if "winding_degC" in record:
        return record
    nothing = np.full(record.time_s.size, np.nan)
    return record.having({"winding_degC": nothing})


def shaft_of(found: RunAndTest, corrections: Corrections) -> Shaft:
    """Return speed and mechanical power at the samples where a correction needs them."""
    time = found.record.time_s

    def at_samples(values: np.ndarray | None, what: str, channel: str) -> np.ndarray:
        is_read = np.zeros(time.size, dtype=bool) if values is None else np.isfinite(values)
        if values is None or not np.any(is_read):
            raise InputError(
                f"the run corrects the {what}, and this test has no {channel} to apply it to.",
                where=found.record.name,
                remedy=f"Map {channel}, or export another test.",
            )
        return np.interp(time, time[is_read], values[is_read])

    channels = found.record.channels
    speed = power = None
    if corrections.torque_offset:
        speed = at_samples(channels.get("speed_rpm"), "torque", "speed_rpm")
    if corrections.needs_shaft_power:
        power = at_samples(recorded_shaft_power(channels), "mechanical power", "torque_Nm")
    return Shaft(speed, power)
