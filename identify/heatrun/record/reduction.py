"""Reduction of a record to what a fit needs: means over steps, and over blocks to compare."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..errors import InputError
from .balance_errors import own_errors
from .blocks import Blocks, Body, Readings
from .by_resistance import sensor_sd
from .channels import BODIES
from .derive import recorded_shaft_power
from .motor import Motor, Scales
from .record import Record
from .samples import BLOCK_S, integral, needed_channels, pickup, require, rounding_step

STEP_S = 2.0
"""Length of a step [s]: on a winding of 90 s a jump of load inside a step then costs a few
thousandths of a kelvin for a while, everything else far less."""

LONGEST_STEP_S = 5.0
"""Slower records are stepped through at most this far at once [s]."""

MOST_STEPS, LONGEST_OF_DAYS_S = 8_000, 60.0
"""Records of days, sampled every few minutes, have longer steps: as many as these at most [1], of
at most a minute [s]. A machine that is logged so slowly takes hours, its winding minutes; a network
with a faster node is refused (`heatrun.posterior.driven`)."""

FEWEST_BLOCKS = 90
"""A short test gets shorter blocks, so that at least this many remain for the noise model."""

OTHER_SINK = {"ambient": "coolant_degC", "coolant": "ambient_degC"}
"""Channel of the sink that the motor file does not name as its own, for networks of both."""

FEWEST_SAMPLES = 20
"""With fewer readings than this not even the noise can be told from the parameters."""


def reduce(
    record: Record, motor: Motor, *, step_s: float | None = None, block_s: float | None = None
) -> Blocks:
    """Reduce a record to steps and blocks; power is conserved, nothing is smoothed.

    Args:
        record: A record with the channels that a fit needs.
        motor: Says which channel is the sink, and what effects are scaled with; where it does not,
            with the largest of this record.
        step_s: Length of a step [s]; by default about 2 s, or the sampling period if longer.
        block_s: Length of a block [s]; by default about 20 s, shorter for a short test.

    Raises:
        InputError: If a channel is missing, time does not increase, or too few samples remain.
    """
    time = record.time_s
    motor = with_scales(motor, [record])
    require(record, needed_channels(record, motor))
    if np.any(~np.isfinite(time)) or np.any(np.diff(time) <= 0):
        raise InputError(
            "time must increase from sample to sample and does not",
            where=record.name,
            remedy="Run `heatrun check` on the file: it names the lines.",
        )
    num_read = np.count_nonzero(np.isfinite(record["winding_degC"]))
    if num_read < FEWEST_SAMPLES:
        raise InputError(
            f"{num_read} samples with a winding temperature, expected at least {FEWEST_SAMPLES}",
            where=record.name,
            remedy="Record the whole heat run, at 1 Hz or faster.",
        )
    sample_s = float(np.median(np.diff(time)))
    step = step_s or _step_length(sample_s, record.duration_s)
    wanted_s = block_s or min(BLOCK_S, record.duration_s / FEWEST_BLOCKS)
    steps_per_block = max(1, round(max(wanted_s, sample_s) / step))
    num_blocks = max(1, math.ceil(record.duration_s / (step * steps_per_block) - 1e-9))
    shape = (num_blocks, steps_per_block)
    edges = time[0] + step * np.arange(num_blocks * steps_per_block + 1)

    means, notes = _means(record, motor, edges, step)
    winding, at_s, reading = _body(record, "winding_degC", edges, shape)
    of_winding: dict[str, Any] = {
        each.name: getattr(winding, each.name) for each in fields(Readings)
    }
    of_winding["start_degC"] = _start(at_s, reading, step * steps_per_block)
    bodies = (body for body in BODIES if body in record and np.isfinite(record[body]).any())
    return Blocks(
        name=record.name,
        means=means,
        **of_winding,
        block_s=step * steps_per_block,
        sample_s=sample_s,
        bodies=tuple(_body(record, body, edges, shape)[0] for body in bodies),
        first_s=float(time[0]),
        has_current="phase_current_A" in record,
        sensor_sd=sensor_sd(record, motor),
        jumps_with_load=pickup(record) is not None,
        notes=notes,
        told=own_errors(record, motor),
    )


def with_scales(motor: Motor, records: Sequence[Record]) -> Motor:
    """Return the motor with what its effects are scaled with.

    What it does not say yet is its rated figure, else the largest of the records, those that a
    model is fitted to.
    """

    def largest(channel: str) -> float | None:
        found = [np.abs(record[channel]) for record in records if channel in record]
        most = max((float(np.nanmax(v)) for v in found if np.any(np.isfinite(v))), default=0.0)
        return most or None

    said = motor.scales
    return replace(motor, scales=Scales(
        speed_rpm=said.speed_rpm or motor.rated_speed_rpm or largest("speed_rpm"),
        current_A=said.current_A or motor.rated_current_A or largest("phase_current_A"),
        flow_L_per_min=said.flow_L_per_min or largest("coolant_flow_L_per_min"),
    ))  # fmt: skip


def _step_length(sample_s: float, duration_s: float) -> float:
    target = min(STEP_S, duration_s / (10 * FEWEST_BLOCKS))
    if sample_s <= target:
        return sample_s * max(1, round(target / sample_s))
    longest = min(max(LONGEST_STEP_S, duration_s / MOST_STEPS), LONGEST_OF_DAYS_S)
    return sample_s / math.ceil(sample_s / longest - 1e-9)


def _means(
    record: Record, motor: Motor, edges: np.ndarray, step: float
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the means over the steps by the names of `lptn.Inputs`, and what was interpolated."""
    notes: list[str] = []

    def mean(channel: str, power: int = 1) -> np.ndarray:
        values = record[channel] ** power
        finite = np.isfinite(values)
        if not np.any(finite):
            raise InputError(f"channel {channel} holds no number", where=record.name,
                             remedy="Check the column that it is mapped to.")  # fmt: skip
        if not np.all(finite):
            notes.append(
                f"{record.name}: {np.sum(~finite)} missing samples of {channel} were "
                "interpolated linearly"
            )
        return _interval_means(record.time_s[finite], values[finite], edges)

    def mean_if_any(channel: str) -> np.ndarray | None:
        is_there = channel in record and np.any(np.isfinite(record[channel]))
        return mean(channel) if is_there else None

    speed = mean_if_any("speed_rpm")
    coolant = mean_if_any("coolant_degC")
    second = OTHER_SINK[motor.sink]
    second_sink = coolant if second == "coolant_degC" else mean_if_any(second)
    fan = None
    for channel, full in (("fan", 1.0), ("coolant_flow_L_per_min", motor.scales.flow_L_per_min)):
        if fan is None and channel in record and np.nanmax(np.abs(record[channel])) > 0:
            fan = mean(channel) / (full or 1.0)
    shaft = recorded_shaft_power(record.channels)
    if shaft is not None:
        finite = np.isfinite(shaft)
        shaft = _interval_means(record.time_s[finite], shaft[finite], edges)
    has_current = "phase_current_A" in record
    means = {
        "step": step,
        "current_squared": mean("phase_current_A", 2) if has_current else np.zeros(edges.size - 1),
        "losses": mean("losses_W"),
        "ambient": mean(f"{motor.sink}_degC"),
        "speed": None if speed is None else speed * (2 * math.pi / 60),
        "coolant": coolant,
        "fan": fan,
        "shaft_power": shaft,
        "second_sink": second_sink,
        "rated_speed": (motor.scales.speed_rpm or 30 / math.pi) * 2 * math.pi / 60,
        "rated_current": motor.scales.current_A or 1e-6,
    }
    found = {name: np.asarray(each, float) for name, each in means.items() if each is not None}
    return found, tuple(notes)


def _interval_means(time: np.ndarray, values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the means of the straight-line course between samples over each interval.

    Beyond the first and the last sample the value is held.
    """
    if time.size == 1:
        return np.full(edges.size - 1, values[0])
    inside = edges[(edges > time[0]) & (edges < time[-1])]
    knots = np.union1d(time, inside)
    course = np.interp(knots, time, values)
    area = integral(course, np.diff(knots))
    at_edges = np.interp(edges, knots, area)
    at_edges += np.minimum(edges - time[0], 0.0) * values[0]
    at_edges += np.maximum(edges - time[-1], 0.0) * values[-1]
    return np.diff(at_edges) / np.diff(edges)


def _body(
    record: Record, channel: str, edges: np.ndarray, shape: tuple[int, int]
) -> tuple[Body, np.ndarray, np.ndarray]:
    """Return the readings of a temperature, reduced, and as they are: times [s] and values [degC].

    A sample belongs to the step that it ends; the very first one belongs to the first step. What
    stands in for the mean of a block without a reading is that over all of its time.
    """
    is_read = np.isfinite(record[channel])
    time, reading = record.time_s[is_read], record[channel][is_read]
    num_steps = edges.size - 1
    step = edges[1] - edges[0]
    index = np.ceil((time - edges[0]) / step - 1e-9).astype(int) - 1
    index = np.clip(index, 0, num_steps - 1)
    per_step = np.bincount(index, minlength=num_steps).astype(float)
    offset = (time - edges[index]) / step
    filled = np.maximum(per_step, 1.0)
    position = np.bincount(index, weights=offset, minlength=num_steps) / filled
    position = position.reshape(shape)

    block = index // shape[1]
    count = np.bincount(block, minlength=shape[0]).astype(float)
    with np.errstate(invalid="ignore"):
        measured = np.bincount(block, weights=reading, minlength=shape[0]) / count
        middle = np.bincount(block, weights=time, minlength=shape[0]) / count
        weight = per_step.reshape(shape) / count[:, None]
    empty = count == 0
    middle[empty] = (edges[:-1].reshape(shape)[:, 0] + 0.5 * step * shape[1])[empty]
    weight[empty], position[empty] = 1.0 / shape[1], 0.5
    body = Body(
        channel=channel,
        measured=measured,
        weight=weight,
        position=position,
        count=count,
        time=middle - record.time_s[0],
        rounding_K=rounding_step(reading) or 0.0,
        start_degC=float(np.mean(reading[:5])),
        sensor=record.column_of(channel),
    )
    return body, time, reading


def _start(time: np.ndarray, reading: np.ndarray, block_s: float) -> float:
    """Return the first temperature [degC], from the trend of the first block."""
    first = time <= max(time[0] + block_s, time[min(4, time.size - 1)])
    offset = time[first] - time[0]
    return float(np.polyfit(offset, reading[first], 1)[1])
