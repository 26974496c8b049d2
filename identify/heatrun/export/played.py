"""The C played as it is exported: outputs for its vectors, and what its observer tells of the tests
that the run was calibrated on, whose sensor was sound.

A network that misses a part of the machine is off for a while after a change of load, as a sensor
is that lags. Where the observer takes that for a fault in the tests of its own run, the network
misses more than the noise of the run's block means tells: so much more is given to it that it tells
no fault there.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .c_file import HARNESS, OBSERVER_VECTORS, SOURCE, CSource

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
    courses = [replace(source, of_run={**source.of_run, **own}).readings()
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
