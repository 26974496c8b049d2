"""How much of a cause shows: what a refitted two-node network leaves of a course without noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..machine import Machine
from .plant import Array

MEAN_S = 5.0
"""The course is reduced to means over this long [s]."""


@dataclass(frozen=True)
class Seen:
    """One test as the bench would see it without noise, every half second.

    Attributes:
        current: Phase current [A].
        losses: Loss channel [W].
        ambient: Ambient temperature [degC].
        reading: Winding temperature as read [degC].
    """

    current: Array
    losses: Array
    ambient: Array
    reading: Array


def visible_misfit(machine: Machine, tests: list[Seen], kind: str) -> float:
    """Return the root mean square that the best two-node network leaves [K].

    Heat capacities, resistances and start temperatures are fitted freely; phase resistance,
    gain of the losses and offset of the sensor within 1 %, 1 % and 0.5 K.

    Args:
        machine: Gives a start near the truth, and the resistance.
        tests: The courses.
        kind: `"balance"` or `"map"`: what the loss channel means.
    """
    rows = max(1, round(MEAN_S / 0.5))
    reduced = [
        [
            values[: values.size // rows * rows].reshape(-1, rows).mean(axis=1)
            for values in (test.current**2, test.losses, test.ambient, test.reading)
        ]
        for test in tests
    ]
    start = np.log([machine.Ceq_w, machine.Ceq_sr, machine.Req_w, machine.Req_sr])
    x0 = np.concatenate([start, np.zeros(3), np.zeros(2 * len(tests))])
    scale = np.concatenate([np.full(4, 0.3), [0.01, 0.01, 0.5], np.full(2 * len(tests), 1.0)])

    def run(points: Array) -> Array:
        """Residuals (point, row) for many parameter sets at once."""
        C_w, C_sr, R_w, R_sr = np.exp(start[:, None] + (points * scale).T[:4])
        gain_R, gain_P, offset = (points * scale).T[4:7]
        k0 = 3.0 * machine.phase_resistance_ohm * (1.0 + gain_R) / (234.5 + 25.0)
        h = MEAN_S / 2.0

        out = []
        for index, (squared, losses, ambient, reading) in enumerate(reduced):
            shift = (points * scale).T[7 + 2 * index : 9 + 2 * index]
            state = np.stack([reading[0] + shift[0], reading[0] + shift[1]], axis=1)
            # slopes of winding and stator: matrix times state plus heat, by row and point
            k = squared[:, None] * k0
            held = k if kind == "balance" else np.zeros_like(k)
            across = np.stack([(k - 1.0 / R_w) / C_w, 1.0 / (R_w * C_w) + 0.0 * k], axis=-1)
            into = (1.0 / R_w - held) / C_sr
            back = (-1.0 / R_w - 1.0 / R_sr) / C_sr + 0.0 * k
            matrix = np.stack([across, np.stack([into, back], axis=-1)], axis=-2)
            other = (1.0 + gain_P) * losses[:, None] - 234.5 * held + ambient[:, None] / R_sr
            heat = np.stack([234.5 * k / C_w, other / C_sr], axis=-1)
            # Heun's method in two steps of half the length, each an affine map
            of_state = np.eye(2) + h * matrix + 0.5 * h**2 * matrix @ matrix
            of_heat = h * heat + 0.5 * h**2 * np.einsum("...ij,...j->...i", matrix, heat)
            twice = np.einsum("...ij,...j->...i", of_state, of_heat) + of_heat
            of_state = of_state @ of_state
            course = np.empty((reading.size + 1, points.shape[0]))
            course[0] = state[:, 0]
            for i in range(reading.size):
                state = np.matmul(of_state[i], state[:, :, None])[:, :, 0] + twice[i]
                course[i + 1] = state[:, 0]
            out.append((0.5 * (course[:-1] + course[1:]) + offset - reading[:, None]).T)
        return np.concatenate(out, axis=1)

    def residual(x: Array) -> Array:
        return np.concatenate([run(x[None])[0], 1e-1 * x])

    def jacobian(x: Array) -> Array:
        step = 1e-3
        points = np.concatenate([x[None], x + step * np.eye(x.size)])
        rows_ = run(points)
        J = (rows_[1:] - rows_[0]).T / step
        return np.concatenate([J, 1e-1 * np.eye(x.size)])

    x0[:4] = 0.0
    found = least_squares(residual, x0, jac=jacobian, max_nfev=12, xtol=1e-4, ftol=1e-4)
    left = run(found.x[None])[0]
    return float(np.sqrt(np.mean(left**2)))
