"""A run read back: model with effects, draws, noise, tests, findings, predictions.

Its model stands in the folder as TOML that reads back to the same value.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.toml_text import parse_toml
from ..model.catalogue import effects_named
from ..model.model import Model
from ..model.network_text import network_of, network_text
from ..model.parameters import Parameter, ParameterSet, collect
from ..motor.certificate import parse_meta
from ..motor.file import parse_motor
from ..readers.joined import read_test
from ..record.blocks import Logger
from ..record.motor import Adequacy, Certificate, Motor
from ..record.record import Finding, Record
from ..results import DiscoveryResult, FitResult, from_json
from ..results.model import DescribedTest
from ..results.values import Role, known
from . import netcdf
from .run_folder import MANIFEST, SourceFile, as_named, found_from, read_listed, refuse_changed

if TYPE_CHECKING:  # what computes with a run is loaded when it does
    from ..model.draws import Draws, PlausibleEffect
    from ..model.noise import Loggers
    from ..posterior.predict import Prediction

FORMAT = "heatrun-model/1"


@dataclass(frozen=True)
class ModelOfRun:
    """A model with its priors over the tests that it was fitted to."""

    model: Model  # Network with effects and nuisances.
    parameters: ParameterSet  # Parameters with priors, fixed values and tests.


def model_text(found: ModelOfRun) -> bytes:
    """Return the TOML text of a model."""
    import tomli_w

    model = found.model
    distinct: list[Parameter] = []
    tests = []
    for name, parameters in zip(found.parameters.tests, found.parameters.by_test, strict=True):
        places = []
        for parameter in parameters.values():
            if parameter not in distinct:
                distinct.append(parameter)
            places.append(distinct.index(parameter))
        tests.append({"name": as_utf8(name), "parameters": places})
    own = set(model.form.effects)
    content = {
        "format": FORMAT,
        "effects": [kind.card.id for kind in model.effects if kind.card.id not in own],
        **network_text(model.form),
        "losses": {
            "kind": model.kind,
            "phases": model.phases,
            "reference_temperature_degC": float(model.reference_temperature),
            "coefficient_degC": float(model.coefficient),
        },
        "adequacy": asdict(model.adequacy),
        "change_sd": model.change_sd,
        "fitted": {"parameters": [_entry(each) for each in distinct], "tests": tests},
    }
    return tomli_w.dumps(content).encode()


def read_model(data: bytes, where: str) -> ModelOfRun:
    """Return the model of a text.

    Raises:
        InputError: If the text is damaged, or names an effect that is not there.
    """
    content = parse_toml(data, where, "model file")
    if content["format"] != FORMAT:
        raise ValueError(f"format {content['format']!r}, expected {FORMAT}")
    form = network_of(content, where)
    losses, fitted = content["losses"], content["fitted"]
    model = Model(
        form=form,
        kind=losses["kind"],
        phases=losses["phases"],
        reference_temperature=losses["reference_temperature_degC"],
        coefficient=losses["coefficient_degC"],
        effects=effects_named([*form.effects, *content["effects"]], where),
        adequacy=Adequacy(**content.get("adequacy", {})),  # runs of old do not say
        change_sd=content.get("change_sd", 0.0),
    )
    distinct = [Parameter(**{"fixed": None, **entry}) for entry in fitted["parameters"]]
    by_test = [
        {distinct[place].name: distinct[place] for place in test["parameters"]}
        for test in fitted["tests"]
    ]
    names = [test["name"] for test in fitted["tests"]]
    return ModelOfRun(model, collect(names, by_test))


def _entry(parameter: Parameter) -> Mapping[str, Any]:
    return {
        key: float(value) if isinstance(value, float) else value
        for key, value in asdict(parameter).items()
        if value is not None
    }


def as_utf8(text: str) -> str:
    """Return text that TOML can hold: bytes of a file name that are no UTF-8 are escaped."""
    return text.encode(errors="backslashreplace").decode()


MOTOR = "motor.toml"

Read = Callable[[Path], bytes]
T = TypeVar("T")


def model_name(network: str) -> str:
    """Return the name of the file that holds a network of a run."""
    return f"model_{network}.toml"


def draws_name(network: str) -> str:
    """Return the name of the file that holds the draws of a network of a run."""
    return f"posterior_{network}.nc"


def course_name(number: int) -> str:
    """Return the name of the file that holds the predicted course of a test, counted from 1."""
    return f"course_{number}.csv"


@dataclass(frozen=True)
class RunTest:
    """A test of a run."""

    name: str  # Its name in the run.
    role: Role  # Whether it was fitted or only predicted.
    files: tuple[SourceFile, ...]  # The files that it was read from.
    said: DescribedTest  # What `fit.json` says of it.


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What a calibration or a discovery left, read back from its folder.

    Nothing is changed by reading; every file is compared with the digest in the manifest first.

    Attributes:
        path: The folder.
        result: What `fit.json` says.
        read: Reads a file of the run.
        is_finished: Whether it has its manifest; only then are files compared with it.
    """

    path: Path
    result: FitResult
    read: Read = Path.read_bytes
    is_finished: bool = True

    def __repr__(self) -> str:
        """Return it on one line: the whole result is thousands of them."""
        networks = ", ".join(model.title for model in self.result.models.values())
        tests = ", ".join(f"{test.name} ({test.role})" for test in self.result.tests)
        return f"<Run {self.path}: {self.result.motor.name}; {networks}; {tests}>"

    def file(self, name: str) -> bytes:
        """Return a file of the run.

        Raises:
            InputError: If it is missing, damaged or was changed.
        """
        if not self.is_finished:
            return self.read(self.path / name)
        return read_listed(self.path, name, self.read)

    @cached_property
    def manifest(self) -> Mapping[str, Any]:
        """Command, seed, date, inputs with digests, versions."""
        return json.loads(self.read(self.path / MANIFEST))

    @cached_property
    def discovery(self) -> DiscoveryResult | None:
        """What `discovery.json` says; None if the run is a calibration."""
        if "discovery.json" not in self.manifest["files"]:
            return None
        content = self.file("discovery.json")
        return from_json(content, DiscoveryResult, "discovery.json", str(self.path))

    @cached_property
    def motor(self) -> Motor:
        """The machine, from the run's own copy of the motor file."""
        said = self.result.motor
        found = _whole(self, MOTOR, lambda: parse_motor(self.file(MOTOR), str(self.path / MOTOR)))
        return replace(found, path=said.path, sha256=said.sha256)

    @property
    def networks(self) -> tuple[str, ...]:
        """Names of the networks that were fitted, as in `--model`."""
        return tuple(self.result.models)

    @cached_property
    def tests(self) -> tuple[RunTest, ...]:
        """The tests, calibration first."""
        entries = self.result.tests
        files = [SourceFile(str(e["path"]), str(e["sha256"])) for e in self.manifest["inputs"][1:]]
        return tuple(
            RunTest(entry.name, entry.role, own, entry)
            for entry, own in zip(entries, _files_of(entries, files), strict=True)
        )

    @property
    def findings(self) -> Sequence[Finding]:
        """What was found about records and fits."""
        return self.result.findings

    def source(self, test: RunTest) -> str:
        """Return a test as the command line names it: its files, sheets, rates and stretch.

        A path that leads nowhere from here is followed from the folders around the run.

        Raises:
            InputError: If a file is gone or has changed since the run.
        """
        command, found = self.result.command, []
        for file in test.files:
            place = found_from(file.path, self.path)
            refuse_changed(replace(file, path=place), self.path, "record")
            found.append(place + as_named(file.path, test.name, command)[len(file.path) :])
        files = "+".join(found)
        stretch = known(test.said.stretch)
        return f"{files}@{stretch}" if stretch else files

    def choose(self, network: str | None = None) -> str:
        """Return the name of a network of the run: the one asked for, or the last one.

        Raises:
            InputError: If the run does not hold it.
        """
        chosen = network or self.networks[-1]
        if chosen not in self.networks:
            raise InputError(
                f"the run holds no {chosen} network, only {', '.join(self.networks)}.",
                where=str(self.path),
                remedy="Pass --model, or calibrate with --model both.",
            )
        return chosen

    def model(self, network: str | None = None) -> ModelOfRun:
        """Return a fitted model with its priors.

        Args:
            network: Its name; the last one if None.
        """
        name = model_name(self.choose(network))
        return _whole(self, name, lambda: read_model(self.file(name), str(self.path / name)))

    def posterior(self, network: str | None = None) -> Any:
        """Return the draws of a network as an xarray `DataTree`, groups as in `idata`."""
        name = draws_name(self.choose(network))
        return _whole(self, name, lambda: netcdf.from_bytes(self.file(name)))

    @property
    def idata(self) -> Any:
        """The draws of the last network as ArviZ knows them."""
        return netcdf.as_arviz(self.posterior())

    def arrays(self, network: str | None = None) -> netcdf.Groups:
        """Return the draws of a network as arrays, as they are stored."""
        name = draws_name(self.choose(network))
        return _whole(self, name, lambda: netcdf.groups_of(self.file(name)))

    def draws(self, network: str | None = None) -> Draws:
        """Return the draws of a network with all that gives them a meaning."""
        from ..model.draws import Draws

        found = self.model(network)
        groups = self.arrays(network)
        name = draws_name(self.choose(network))
        adequacy = found.model.adequacy
        vectors = _whole(self, name, lambda: netcdf.vectors(groups, found.parameters, adequacy))
        flat = vectors.reshape(-1, vectors.shape[-1])
        effects = self._maybe_missing(self.choose(network))
        behind = _whole(self, name, lambda: netcdf.plausible(groups, effects))
        loggers = self._loggers(self.choose(network))
        return Draws(found.model, self.motor, found.parameters, flat, behind, loggers)

    def _loggers(self, network: str) -> Loggers:
        """Return the noise of each logger that a network was fitted to."""
        rows = known(self.result.models[network].noise.loggers) or ()
        return {Logger(row.sample_s, row.resolution_K, row.sensor): row.scale for row in rows}

    def _maybe_missing(self, network: str) -> tuple[PlausibleEffect, ...]:
        """Return the effects that the draws of a network are averaged over."""
        from ..model.draws import PlausibleEffect

        rows = known(self.result.models[network].maybe_missing) or ()
        ids = dict.fromkeys(row.id for row in rows)  # an event may be there once for each test
        kinds = dict(zip(ids, effects_named([*ids], str(self.path)), strict=True))
        return tuple(
            PlausibleEffect(kinds[row.id], row.test, row.probability, row.with_effect, row.without)
            for row in rows
        )

    def values(self, network: str | None = None) -> dict[str, float]:
        """Return the stated and the fixed values by name [their units]."""
        model = self.result.models[self.choose(network)]
        entries = {**model.parameters, **model.nuisances}
        return {name: entry.value for name, entry in entries.items()}

    def courses(self) -> list[pd.DataFrame]:
        """Return the predicted courses of the tests, in their order, as they were written."""
        numbers = range(1, len(self.result.tests) + 1)
        return [
            _whole(self, name, lambda name=name: _table(self.file(name)))
            for name in map(course_name, numbers)
        ]

    def fitted_as(self, record: Record) -> str | None:
        """Return the name under which a record was fitted, None if it was not."""
        digests = {source.sha256 for source in record.sources}
        for test in self.tests:
            is_same = digests == {file.sha256 for file in test.files}
            if (
                test.role == "calibration"
                and is_same
                and (known(test.said.stretch) or "") == record.stretch
            ):
                return test.name
        return None

    def predict(
        self,
        test: Record | str | Path,
        *,
        network: str | None = None,
        motor: Motor | None = None,
        num_draws: int | None = None,
        seed: int = 0,
    ) -> Prediction:
        """Predict a test.

        A file that the run was fitted to starts as it was fitted; any other from the state of
        the bench and its first readings.

        Args:
            test: A record, or its file.
            network: Name of the network; the last one if None.
            motor: How the bench of this test measures; that of the run if None.
            num_draws: Number of draws; that of `heatrun.posterior.predict.predict` if None.
            seed: Of draws, start and noise.

        Raises:
            InputError: If the run or the file cannot be read, a channel is missing, or the model
                leaves the temperatures at which there is a machine.
        """
        from ..posterior.driven import reduce_driven, refuse_runaway
        from ..posterior.predict import NUM_DRAWS, predict

        motor = replace(motor or self.motor, scales=self.motor.scales)
        record = test if isinstance(test, Record) else read_test(Path(test), motor)
        blocks = reduce_driven(record, motor)
        draws = self.draws(network)
        owner = self.fitted_as(record)
        if owner is not None and owner not in draws.parameters.tests:
            owner = None
        found = predict(draws, blocks, fitted_as=owner, num_draws=num_draws or NUM_DRAWS, seed=seed)
        refuse_runaway(found, f"{record.name}, {self.path}")
        return found

    def simulate(
        self,
        test: Record | str | Path,
        *,
        network: str | None = None,
        motor: Motor | None = None,
        seed: int = 0,
    ) -> pd.DataFrame:
        """Return the record of a virtual prototype driven by a test; arguments as `predict`.

        Returns:
            As `heatrun.posterior.driven.virtual_record`.
        """
        from ..posterior.driven import virtual_record

        motor = motor or self.motor
        record = test if isinstance(test, Record) else read_test(Path(test), motor)
        found = self.predict(record, network=network, motor=motor, seed=seed)
        return virtual_record(found, record, motor)

    def summary(self, network: str | None = None) -> pd.DataFrame:
        """Return the parameters of a network: value, 95 % interval, unit, identifiability."""
        entries = self.result.models[self.choose(network)].parameters
        return pd.DataFrame(
            {
                "value": [e.value for e in entries.values()],
                "low_95": [e.interval_95[0] for e in entries.values()],
                "high_95": [e.interval_95[1] for e in entries.values()],
                "unit": [e.unit for e in entries.values()],
                "identifiability": [e.identifiability or "" for e in entries.values()],
                "why": [e.why or "" for e in entries.values()],
            },
            index=pd.Index(entries, name="parameter"),
        )

    def plot(self, network: str | None = None) -> Any:
        """Return a figure: each test's measured and predicted winding with its 95 % band."""
        name = self.choose(network)
        tests = [(test.name, test.role) for test in self.tests]
        return plot_courses(tests, self.courses(), name)

    def _repr_html_(self) -> str:
        sentence = self.result.verdict.sentence
        return f"<p><b>{self.path.name}</b>: {sentence}</p>{self.summary().to_html()}"


def open_run(path: str | Path, read: Read = Path.read_bytes) -> Run:
    """Open the folder of a calibration or a discovery.

    Args:
        path: The folder that `heatrun calibrate` or `heatrun discover` wrote.
        read: Reads a file, for places from where not all may be read.

    Returns:
        The run; its files are read when they are asked for.

    Raises:
        InputError: If the folder is no run, or a file is damaged or was changed.
    """
    folder = Path(path)
    content = read_listed(folder, "fit.json", read)
    return Run(folder, from_json(content, FitResult, "fit.json", str(folder)), read)


def _whole(run: Run, name: str, make: Callable[[], T]) -> T:
    """Return what a file of the run says, or the error that it is damaged."""
    try:
        return make()
    except InputError:
        raise
    except Exception as error:  # what is no run of ours fails in nearly any way
        raise InputError(
            f"{name} of the run cannot be read ({type(error).__name__}: {error}).",
            where=str(run.path),
            remedy="Calibrate again with this version.",
        ) from error


def _files_of(
    entries: Sequence[DescribedTest], files: Sequence[SourceFile]
) -> list[tuple[SourceFile, ...]]:
    """Return the files of each test: the manifest lists those of all tests in a row.

    `fit.json` names the first file of each test, so a file belongs to the test before it unless
    it is the first of the next.
    """
    starts: list[int] = []
    at = 0
    for entry in entries:
        if not entry.path:  # a record that was made in memory
            starts.append(at)
            continue
        while (files[at].path, files[at].sha256) != (entry.path, entry.sha256):
            at += 1
        starts.append(at)
        at += 1
    ends = [*starts[1:], len(files)]
    return [tuple(files[a:b]) for a, b in zip(starts, ends, strict=True)]


def _table(content: bytes) -> pd.DataFrame:
    # as words first: read as numbers, some versions of pandas lose the last digit
    words = pd.read_csv(io.BytesIO(content), dtype=str, keep_default_na=False)
    return words.replace("", "nan").astype(np.float64)


CERTIFICATE = "certificate.toml"
"""What `heatrun sheet --meta` stated of a run; it goes before what its motor file says."""


def certificate_of(run: Run) -> Certificate:
    """Return what `[certificate]` of the motor file and later `--meta` said of a run.

    Raises:
        InputError: If a file of the run is damaged or was changed.
    """
    if not run.is_finished or CERTIFICATE not in run.manifest["files"]:
        return run.motor.certificate
    stated = parse_meta(run.file(CERTIFICATE), str(run.path / CERTIFICATE))
    return run.motor.certificate.beneath(stated)


def plot_courses(
    tests: Sequence[tuple[str, str]], courses: Sequence[pd.DataFrame], network: str
) -> Any:
    """Return a matplotlib figure with one axis for each test."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.6 * len(tests)), layout="constrained")
    axes = figure.subplots(len(tests), 1, squeeze=False)[:, 0]
    for axis, (name, role), table in zip(axes, tests, courses, strict=True):
        minutes = table["time_s"] / 60.0
        columns = [f"{network}_{part}_degC" for part in ("winding", "total_95_low",
                                                         "total_95_high")]  # fmt: skip
        median, low, high = (table[column] for column in columns)
        axis.fill_between(minutes, low, high, alpha=0.25, label="95 % with noise")
        axis.plot(minutes, table["measured_degC"], "k.", ms=2, label="measured")
        axis.plot(minutes, median, lw=1.2, label=f"{network} network")
        axis.set_title(f"{name} ({role})", fontsize=9)
        axis.set_ylabel("winding [°C]")
    axes[0].legend(fontsize=8)
    axes[-1].set_xlabel("time [min]")
    return figure
