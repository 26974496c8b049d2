"""What a port of the C is held against: inputs and courses of a test, as CSV."""

from __future__ import annotations

import io
import itertools
import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from .laws import INPUTS, in_comment
from .network_course import simulate_held, without_errors_of_bench
from .network_file import SIGNALS

if TYPE_CHECKING:
    from .c_file import CSource

VECTOR_S = 7200.0
"""Length of the vectors at most [s]."""

OBSERVED_STEPS, ASKED_EVERY = 1800, 60
"""Steps of each course of the observer's vectors at most, and between two questions for time to the
limit and permitted current, which cost many steps."""

COURSES = ("a sound sensor", "lost for a third of the course", "sticks for a third of the course",
           "a start that is 30 K wrong")  # fmt: skip
"""What the observer's vectors go through."""

MOST_PLAYED = 50_000
"""Steps of a test that the observer is played on, at most: fourteen hours at 1 Hz."""

ASKS_NOTHING = (-1.0, 0.0, 0.0)
"""Node, limit and horizon of a step without a question."""

START_SD_K = 5.0
"""How well the temperatures at the start of a course are known [K]."""


def vectors(source: CSource, test: str) -> bytes:
    """Return inputs and what `lptn` makes of them, as CSV.

    The first row holds the start; every other one the inputs held over a step, those of the
    record at its middle, and the temperatures at its end.

    Args:
        source: The network as C.
        test: Name of the test, for the comment.

    Raises:
        InputError: If the test is shorter than a step.
    """
    if source.num_vectors < 1:
        raise InputError(
            f"the test is shorter than a step of {source.step:g} s.",
            where=test,
            remedy="Pass a shorter --step, or another --test.",
        )
    held, course = _driven(source)
    columns = [source.step * np.arange(len(held) + 1)]
    columns += [*np.vstack([np.zeros(held.shape[1]), held]).T, *course.T]
    heading = [*_driving(source), *(f"{node}_degC" for node in source.nodes)]
    text = io.StringIO()
    text.write(f"# heatrun export: inputs and lptn's temperatures, test {in_comment(test)}\n")
    np.savetxt(text, np.column_stack(columns), "%.17g", ",", header=",".join(heading),
               comments="")  # fmt: skip
    return text.getvalue().encode("ascii")


def observer_courses(source: CSource, test: str) -> bytes:
    """Return inputs and readings of `COURSES`, as CSV: the harness writes the outputs.

    The machine is as the model has it, the readings those of its sensor with the white noise
    of the run, to 0.01 K.

    Args:
        source: The network as C.
        test: Name of the test, for the comment; it is no shorter than a step.
    """
    held, course = (each[: OBSERVED_STEPS + k] for k, each in enumerate(_driven(source)))
    num = len(held)
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, source.missed.reading(source.step), (len(COURSES), num))
    copper = source.nodes.index(source.found["copper_node"])
    question = [copper, np.round(course[:, copper].max(), 1), 600.0 * source.step]
    asked = np.where((np.arange(1, num + 1) % ASKED_EVERY == 0)[:, None], question, ASKS_NOTHING)
    text = io.StringIO()
    text.write(f"# heatrun export: inputs, readings and the observer's outputs by this C in "
               f"double, test {in_comment(test)}\n{_observed_heading(source)}\n")  # fmt: skip
    for k, (what, each) in enumerate(zip(COURSES, noise, strict=True)):
        reading = np.round(_shown(source, course) + each, 2)
        late = slice(num // 3, 2 * num // 3)
        if k == 1:
            reading[late] = np.nan
        elif k == 2:
            reading[late] = reading[late][:1]
        wrong_K, sd_K = (-30.0, 30.0) if k == 3 else (0.0, START_SD_K)
        text.write(f"# {what}\n")
        _write_observed(source, text, held, reading, course[0] + wrong_K, sd_K, asked)
    return text.getvalue().encode("ascii")


def readings(source: CSource) -> bytes:
    """Return inputs and readings of the test, `MOST_PLAYED` steps at most, as
    `observer_courses`: where no sample falls into a step there is none. They come without
    errors of the bench's sensor, such as its pickup.
    """
    time = source.found["t"] - source.found["t"][0]
    num = min(int(time[-1] / source.step + 1e-9), MOST_PLAYED)
    latest = np.searchsorted(time, source.step * np.arange(num + 1) + 1e-9, side="right") - 1
    is_new = np.diff(latest) > 0
    reading = np.where(is_new, without_errors_of_bench(source.found)[latest[1:]], np.nan)
    held, start = _by_name(source, num), np.atleast_1d(source.found["start"])
    asked = np.tile(ASKS_NOTHING, (num, 1))
    text = io.StringIO()
    text.write(f"{_observed_heading(source)}\n")
    rows = np.column_stack([held[name] for name in source.inputs])
    _write_observed(source, text, rows, reading, start, START_SD_K, asked)
    return text.getvalue().encode("ascii")


def _observed_heading(source: CSource) -> str:
    outputs = [f"{node}_{what}" for node in source.nodes for what in ("degC", "sd_K")]
    asked = ("reading_degC", "node", "limit_degC", "horizon_s")
    told = (*outputs, "status", "sensor", "time_to_limit_s", "permitted_A")
    return ",".join([*_driving(source), *asked, *told])


def _write_observed(
    source: CSource, text: io.StringIO, held: np.ndarray, reading: np.ndarray,
    start: np.ndarray, sd_K: float, asked: np.ndarray,
) -> None:  # fmt: skip
    """Write the start, and inputs, readings and questions of each step; outputs are NaN."""
    unknown = np.full((len(held), 2 * len(source.nodes) + 4), np.nan)
    time_s = source.step * np.arange(1, len(held) + 1)
    rows = np.column_stack([time_s, held, reading, asked, unknown])
    both = [each for T in start for each in (T, sd_K)]
    first = [*np.zeros(1 + held.shape[1]), np.nan, *ASKS_NOTHING, *both, 0, 0, -1, -1]
    np.savetxt(text, np.vstack([first, rows]), "%.12g", ",")


def _shown(source: CSource, course: Float[np.ndarray, "time node"]) -> Float[np.ndarray, " step"]:
    """Return what the sensor shows at the end of each step [degC]."""
    at_place = course @ source.reading
    if not source.lag_s:
        return at_place[1:]
    keep = math.exp(-source.step / source.lag_s)
    mean, shown = source.lag_s / source.step * (1.0 - keep), [at_place[0]]
    for before, after in itertools.pairwise(at_place):
        shown.append(keep * shown[-1] + (1.0 - mean) * after + (mean - keep) * before)
    return np.array(shown[1:])


def _driving(source: CSource) -> list[str]:
    """Return the names of time and inputs."""
    return ["time_s", *(INPUTS[name] for name in source.inputs)]


@lru_cache(maxsize=1)
def _driven(source: CSource) -> tuple[np.ndarray, np.ndarray]:
    """Inputs held over the steps (step, input) and temperatures (step + 1, node)."""
    held = _by_name(source, source.num_vectors)
    course = simulate_held(source.of_run, held, source.step)
    rows = np.column_stack([held[name] for name in source.inputs])
    return rows, np.column_stack([course[node] for node in source.nodes])


def _by_name(source: CSource, num: int) -> dict[str, np.ndarray]:
    """Return what drives the machine in the middle of each step, by its name."""
    time = source.found["t"] - source.found["t"][0]
    middle = source.step * (np.arange(num) + 0.5)
    driving = [name for name in SIGNALS if name in source.found and name not in ("t", "Tw_m")]
    held = {name: np.interp(middle, time, source.found[name]) for name in driving}
    held["Is"] = np.sqrt(np.interp(middle, time, source.found["Is"] ** 2))
    return held
