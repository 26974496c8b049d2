"""One test of a run, read again from the very files that the run was made of.

A run folder holds parameters and paths, no signals. What is exported must be what was fitted, so
every file is compared with the SHA-256 in the manifest before a sample of it is used.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..bench.blocks import Blocks
from ..bench.joined import read_test
from ..bench.readers.open_file import digest
from ..bench.record import Record
from ..bench.reduction import reduce
from ..errors import InputError
from ..inference.model import ALL_NAMES, OF_ONE_TEST, Model, Order, parameters
from ..motor import Motor
from ..motorfile import load_motor
from ..runs.run_folder import MANIFEST, load_result


@dataclass(frozen=True)
class RunTest:
    """A test of a run with the values that the run found for it.

    Attributes:
        run: The run folder.
        order: Order of the network.
        motor: The machine, from the run's motor file.
        record: The test at its full rate, under its name in the run.
        values: Medians of the posterior, or fixed values, by parameter name without the test.
        is_held_out: Whether the run predicted the test only; its start is then taken from its
            first readings.
        inputs: Every file that the run was made of, as the manifest names it.
    """

    run: Path
    order: Order
    motor: Motor
    record: Record
    values: Mapping[str, float]
    is_held_out: bool
    inputs: tuple[Path, ...]


def read_run_test(run: Path, *, test: str | None = None, order: Order | None = None) -> RunTest:
    """Read a test of a run again.

    Args:
        run: The run folder.
        test: Name of the test; None for the first that was calibrated on.
        order: Order of the network; None for the second where the run has it.

    Raises:
        InputError: If the folder is no run, lacks the order or the test, its model has effects
            beyond the network, or a file of it is missing or has changed since.
    """
    result = load_result(run)
    try:
        chosen = _order(result, order, run)
        _refuse_effects(result, chosen, run)
        inputs = _inputs(run)
        position = _position(result["tests"], test, run)
        motor = _motor(result, run)
        record = _record(result, inputs, position, motor, run)
        entry = result["tests"][position]
        is_held_out = entry["role"] == "holdout"
        values = _values(result["models"][chosen], record.name, is_held_out, run)
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"fit.json or {MANIFEST} lacks what an export needs ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again with this version.",
        ) from error
    blocks = reduce(record, motor)  # also refuses times that do not increase
    values = _with_start(values, chosen, motor, blocks, is_held_out)
    paths = tuple(Path(entry["path"]) for entry in inputs)
    return RunTest(run, chosen, motor, record, values, is_held_out, paths)


def _order(result: Mapping[str, Any], order: Order | None, run: Path) -> Order:
    models = result["models"]
    chosen: Order = order or ("second" if "second" in models else "first")
    if chosen not in models:
        raise InputError(
            f"the run holds no {chosen} order, only {', '.join(models)}.",
            where=str(run),
            remedy="Pass --model, or calibrate with --model both.",
        )
    return chosen


def _refuse_effects(result: Mapping[str, Any], order: Order, run: Path) -> None:
    names = {_bare(name) for name in result["models"][order]["parameters"]}
    unknown = sorted(names - set(ALL_NAMES))
    effects = list(result.get("effects", ())) or unknown
    if effects or unknown:
        raise InputError(
            f"the model of this run has effects beyond the {order}-order network "
            f"({', '.join(effects)}), which prova.mat has no variables for.",
            where=str(run),
            remedy="Export a run of `heatrun calibrate` on the same tests.",
        )


def _bare(name: str) -> str:
    """Return the name of a parameter without the test in brackets."""
    return name.partition("[")[0]


def _inputs(run: Path) -> list[dict[str, str]]:
    file = run / MANIFEST
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{MANIFEST} cannot be read: {error}.", where=str(run), remedy="Calibrate again."
        ) from error
    return [{"path": str(e["path"]), "sha256": str(e["sha256"])} for e in content["inputs"]]


def _position(tests: Sequence[Mapping[str, Any]], name: str | None, run: Path) -> int:
    if name is None:
        calibrated = [i for i, entry in enumerate(tests) if entry["role"] == "calibration"]
        if not calibrated:
            raise InputError(
                "the run has no test that was calibrated on.",
                where=str(run),
                remedy="Name a test with --test.",
            )
        return calibrated[0]
    names = [entry["name"] for entry in tests]
    if name not in names:
        raise InputError(
            f"the run has no test {name!r}.",
            where=str(run),
            remedy=f"Pass --test with one of: {', '.join(names)}.",
        )
    return names.index(name)


def _motor(result: Mapping[str, Any], run: Path) -> Motor:
    said = result["motor"]
    _refuse_changed(str(said["path"]), str(said["sha256"]), run, "motor file")
    return load_motor(said["path"])


def _record(
    result: Mapping[str, Any],
    inputs: Sequence[Mapping[str, str]],
    position: int,
    motor: Motor,
    run: Path,
) -> Record:
    """Return the test, read as the run read it, from files that are still the same."""
    files = _files_of(result["tests"], inputs[1:], position)
    for file in files:
        _refuse_changed(file["path"], file["sha256"], run, "record")
    command = str(result.get("command", ""))
    record = read_test("+".join(_with_rate(file["path"], command) for file in files), motor)
    entry = result["tests"][position]
    if record.time_s.size != entry["num_samples"]:
        raise InputError(
            f"the run saw {entry['num_samples']} samples, this version reads "
            f"{record.time_s.size} from the same file.",
            where=f"{run}, {entry['name']}",
            remedy="Calibrate again with this version.",
        )
    return replace(record, name=entry["name"])


def _files_of(
    tests: Sequence[Mapping[str, Any]], files: Sequence[Mapping[str, str]], position: int
) -> Sequence[Mapping[str, str]]:
    """Return the files of one test: the manifest lists those of all tests in a row.

    `fit.json` names the first file of each test, so a file belongs to the test before it unless
    it is the first of the next.
    """
    starts: list[int] = []
    at = 0
    for entry in tests:
        while (files[at]["path"], files[at]["sha256"]) != (entry["path"], entry["sha256"]):
            at += 1
        starts.append(at)
        at += 1
    ends = [*starts[1:], len(files)]
    return files[starts[position] : ends[position]]


def _with_rate(path: str, command: str) -> str:
    """Return a path with the sampling rate that the run's command gave it, if it did."""
    found = re.search(re.escape(path) + r"@[0-9.]+\s*Hz", command)
    return path if found is None else found[0]


def _refuse_changed(path: str, expected: str, run: Path, kind: str) -> None:
    try:
        now = digest(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the {kind} {path} of this run cannot be read ({reason}); the run keeps its path "
            "as it was given, and no signals.",
            where=str(run),
            remedy="Start the command in the folder that the run was started in, "
            "or put the file back.",
        ) from error
    if now != expected:
        raise InputError(
            f"the {kind} {path} has changed since the run: SHA-256 {expected[:12]}… then, "
            f"{now[:12]}… now.",
            where=str(run),
            remedy="Put the file of the run back, or calibrate again.",
        )


def _values(model: Mapping[str, Any], test: str, is_held_out: bool, run: Path) -> dict[str, float]:
    """Return medians and fixed values that hold for a test, by bare name."""
    entries = {**model["parameters"], **model["nuisances"]}
    values = {n: float(e["value"]) for n, e in entries.items() if "[" not in n}
    own = {_bare(n): float(e["value"]) for n, e in entries.items() if n.endswith(f"[{test}]")}
    per_test = {_bare(n) for n in entries if "[" in n} - set(OF_ONE_TEST)
    if is_held_out and per_test:
        raise InputError(
            f"{', '.join(sorted(per_test))} was estimated for each test apart, and {test} was "
            "only predicted.",
            where=str(run),
            remedy="Export a test that the run was calibrated on.",
        )
    values |= own
    bad = [n for n, v in values.items() if n[0] in "CR" and not 0.0 < v < math.inf]
    if bad:
        raise InputError(
            f"expected {', '.join(bad)} above 0, got {', '.join(f'{values[n]:g}' for n in bad)}.",
            where=f"{run}, fit.json",
            remedy="Calibrate again.",
        )
    return values


def _with_start(
    values: Mapping[str, float], order: Order, motor: Motor, blocks: Blocks, is_held_out: bool
) -> dict[str, float]:
    """Return the values with the start of a test that was not fitted.

    As `heatrun.inference.predict`: the first readings less the sensor's offset, the stator as far
    below the winding as its prior has it.
    """
    if not is_held_out:
        return dict(values)
    known = parameters(Model.of(order, motor), motor, [blocks]).by_test[0]
    winding = blocks.start_degC - values["sensor_offset"]
    start = {"Tw_start": winding}
    if "Tsr_start" in known:
        start["Tsr_start"] = winding + known["Tsr_start"].centre - blocks.start_degC
    fixed = {n: p.fixed for n, p in known.items() if n in start and p.fixed is not None}
    return {**values, **start, **fixed}
