"""Load profiles: what the bench asks of the machine, in parts of rated torque and speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TORQUE_RAMP_S = 0.5  # a drive builds torque within a fraction of a second
SPEED_RAMP_S = 3.0  # a load machine takes seconds to another speed


@dataclass(frozen=True)
class Segment:
    """A stretch of constant load, reached by ramps at its beginning.

    Attributes:
        duration_s: Ramps included [s].
        torque: In parts of the rated torque, negative when braking [1].
        speed: In parts of the rated speed [1].
        speed_ramp_s: Time that the change of speed takes [s], at most the duration.
    """

    duration_s: float
    torque: float
    speed: float
    speed_ramp_s: float = SPEED_RAMP_S


REST = Segment(60.0, 0.0, 0.0)  # a minute at rest shows that the test starts cold


@dataclass(frozen=True)
class Profile:
    """Segments one after another; torque and speed are continuous and piecewise linear.

    Attributes:
        segments: In order of time.
    """

    segments: tuple[Segment, ...]

    @property
    def duration_s(self) -> float:
        """Length of the profile [s]."""
        return float(sum(segment.duration_s for segment in self.segments))

    def torque(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the torque at some times [s], in parts of the rated torque."""
        ramps = [TORQUE_RAMP_S] * len(self.segments)
        return self._follow(time_s, [segment.torque for segment in self.segments], ramps)

    def speed(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the speed at some times [s], in parts of the rated speed."""
        ramps = [segment.speed_ramp_s for segment in self.segments]
        return self._follow(time_s, [segment.speed for segment in self.segments], ramps)

    def _follow(
        self, time_s: NDArray[np.float64], levels: list[float], ramps_s: list[float]
    ) -> NDArray[np.float64]:
        knots, values, start = [0.0], [levels[0]], self.segments[0].duration_s
        for segment, before, level, ramp in zip(
            self.segments[1:], levels, levels[1:], ramps_s[1:], strict=False
        ):
            knots += [start, start + ramp]
            values += [before, level]
            start += segment.duration_s
        return np.interp(time_s, knots, values)


def constant_load(duration_s: float, *, torque: float = 0.55, speed: float = 0.7) -> Profile:
    """Return one load step from rest after a minute, held to the end.

    Args:
        duration_s: Length of the whole profile [s], above 60.
        torque: In parts of the rated torque [1].
        speed: In parts of the rated speed [1].

    Returns:
        The profile.
    """
    return Profile((REST, Segment(duration_s - REST.duration_s, torque, speed)))


def staircase(duration_s: float, *, speed: float = 0.6) -> Profile:
    """Return torque in three steps up and two down at one speed, then standstill; see `duty`."""
    levels = (0.25, 0.5, 0.75, 0.5, 0.25)
    tread = _whole((duration_s - REST.duration_s) * 0.85 / len(levels))
    treads = tuple(Segment(tread, torque, speed) for torque in levels)
    return _closed_by_standstill((REST, *treads), duration_s)


def duty(duration_s: float) -> Profile:
    """Return a duty in which current and speed move apart, with pulses and two cool-downs.

    Staircase of torque, fast with little torque, slow with much, pulses of torque, a stop, a spin
    without load, pulses of speed, and standstill to the end. Stretches follow the duration, the
    pulses' period does not.

    Args:
        duration_s: Length of the whole profile [s], about 1200 or more.

    Returns:
        The profile.
    """
    span = duration_s - REST.duration_s

    def part(share: float) -> float:
        return _whole(span * share)

    segments = (
        REST,
        Segment(part(0.07), 0.25, 0.75),
        Segment(part(0.07), 0.50, 0.75),
        Segment(part(0.07), 0.75, 0.75),
        Segment(part(0.09), 0.20, 1.00),
        Segment(part(0.12), 0.85, 0.15),
        *_pulses(part(0.15), Segment(40.0, 1.00, 0.50), Segment(50.0, 0.15, 0.50)),
        Segment(part(0.11), 0.0, 0.0),
        Segment(part(0.06), 0.0, 0.80),
        *_pulses(part(0.13), Segment(60.0, 0.55, 0.30), Segment(60.0, 0.55, 0.95)),
    )
    return _closed_by_standstill(segments, duration_s)


def drive_cycle(duration_s: float) -> Profile:
    """Return stop-and-go driving: accelerate, cruise, brake, wait; then parked, see `duty`."""
    cruises = ((0.25, 20.0), (0.50, 45.0), (0.35, 30.0), (0.90, 90.0), (0.70, 60.0))
    trip: list[Segment] = []
    for speed, dwell_s in cruises:
        ramp_s = _whole(18.0 * speed)
        trip += [
            Segment(ramp_s, 0.95, speed, speed_ramp_s=ramp_s),
            Segment(dwell_s, 0.12 + 0.35 * speed**2, speed),  # rolling and air resistance
            Segment(ramp_s, -0.65, 0.0, speed_ramp_s=ramp_s),
            Segment(15.0, 0.0, 0.0),
        ]
    length = sum(segment.duration_s for segment in trip)
    num_trips = int((duration_s - REST.duration_s) * 0.9 // length)
    return _closed_by_standstill((REST, *trip * num_trips), duration_s)


def _pulses(duration_s: float, first: Segment, second: Segment) -> tuple[Segment, ...]:
    period = first.duration_s + second.duration_s
    return (first, second) * max(1, round(duration_s / period))


def _closed_by_standstill(segments: tuple[Segment, ...], duration_s: float) -> Profile:
    left = duration_s - Profile(segments).duration_s
    if left <= SPEED_RAMP_S:
        raise ValueError(
            f"The profile takes {duration_s - left:.0f} s before its closing standstill, the "
            f"duration is {duration_s:.0f} s. Ask for a longer duration."
        )
    return Profile((*segments, Segment(left, 0.0, 0.0)))


def _whole(seconds: float) -> float:
    """Ends on whole seconds lie on the samples of a 10 Hz record, and read well in a plot."""
    return float(round(seconds))
