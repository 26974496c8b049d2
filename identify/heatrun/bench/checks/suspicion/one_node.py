r"""One lumped mass behind a record: how fast it answers, and how much heat leaves it per kelvin.

Integrated over time, the balance of one mass is linear in what is unknown:

$$ T(t) - T(0) = \frac{1}{C} \int P\,dt - \frac{1}{\tau} \int (T - T_0)\,dt $$

so that a least-squares solution of two numbers gives the time constant tau whatever the unit of
the losses, and the capacity C and conductance G = C/tau in their unit. A machine is more than one
mass: what comes out lies between its winding's time constant and its slow one. That is enough to
see whether a clock or a power is wrong by a factor of 60 or 1000, and for nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....motor import Motor
from ...record import Record
from ..samples import samples, sink_channel

BLOCKS = 300
MIN_SAMPLES = 30
"""Two unknowns and a start; with fewer samples a shape is no evidence."""

MIN_EXPLAINED = 0.4
"""Share of the temperature's variance [1]: short pulses on a winding leave half to one mass."""

LINEAR = 0.9
"""Share of the temperature's variance [1] that stored heat alone must explain before a record is
called unsettled: one that settles bends, and is explained no better than by half."""

COLD = 0.2
"""Start above the sink over the rise [1]; a warmer start has heat in masses that are not seen."""

MAX_CONSTANTS = 3.0
"""A time constant of more than three test lengths is an extrapolation, and none is given."""

MIN_RISE_K = 5.0
"""Below, drifts of sink and sensors make up the course."""


@dataclass(frozen=True)
class OneNode:
    """The record as one mass sees it.

    Attributes:
        tau_s: Time constant [s].
        capacity_J_per_K: C [J/K]; NaN where no heat flows.
        conductance_W_per_K: G [W/K]; NaN where no heat flows.
        duration_s: Length of what was fitted [s].
    """

    tau_s: float
    capacity_J_per_K: float
    conductance_W_per_K: float
    duration_s: float


def one_node(record: Record, motor: Motor) -> OneNode | None:
    """Fit one mass to a record.

    Args:
        record: Any record.
        motor: Says which channel is the sink and what the losses are.

    Returns:
        The fit, or None where the record is too short, does not move, or is no such course.
    """
    courses = _courses(record, motor)
    if courses is None:
        return None
    winding, sink, heat, step_s, duration_s = courses
    is_heated = bool(np.any(heat > 0.0))
    terms = [-_integral(winding - sink, step_s), np.ones(winding.size)]
    if is_heated:
        terms.append(_integral(heat, step_s))
    found = _solved(terms, winding, winding, MIN_EXPLAINED)
    if found is None or not found[0] > 0.0:
        return None
    tau_s = 1.0 / float(found[0])
    if tau_s > MAX_CONSTANTS * duration_s:
        return None
    C = 1.0 / float(found[2]) if is_heated and found[2] > 0.0 else float("nan")
    return OneNode(tau_s, C, C / tau_s, duration_s)


def unsettled(record: Record, motor: Motor) -> OneNode | None:
    """Fit one mass to a record that is too short to show its time constant.

    Args:
        record: Any record.
        motor: As `one_node`.

    Returns:
        The capacity with the shortest time constant that is possible and the largest conductance,
        or None where `one_node` finds them, or no heat is seen to warm the winding.
    """
    courses = _courses(record, motor)
    if courses is None or one_node(record, motor) is not None:
        return None
    winding, sink, heat, step_s, duration_s = courses
    excess = winding - sink
    # A winding that follows its sink through the days warms by no heat of its own.
    rise = float(np.ptp(excess))
    if rise < MIN_RISE_K or abs(excess[0]) > COLD * rise or not np.any(heat > 0.0):
        return None
    tau_s = MAX_CONSTANTS * duration_s
    lost = _integral(excess, step_s) / tau_s
    terms = [_integral(heat, step_s), np.ones(excess.size)]
    found = _solved(terms, excess + lost, excess, LINEAR)
    if found is None or not found[0] > 0.0:
        return None
    C = 1.0 / float(found[0])
    return OneNode(tau_s, C, C / tau_s, duration_s)


def _solved(
    terms: list[np.ndarray], known: np.ndarray, course: np.ndarray, least: float
) -> np.ndarray | None:
    """Return the least-squares solution, or None where it does not explain the course."""
    matrix = np.stack(terms, axis=1)
    scale = np.linalg.norm(matrix, axis=0)
    if not np.all(np.isfinite(matrix)) or not np.all(scale > 0.0):
        return None
    found = np.linalg.lstsq(matrix / scale, known, rcond=None)[0] / scale
    explained = 1.0 - float(np.var(known - matrix @ found) / np.var(course))
    return found if explained > least else None


def _courses(
    record: Record, motor: Motor
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float] | None:
    """Winding, sink and heat as block means, the blocks' width [s] and the duration [s]."""
    channels = ["winding_degC", sink_channel(motor), "losses_W"]
    is_map = motor.losses == "map"
    if is_map:
        if motor.phase_resistance_ohm is None:
            return None
        channels.append("phase_current_A")
    time_s, *columns = samples(record, *channels)
    if time_s.size < MIN_SAMPLES or np.ptp(columns[0]) < MIN_RISE_K:
        return None
    winding, sink, heat = columns[:3]
    if is_map:
        heat = heat + motor.copper_loss_W(columns[3], winding)
    edges = np.linspace(time_s[0], time_s[-1], min(BLOCKS, time_s.size // 2) + 1)
    step_s = edges[1] - edges[0]
    winding, sink, heat = (_means(time_s, edges, values) for values in (winding, sink, heat))
    return winding, sink, heat, float(step_s), float(time_s[-1] - time_s[0])


def _means(time_s: np.ndarray, edges: np.ndarray, values: np.ndarray) -> np.ndarray:
    area = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s))))
    return np.diff(np.interp(edges, time_s, area)) / np.diff(edges)


def _integral(values: np.ndarray, step_s: float) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1])))) * step_s
