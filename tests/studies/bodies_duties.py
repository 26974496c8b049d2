"""Loads of the study of measured bodies: staircases, drive cycles, short tests, heaters."""

from __future__ import annotations

import numpy as np
from bodies_machines import Duty

REST_S = 60.0
"""Rest before a test, so that what was measured at its start is seen."""


def duty_of(
    lengths_s: np.ndarray, current: np.ndarray, speed: np.ndarray, sign: np.ndarray | None = None
) -> Duty:
    """Return loads of given lengths [s]; they change between two samples, not on one."""
    edges = np.concatenate([[0.0], np.cumsum(lengths_s)])
    edges[-1] = np.floor(edges[-1])
    sign = np.ones_like(current) if sign is None else sign
    other = 0.4 * speed + 0.6 * speed**1.7
    return Duty(edges, current, speed, sign * np.minimum(current, 1.0), other)


def staircase(rng: np.random.Generator, seconds: float = 5400.0) -> Duty:
    """Return long loads with a rest among them, of which the last cools the machine."""
    num = int(rng.integers(4, 7))
    lengths = rng.dirichlet(np.full(num, 6.0)) * (seconds - REST_S)
    current = rng.uniform(0.4, 1.3, num)
    speed = rng.uniform(0.3, 1.1, num)
    current[-1], speed[-1] = 0.0, 0.0
    return _after_rest(lengths, current, speed)


def cycle(rng: np.random.Generator, seconds: float = 3600.0) -> Duty:
    """Return a drive cycle of loads from half a minute to three minutes, as a motor."""
    lengths, num = _lengths(rng, seconds, 30.0, 180.0)
    current = rng.uniform(0.1, 1.4, num) * (rng.random(num) > 0.15)
    return _after_rest(lengths, current, rng.uniform(0.2, 1.1, num))


def both_ways(rng: np.random.Generator, seconds: float = 5400.0) -> Duty:
    """Return a drive cycle that motors and generates, from one minute to five a load."""
    lengths, num = _lengths(rng, seconds, 60.0, 300.0)
    sign = np.where(rng.random(num) < 0.5, -1.0, 1.0)
    sign[:2] = 1.0, -1.0
    current = rng.uniform(0.3, 1.2, num)
    return _after_rest(lengths, current, rng.uniform(0.3, 1.1, num), sign)


def short(rng: np.random.Generator, seconds: float) -> Duty:
    """Return a load at once, and after half of the test or more another one."""
    begin, share = rng.uniform(3.0, 9.0), rng.uniform(0.5, 0.8)
    lengths = np.array([begin, share * (seconds - begin), (1.0 - share) * (seconds - begin)])
    current = np.array([0.0, rng.uniform(1.0, 2.0), rng.uniform(0.0, 0.8)])
    return duty_of(lengths, current, np.array([0.0, *rng.uniform(0.5, 1.0, 2)]))


def on_and_off(rng: np.random.Generator, seconds: float = 7200.0) -> Duty:
    """Return a current, a rest, a smaller current and a rest, at standstill."""
    lengths = rng.dirichlet([12.0, 6.0, 8.0, 4.0]) * (seconds - REST_S)
    level = np.array([rng.uniform(0.8, 1.2), 0.0, rng.uniform(0.4, 0.8), 0.0])
    return _after_rest(lengths, level, np.zeros(4))


def heated(duty: Duty) -> Duty:
    """Return the loads of a heater, whose power takes the steps of a current."""
    still = np.zeros_like(duty.current)
    return Duty(duty.edges_s, still, still, still, duty.current)


def _lengths(
    rng: np.random.Generator, seconds: float, least: float, most: float
) -> tuple[np.ndarray, int]:
    lengths = rng.uniform(least, most, int(2.0 * seconds / (least + most)))
    lengths *= (seconds - REST_S) / lengths.sum()
    return lengths, lengths.size


def _after_rest(
    lengths: np.ndarray, current: np.ndarray, speed: np.ndarray, sign: np.ndarray | None = None
) -> Duty:
    sign = np.ones_like(current) if sign is None else sign
    return duty_of(np.r_[REST_S, lengths], np.r_[0.0, current], np.r_[0.0, speed], np.r_[1.0, sign])
