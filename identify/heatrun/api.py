"""The Python interface: what `import heatrun` gives, as short as a notebook wants it."""

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from .calibration import BenchTest, Method, Settings, load_tests
from .checks import check_record
from .jobs import Place, calibrate_into, discover_into
from .model.catalogue import all_effects, known_effects
from .model.network_form import NetworkForm
from .model.network_text import network_named, networks_of, pair_of
from .motor.file import load_motor
from .readers.joined import read_test, read_tests
from .record.motor import Motor
from .record.record import Finding
from .results import DiscoveryResult
from .runs.run import Run, open_run
from .simulation import read_parameters, simulate_values

Files = Sequence[str | Path] | str | Path


@dataclass(frozen=True, eq=False)
class Found:
    """What a discovery found.

    Attributes:
        run: Its run: the model with the effects that were accepted.
    """

    run: Run

    @property
    def result(self) -> DiscoveryResult:
        """What stands in `discovery.json`."""
        result = self.run.discovery
        assert result is not None
        return result

    @property
    def verdict(self) -> str:
        """`"adequate"`, `"named"`, `"ambiguous"`, `"unexplained"` or `"not_identifiable"`."""
        return self.result.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects that were accepted, in order."""
        return tuple(effect.id for effect in self.result.effects)

    def summary(self) -> pd.DataFrame:
        """Return the accepted effects: parameters with 95 % intervals, equivalents, evidence."""
        rows = [
            {
                "effect": effect.id,
                "parameter": name,
                "value": entry.value,
                "low_95": entry.interval_95[0],
                "high_95": entry.interval_95[1],
                "unit": entry.unit,
                "equivalents": ", ".join(effect.equivalents),
                "delta_log_evidence": effect.evidence.delta_log_evidence,
            }
            for effect in self.result.effects
            for name, entry in effect.parameters.items()
        ]
        return pd.DataFrame(rows)

    def _repr_html_(self) -> str:
        return f"<p>{self.result.sentence}</p>{self.summary().to_html(index=False)}"


def calibrate(
    motor: str | Path | Motor,
    tests: Files,
    *,
    holdout: Files = (),
    model: str | NetworkForm | Sequence[NetworkForm] = "both",
    effects: Sequence[str] = (),
    method: Method = "emcee",
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
) -> Run:
    """Calibrate the thermal network of a motor on bench tests.

    Args:
        motor: Motor file, or the machine.
        tests: Bench files that are fitted.
        holdout: Bench files that are predicted only.
        model: `"first"`, `"second"`, `"both"`, a TOML file with a network, several of these with
            commas between, or networks themselves.
        effects: Ids of known effects, such as `"speed_cooling"`.
        method: `"emcee"`, or `"quick"`: importance sampling where its guard holds.
        seed: Random seed.
        out: The run folder; None for one that is removed with the run.
        force: Whether another run in `out` is replaced.

    Returns:
        The run, as `open_run` gives it.

    Raises:
        InputError: If a file cannot be read, or something that a model needs is not given.
        Refused: If a check forbids the calibration; its findings say why.

    Example:
        >>> run = heatrun.calibrate("motor.toml", ["duty.csv"], holdout=["step.csv"])
        >>> run.summary()  # doctest: +SKIP
    """
    machine = _motor(motor)
    read = load_tests(machine, _paths(tests), _paths(holdout))
    if isinstance(model, str):
        model = networks_of(model)
    networks = (model,) if isinstance(model, NetworkForm) else tuple(model)
    with _folder(out) as (folder, is_kept):
        settings = Settings(
            networks=networks, effects=known_effects(machine, ",".join(effects)), method=method,
            seed=seed, command="heatrun.calibrate",
        )  # fmt: skip
        _, path = calibrate_into(Place(folder, is_replacing=force), machine, read, settings)
        return _opened(path, is_kept)


def compare(
    motor: str | Path | Motor,
    tests: Files,
    *,
    holdout: Files = (),
    model: str = "both",
    **settings: Any,
) -> pd.DataFrame:
    """Return RMSE, maximum error, coverage and evidence of two networks on the same tests.

    Args:
        motor: As `calibrate`.
        tests: As `calibrate`.
        holdout: As `calibrate`.
        model: The two networks, such as `"both"` or `"second,four.toml"`; a single one is compared
            with the second order.
        **settings: `effects`, `method` and `seed` of `calibrate`.
    """
    run = calibrate(motor, tests, holdout=holdout, model=pair_of(model), **settings)
    rows = [
        {"network": name, **asdict(row), "log_evidence": model.evidence.log_evidence}
        for name, model in run.result.models.items()
        for row in model.residuals
    ]
    return pd.DataFrame(rows).set_index(["test", "network"]).sort_index()


def discover(
    source: Run | str | Path | Motor,
    tests: Files = (),
    *,
    holdout: Files = (),
    model: str | NetworkForm | None = None,
    effects: Sequence[str] = (),
    own_effects: Sequence[str | Path] = (),
    method: Method = "emcee",
    seed: int = 0,
    out: str | Path | None = None,
    force: bool = False,
) -> Found:
    """Find where simulation and measurement disagree, and what is missing.

    Args:
        source: A run, whose motor, tests and last network are taken; or a motor file.
        tests: Bench files, where no run is given.
        holdout: Bench files that are predicted; they judge what is accepted.
        model: The base network; that of the run, or the second order, if None.
        effects: Ids of effects that the base network has.
        own_effects: Python files with effects of your own, searched beside the catalogue.
        method: As `calibrate`.
        seed: Random seed.
        out: As `calibrate`.
        force: As `calibrate`.

    Raises:
        InputError: As `calibrate`.
    """
    if isinstance(source, Run):
        found = source.model()
        machine, form = source.motor, found.model.form
        known = found.model.effects
        read = _tests_of(source, machine)
    else:
        machine = _motor(source)
        form = network_named("second")
        known = known_effects(machine, ",".join(effects))
        read = load_tests(machine, _paths(tests), _paths(holdout))
    if model is not None:
        form = network_named(model)
    files = [Path(file) for file in own_effects]
    with _folder(out) as (folder, is_kept):
        settings = Settings(
            networks=(form,), effects=known, kinds=all_effects(files), files=files, method=method,
            seed=seed, command="heatrun.discover",
        )  # fmt: skip
        job = discover_into(Place(folder, is_replacing=force), machine, read, settings)
        return Found(_opened(job.path, is_kept))


def simulate(
    motor: str | Path | Motor,
    source: Run | str | Path | Mapping[str, float],
    test: str | Path,
    *,
    model: str | None = None,
    seed: int = 0,
) -> pd.DataFrame:
    """Return the record of a virtual prototype driven by a test.

    Args:
        motor: How the bench of the test measures.
        source: A run or its folder; or parameters by name, or a file of them: TOML or `prova.mat`.
        test: The bench file whose currents, losses and sink drive the model.
        model: Name of the network; the last one of a run, or the second order, if None.
        seed: Random seed.
    """
    machine = _motor(motor)
    record = read_test(Path(test), machine)
    if isinstance(source, Mapping):
        return simulate_values(machine, source, record, model or "second")
    if not isinstance(source, Run) and Path(source).is_file():
        given = read_parameters(Path(source), model, machine)
        return simulate_values(given.motor, given.values_for(record), record, given.form)
    run = source if isinstance(source, Run) else open_run(source)
    return run.simulate(record, network=model, motor=machine, seed=seed)


def check(motor: str | Path | Motor, tests: Files) -> list[Finding]:
    """Return the findings about bench files, before anything is fitted."""
    machine = _motor(motor)
    records = [record for path in _paths(tests) for record in read_tests(path, machine)]
    return [finding for record in records for finding in check_record(record, machine)]


def _motor(motor: str | Path | Motor) -> Motor:
    return motor if isinstance(motor, Motor) else load_motor(motor)


def _paths(files: Files) -> list[Path]:
    return [Path(file) for file in ([files] if isinstance(files, str | Path) else files)]


@contextmanager
def _folder(out: str | Path | None) -> Iterator[tuple[Path, bool]]:
    """Give where a run goes, and whether it stays; a job that fails leaves nothing behind."""
    if out is not None:
        yield Path(out), True
        return
    made = tempfile.mkdtemp(prefix="heatrun-")
    try:
        yield Path(made) / "run", False
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise


def _opened(path: Path, is_kept: bool) -> Run:
    run = open_run(path)
    if not is_kept:
        weakref.finalize(run, shutil.rmtree, path.parent, ignore_errors=True)
    return run


def _tests_of(run: Run, motor: Motor) -> tuple[BenchTest, ...]:
    """Return the tests of a run, read from the files that it was made of."""
    by_role: dict[str, list[Path]] = {"calibration": [], "holdout": []}
    for test in run.tests:
        by_role[test.role].append(Path(run.source(test)))
    return load_tests(motor, by_role["calibration"], by_role["holdout"])
