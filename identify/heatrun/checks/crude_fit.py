"""A crude two-node fit of one record, good enough to judge the record by.

Some checks have to know what the winding should have done: whether a reading that stands still may
do so, and how long the test is against the slow time constant. The two-node network on a few
hundred block means answers both within a tenth of a second. It carries no noise model, so that its
uncertainties are rough; nothing else may be read off it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from ..record.motor import Motor
from ..record.record import Record
from ..record.samples import samples, sink_channel, with_all_heat
from .course import EQUILIBRIUM_K, lead_in

MAX_BLOCKS = 400
"""A block of a 90-minute test is then 13 s long, an eighth of a winding's time constant."""

MIN_BLOCKS = 30
"""Six unknowns, and four blocks for each."""

FACTOR_SD = 2.0
"""Prior sd of the logarithm of each capacity and resistance about its rough guess: a factor of
seven."""

COLD_STATOR_SD_K = 0.5
WARM_STATOR_SD_K = 10.0
"""Prior sd of the stator's start against the winding's, for a start in equilibrium and for
another."""

NOISE_TIME_S = 60.0
"""Residuals closer than this, twice a correlation time of 30 s, tell the same."""

MAX_RESIDUAL_SHARE = 0.1
"""A fit whose rms residual exceeds this share of the temperature's range explains nothing [1]."""


@dataclass(frozen=True)
class CrudeFit:
    """The record as a two-node network sees it.

    Attributes:
        time_s: Middle of each block [s], shape (blocks,).
        measured_degC: Block means of the winding temperature [degC], shape (blocks,).
        fitted_degC: What the network makes of them [degC], shape (blocks,).
        rms_K: Root mean square residual over the blocks that were fitted [K].
        tau_s: Slow time constant [s].
        log_sd: Standard deviation of its logarithm [1].
        rates_per_s: Rates at which the two modes decay, negative [1/s], shape (2,).
        response_K_per_J: What a joule in the winding, and one in the stator, adds to the winding's
            temperature in each mode at once [K/J], shape (2, 2).
    """

    time_s: np.ndarray
    measured_degC: np.ndarray
    fitted_degC: np.ndarray
    rms_K: float
    tau_s: float
    log_sd: float
    rates_per_s: np.ndarray
    response_K_per_J: np.ndarray


def crude_fit(
    record: Record,
    motor: Motor,
    *,
    left_out_s: Sequence[tuple[float, float]] = (),
    most_blocks: int = MAX_BLOCKS,
) -> CrudeFit | None:
    """Fit the two-node network to a record.

    Args:
        record: Any record.
        motor: Says what the losses are, and the phase resistance; without that, or a current, the
            share of copper in the losses is fitted too.
        left_out_s: Time spans whose temperatures do not count [s].
        most_blocks: Block means of the record, at most.

    Returns:
        The fit, or None where the record has too little, or the network does not describe it.
    """
    has_current = "phase_current_A" in record
    channels = ["winding_degC", sink_channel(motor), "losses_W"]
    channels += ["phase_current_A"] * has_current
    time_s, *columns = samples(record, *channels)
    heat_W = samples(with_all_heat(record, motor), *channels)[3]
    if time_s.size < 2 * MIN_BLOCKS or np.ptp(columns[0]) == 0.0:
        return None
    if motor.losses == "map" and not (has_current and motor.phase_resistance_ohm):
        return None
    is_copper_known = has_current and motor.phase_resistance_ohm is not None
    lead = lead_in(time_s, heat_W)
    excess = float(np.median((columns[0] - columns[1])[:lead]))
    edges = np.linspace(time_s[0], time_s[-1], min(most_blocks, time_s.size // 2) + 1)
    squares = (current**2 for current in columns[3:])
    winding, sink, losses, *current_squared = _on_grid(time_s, edges, *columns[:3], *squares)
    counted = np.ones(winding.size, dtype=bool)
    for from_s, to_s in left_out_s:
        counted &= (edges[1:] < from_s) | (edges[:-1] > to_s)
    if counted.sum() < MIN_BLOCKS or not np.max(heat_W) > 0.0:
        return None
    problem = _Problem(
        step_s=float(edges[1] - edges[0]),
        winding=winding,
        sink=sink,
        losses=losses,
        copper=_copper(motor, winding, losses, *current_squared) if has_current else losses,
        is_copper_known=is_copper_known,
        is_balance=motor.losses == "balance",
        start=float(np.median(columns[0][:lead])),
        stator_sd_K=COLD_STATOR_SD_K if abs(excess) < EQUILIBRIUM_K else WARM_STATOR_SD_K,
        counted=counted,
    )
    return problem.solve(0.5 * (edges[1:] + edges[:-1]))


def _copper(
    motor: Motor, winding: np.ndarray, losses: np.ndarray, current_squared: np.ndarray
) -> np.ndarray:
    """Copper loss; without a known resistance the largest that the losses leave room for."""
    shape = motor.phases * current_squared * motor.resistance_ratio(winding)
    if motor.phase_resistance_ohm is not None:
        return motor.phase_resistance_ohm * shape
    flows = shape > 0.1 * np.max(shape)
    return shape * float(np.quantile(losses[flows] / shape[flows], 0.1)) if flows.any() else shape


def _on_grid(time_s: np.ndarray, edges: np.ndarray, *channels: np.ndarray) -> list[np.ndarray]:
    """Means of channels between edges; across a gap they run straight."""
    steps = np.diff(time_s)
    means = []
    for values in channels:
        area = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)))
        means.append(np.diff(np.interp(edges, time_s, area)) / np.diff(edges))
    return means


@dataclass(frozen=True)
class _Problem:
    """Block means of one record, and what is unknown about them."""

    step_s: float
    winding: np.ndarray
    sink: np.ndarray
    losses: np.ndarray
    copper: np.ndarray
    is_copper_known: bool
    is_balance: bool
    start: float
    stator_sd_K: float
    counted: np.ndarray

    def matrix(self, x: np.ndarray) -> np.ndarray:
        """State matrix [1/s] of winding and stator."""
        C_w, C_sr, R_w, R_sr = np.exp(x[:4])
        return np.array(
            [
                [-1.0 / (C_w * R_w), 1.0 / (C_w * R_w)],
                [1.0 / (C_sr * R_w), -(1.0 / R_w + 1.0 / R_sr) / C_sr],
            ]
        )

    def simulate(self, x: np.ndarray) -> np.ndarray:
        """Block means of the winding temperature [degC], by modes."""
        C_w, C_sr, _, R_sr = np.exp(x[:4])
        share = 1.0 if self.is_copper_known else 1.0 / (1.0 + np.exp(-x[5]))
        P_js = share * self.copper
        P_ol = self.losses - P_js if self.is_balance else self.losses
        reference = self.sink[0]
        drive = np.stack([P_js / C_w, (P_ol + (self.sink - reference) / R_sr) / C_sr])
        # a passive network only decays; newer NumPy returns its real eigenvalues as complex
        rates, modes = (np.real(part) for part in np.linalg.eig(self.matrix(x)))
        inward = np.linalg.inv(modes)
        start = inward @ np.array([self.start - reference, self.start + x[4] - reference])
        total = np.full(self.winding.size, reference)
        for i, rate in enumerate(np.real(rates)):
            decay = np.exp(rate * self.step_s)
            settled = (inward[i] @ drive) / -rate
            ends, _ = lfilter([1.0 - decay], [1.0, -decay], settled, zi=[decay * start[i]])
            begins = np.concatenate(([start[i]], ends[:-1]))
            mean = settled + (begins - settled) * (1.0 - decay) / (-rate * self.step_s)
            total = total + modes[0, i] * mean
        return total

    def guess(self) -> np.ndarray:
        """Rough start: all heat stored gives the capacity, none stored the resistance."""
        rise = max(float(np.max(self.winding - self.sink)), 1.0)
        heat = self.losses if self.is_balance else self.losses + self.copper
        power = max(float(np.mean(heat)), 1e-9)
        C = power * self.step_s * heat.size / rise
        R = rise / power
        guess = [np.log(0.05 * C), np.log(C), np.log(0.3 * R), np.log(R), 0.0]
        return np.array(guess if self.is_copper_known else [*guess, 0.0])

    def solve(self, time_s: np.ndarray) -> CrudeFit | None:
        """Least squares with the weak priors as further residuals."""
        guess = self.guess()
        spread = np.full(guess.size, FACTOR_SD)
        spread[4] = self.stator_sd_K
        # About the size of residual that rounding to 1 degC and a simple model leave.
        scale_K = 0.3
        dilution = np.sqrt(max(NOISE_TIME_S / self.step_s, 1.0))

        def residuals(x: np.ndarray) -> np.ndarray:
            misfit = (self.simulate(x) - self.winding)[self.counted]
            return np.concatenate([misfit / (scale_K * dilution), (x - guess) / spread])

        try:
            found = least_squares(residuals, guess, x_scale=spread, max_nfev=60)
        except (ValueError, np.linalg.LinAlgError):
            # Records of absurd values overflow in the exponentials: no network describes them.
            return None
        fitted = self.simulate(found.x)
        rms = float(np.sqrt(np.mean((fitted - self.winding)[self.counted] ** 2)))
        if not rms < MAX_RESIDUAL_SHARE * float(np.ptp(self.winding)):
            return None
        slope = np.array([self._log_tau(found.x + d) for d in 1e-4 * np.eye(guess.size)])
        slope = (slope - self._log_tau(found.x)) / 1e-4
        covariance = np.linalg.pinv(found.jac.T @ found.jac) * max((rms / scale_K) ** 2, 1e-4)
        return CrudeFit(
            time_s,
            self.winding,
            fitted,
            rms,
            float(np.exp(self._log_tau(found.x))),
            float(np.sqrt(max(slope @ covariance @ slope, 0.0))),
            *self.response(found.x),
        )

    def response(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `CrudeFit.rates_per_s` and `CrudeFit.response_K_per_J`."""
        rates, modes = (np.real(part) for part in np.linalg.eig(self.matrix(x)))
        return rates, (modes[0][:, None] * np.linalg.inv(modes) / np.exp(x[:2])).T

    def _log_tau(self, x: np.ndarray) -> float:
        return -float(np.log(-np.max(np.real(np.linalg.eigvals(self.matrix(x))))))
