"""A run as sources that hold its laws: C99 for a drive, an FMU around it, Modelica.

The C is played as it is exported: outputs for its vectors, and what its observer tells of the tests
that the run was calibrated on, whose sensor was sound.

A network that misses a part of the machine is off for a while after a change of load, as a sensor
is that lags. Where the observer takes that for a fault in the tests of its own run, the network
misses more than the noise of the run's block means tells: so much more is given to it that it tells
no fault there.
"""

import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InputError
from ..io.whole_files import numbered
from ..runs.run import Run, open_run
from .c_file import HARNESS, MOST_BYTES, OBSERVER_VECTORS, SOURCE, STEP_S, VECTORS, CSource
from .fmu import compiled, fmu_files
from .laws import LAWS, Entry, entries, lacking_laws, refuse_lawless
from .mat import NETWORK, mat_bytes, write_export, zipped
from .missed import Missed, names_of_laws
from .modelica import modelica
from .network_course import read_network
from .network_file import SIGNALS
from .rerun import RunAndTest, as_replica, effects_of, of_no_test, read_run_test, shaft_of
from .variables import Corrections
from .vectors import observer_courses, readings, vectors


class Sourced(NamedTuple):
    """The network of a run as C."""

    source: CSource  # The C.
    parameters: list[Entry]  # What the run has found, with its intervals.
    found: RunAndTest  # Test and values that it was made of.
    notes: tuple[str, ...]  # Sentences on them.


def export_source(
    run: Path,
    *,
    to: Literal["c", "fmu", "modelica"] = "c",
    folder: Path | None = None,
    test: str | None = None,
    network: str | None = None,
    is_replica: bool = False,
    is_replacing: bool = False,
    step: float = STEP_S,
) -> dict[str, Any]:
    """Write the network of a run as C99, as an FMU or in Modelica, with vectors of a test.

    The C has a harness for its vectors beside it. The FMU is compiled where FMPy and a C compiler
    are there; else it holds its sources alone, and a note says so.

    Args:
        run: The run folder.
        to: What is written.
        folder: Where the files go; None for a folder named `to` in the run, numbered where that
            holds another export.
        test: As `read_run_test`.
        network: As `read_run_test`.
        is_replica: Whether the nearest network with `LAWS` alone goes in its place; it has no
            intervals.
        is_replacing: Whether another export in `folder` is replaced.
        step: Length of a step of C and vectors, the longest of the FMU [s].

    Returns:
        As plain data: the files, test, network (`order`, `title`) and effects, nodes, step [s],
        its parts, steps of the vectors, parameters with their intervals, notes and findings; of C
        whether there is an observer, of an FMU whether it is compiled.

    Raises:
        InputError: As `read_run_test` and `network_variables`; if the source lacks the law of an
            effect, or the step is not one for this network; as `write_export`.
    """
    read = read_source(run, test, network, is_replica, step)
    source, parameters, found = read.source, read.parameters, read.found
    notes, further, of_test = [*found.notes, *read.notes], {}, vectors(source, found.record.name)
    if to == "fmu":
        files = fmu_files(source, parameters)
        binaries, why_none = compiled(files)
        content = {"thermal_network.fmu": zipped({**files, **binaries})}
        notes, further = [*notes, *why_none], {"is_compiled": bool(binaries)}
    elif to == "modelica":
        content = {"ThermalNetwork.mo": modelica(source, parameters)}
    else:
        if source.has_observer:
            tests, unread = calibrated(run, network, found)
            source, told = without_false_alarms(source, tests)
            notes += [*unread, *told]
        said = [(e.name, e.member if e.index is None else f"{e.member}[{e.index}]", e.interval_95)
                for e in parameters if e.interval_95]  # fmt: skip
        content, further = source.texts(said), {"has_observer": source.has_observer}
        if source.has_observer:
            courses = {OBSERVER_VECTORS: observer_courses(source, found.record.name)}
            observed, why_none = with_outputs({**content, **courses})
            content, notes = {**content, OBSERVER_VECTORS: observed}, [*notes, *why_none]
            notes += source.not_by_resistance
        else:
            notes.append(f"There is no observer: its state would have {source.state_bytes} bytes "
                         f"with {source.num_states} states (limit {MOST_BYTES}).")  # fmt: skip
    content[VECTORS] = of_test
    places = [folder] if folder else numbered(run / to)
    written = write_export(places, content, found.inputs, is_replacing=is_replacing)
    return {
        "files": [str(path) for path in written],
        "run": str(run),
        "test": found.record.name,
        "order": found.model.name,
        "title": found.model.title,
        "effects": [kind.card.id for kind in found.model.effects],
        "nodes": source.nodes,
        "step_s": step,
        "parts": source.parts,
        "vector_steps": source.num_vectors,
        "parameters": {
            each.name: {"value": each.value, "interval_95": each.interval_95, "unit": each.unit}
            for each in parameters
        },
        **further,
        "notes": notes,
        "findings": [],
    }


def read_source(
    run: Path, test: str | None, network: str | None, is_replica: bool, step: float
) -> Sourced:
    """Return the network of a run as C; arguments and errors as `export_source`."""
    if not is_replica:
        refuse_lawless(effects_of(run, network), str(run))
    is_replica = bool(lacking_laws(effects_of(run, network)))
    opened = open_run(run)
    whole = of_no_test(read_run_test(run, test=test, network=network))
    found, bias = as_replica(whole, network, LAWS) if is_replica else (whole, 0.0)
    variables, notes, corrections = _as_corrected(found)
    missed = Missed.of(opened, network, found, whole, bias)
    title = found.model.title
    said = {
        "run": run.resolve().name,
        "sha256": opened.manifest["files"]["fit.json"],
        "machine": found.motor.name,
        "network": f"{title} (replica)" if is_replica else title,
        "corrections": corrections.words(),
    }
    leads = found.motor.lead_resistance_ohm
    measured, phase = found.motor.measured_resistance_ohm, found.motor.phase_resistance_ohm
    cold = (phase or 0.0) if measured is None else measured - leads
    source = CSource.of(read_network(mat_bytes(variables)), missed, said, step, (cold, leads))
    values = {n: v * missed.aside.get(n, 1.0) for n, v in found.values.items()}
    source = replace(source, aside=_of_values(found, values))
    notes += (f"What drives it is meant as the run corrects it: {corrections.words()}.",)
    limits = [] if is_replica else ends(opened, network, found, source)
    return Sourced(source, entries(source, found.model, limits), found, notes)


def calibrated(
    run: Path, network: str | None, found: RunAndTest
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return what drove the machine in the tests that a run was calibrated on, how it began, and
    what it was read to be, by test; and which of them can no longer be read, in words.

    Args:
        run: The run folder.
        network: Name of the network; None for the last one.
        found: One of its tests.
    """
    tests, unread = {}, []
    for test in open_run(run).tests:
        if test.role != "calibration":
            continue
        try:
            own = found if test.name == found.record.name else read_run_test(
                run, test=test.name, network=network
            )  # fmt: skip
        except InputError as error:
            unread.append(f"The observer was not played on {test.name}: {error}")
            continue
        of_run = read_network(mat_bytes(_as_corrected(own)[0]))
        tests[test.name] = {n: of_run[n] for n in (*SIGNALS, "start") if n in of_run}
    return tests, unread


def _as_corrected(found: RunAndTest) -> tuple[dict[str, Any], tuple[str, ...], Corrections]:
    """Return the variables of a test, what drives it as the run corrects it, with notes."""
    variables, notes = _variables(found)
    corrections = Corrections.of(found.values)
    shaft = shaft_of(found, corrections)
    return NETWORK.corrected(variables, corrections, shaft), notes, corrections


def _variables(found: RunAndTest) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the network with a phase resistance also where all losses heat one body.

    What part of them is copper does not matter there, but to the permitted current.
    """
    ohm, (variables, notes) = found.motor.phase_resistance_ohm, NETWORK.variables(found)
    if "Rs0" in found.values or found.motor.losses != "balance" or not ohm:
        return variables, notes
    variables["Rs0"] = np.full_like(variables["Rs0"], ohm)
    return variables, tuple(note for note in notes if not note.startswith("Rs0 is 0"))


def ends(run: Run, network: str | None, found: RunAndTest, source: CSource) -> list[CSource]:
    """Return the C with all parameters at the lower, and at the upper ends of their intervals.

    Args:
        run: The run.
        network: Name of the network; None for the last one.
        found: What `source` was made of.
        source: The network as C.
    """
    fitted = run.result.models[run.choose(network)]
    stated = {**fitted.parameters, **fitted.nuisances}
    names, made = names_of_laws(found.model), []
    for end in (0, 1):
        moved = {n: stated[n].interval_95[end] for n in names & found.values.keys() & stated.keys()}
        made.append(replace(source, of_run=_of_values(found, {**found.values, **moved})))
    return made


def _of_values(found: RunAndTest, values: Mapping[str, float]) -> dict[str, Any]:
    """Return the variables of `network.mat` with other values of the parameters."""
    return read_network(mat_bytes(_variables(replace(found, values=values))[0]))


LONGEST_BUILD_S = 60.0
"""Time that a compiler, or what it made, is waited for [s]; it takes a second."""

PLAYED = "played.csv"

MORE = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""What the network may miss besides, over the slow noise of the run [1]; tried in turn."""

FAULTS = (2, 3, 5)
"""Values of `heatrun_sensor` that tell a fault: stuck, off, disagrees."""


class NoCompilerError(Exception):
    """No compiler is there, or it does not build what is exported."""


@contextmanager
def built(files: Mapping[str, bytes]) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """Yield the folder of a built harness, and how programs are run in it.

    Args:
        files: Header, source, harness and what it reads, by name.

    Raises:
        NoCompilerError: If it cannot be built here, or ends with an error.
    """
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), "cc")
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            Path(folder, name).write_bytes(content)
        words = {"cwd": folder, "capture_output": True, "check": True, "timeout": LONGEST_BUILD_S}
        build = [compiler, "-std=c99", "-O2", "-o", str(Path(folder, "replay")), HARNESS, SOURCE]
        try:
            subprocess.run(build, **words)
            yield Path(folder), words
        except (OSError, subprocess.SubprocessError) as error:
            raise NoCompilerError from error


def with_outputs(files: Mapping[str, bytes]) -> tuple[bytes, list[str]]:
    """Return the observer's vectors with what the C makes of them in double, or why it made none.

    Args:
        files: Header, source, harness and courses by name.
    """
    try:
        with built(files) as (folder, words):
            return _written(folder, words, OBSERVER_VECTORS), []
    except NoCompilerError:
        return files[OBSERVER_VECTORS], [
            f"{OBSERVER_VECTORS} has inputs and readings alone, for no C compiler built it "
            f"here: ./replay --write {OBSERVER_VECTORS} writes the outputs in double."
        ]


def _written(folder: Path, words: Mapping[str, Any], name: str) -> bytes:
    return subprocess.run([str(folder / "replay"), "--write", name], **words).stdout


def without_false_alarms(
    source: CSource, tests: Mapping[str, Mapping[str, Any]]
) -> tuple[CSource, list[str]]:
    """Return a source whose observer tells no fault in the tests of its run, and what that took.

    Args:
        source: With an observer.
        tests: Variables of `network.mat` by test that the run was calibrated on.
    """
    courses = [readings(replace(source, of_run={**source.of_run, **own}))
               for own in tests.values()]  # fmt: skip

    def played(more: float) -> tuple[CSource, int]:
        widened = replace(source, missed=source.missed.widened(more))
        return widened, faults(widened, courses)

    try:
        widened, first = played(0.0)
        left = first
        for more in MORE:
            if left:
                widened, left = played(more)
    except NoCompilerError:
        return source, ["No C compiler is here: whether the observer tells faults in the tests of "
                        "its own run was not looked at."]  # fmt: skip
    if not first:
        return source, []
    note = (f"In {' and '.join(tests)}, with a sound sensor, the observer told {first} faults: the "
            f"network misses about {widened.missed.misfit_K:.1f} K for a while after a change of "
            "load. It now takes that into account, and tells small faults later. `heatrun "
            "discover` looks for what is missing.")  # fmt: skip
    if left:
        note += f" Even so it tells {left} faults there: do not act on what it says."
    return widened, [note]


def faults(source: CSource, courses: Sequence[bytes]) -> int:
    """Return how many faults of its sensor the observer tells in courses [1].

    Args:
        source: With an observer.
        courses: From `CSource.readings`.

    Raises:
        NoCompilerError: As `built`.
    """
    played = {f"{place}_{PLAYED}": course for place, course in enumerate(courses)}
    with built({**source.texts(), **played}) as (folder, words):
        return sum(_faults(_written(folder, words, name).decode("ascii")) for name in played)


def _faults(text: str) -> int:
    """Return how often the sensor of a played course is told to fail."""
    heading, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    place = heading.split(",").index("sensor")
    sensor = np.loadtxt(io.StringIO("\n".join(rows)), delimiter=",", usecols=place, ndmin=1)
    is_told = np.isin(sensor[1:], FAULTS)
    return int(is_told[0]) + int(np.sum(is_told[1:] & ~is_told[:-1]))
