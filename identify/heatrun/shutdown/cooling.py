r"""The winding's course after switch-off, what is known of it beforehand, and what readings add.

A winding cools like the network of which it is a node: by as many exponentials as there are nodes.

$$ T(t) = T_{sink} + \sum_k a_k [(1 - s_k) e^{-t/\tau_k} + s_k + c_k t_r/\tau_k\, e^{-t/t_r}]
   + b\,(1 - e^{-t/t_r}) $$

$s_k$ is the share of the losses that stays; while the speed runs down with $t_r$, it cools the
winding better than standing air does ($c_k$, of the modes of the winding), and its losses heat on
($b$). Every
quantity is a function of independent standard normal numbers. The readings are linear in the
amplitudes and the sink, which are integrated out exactly; time constants, scatter and moment are
sampled by tempering from prior to posterior (Del Moral, Doucet and Jasra, 2006), since after a late
first reading they are neither Gaussian nor symmetric.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls
from scipy.special import ndtr

from ..record.motor import Motor, ShutDown

Draws = Float[np.ndarray, "draw parameter"]


@dataclass(frozen=True)
class Source:
    """A quantity that is not known exactly."""

    name: str  # In words.
    unit: str  # Its unit.
    centre: float  # Mean, or median of a log-normal one [unit].
    sd: float  # Standard deviation [unit], or that of its logarithm [1].
    # Of its prior; `"often none"` is log-normal where the effect is there.
    law: Literal["normal", "log-normal", "often none"] = "normal"

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """Return its values for standard normal numbers, as a column, shape (draw, 1)."""
        if self.law == "normal":
            return (self.centre + self.sd * z)[:, None]
        value = self.centre * np.exp(self.sd * z)
        return (value * is_there(z) if self.law == "often none" else value)[:, None]

    @property
    def standard_uncertainty(self) -> float:
        """Its standard deviation [unit], of a log-normal one to first order."""
        return self.sd if self.law == "normal" else self.centre * self.sd


NONE_BELOW, SHARPNESS = -0.2, 6.0
"""Of a normal number: below it (4 of 10) an effect is not there, and how fast it comes [1]."""


def is_there(z: np.ndarray) -> np.ndarray:
    """Return the factor of an effect that some machines do not have: nearly 0 or 1 [1].

    An effect that can only add, and always does, leaves no room for machines without it: their
    intervals would end above the truth.
    """
    return ndtr(SHARPNESS * (z - NONE_BELOW))


@dataclass(frozen=True, kw_only=True)
class AbstractModes(ABC):
    """Prior of the time constants of a winding that cools, and of its amplitudes given these."""

    # What the standard normal numbers behind the time constants stand for.
    of_times: tuple[str, ...]
    of_amplitudes: tuple[str, ...]  # The same of those that the amplitudes are linear in.
    num_winding: int  # Number of modes in which the winding cools to the iron, the first ones.
    are_positive: bool  # Whether no amplitude can be below zero.
    basis: str  # Where the prior comes from, in words.

    @abstractmethod
    def times(self, z: Draws) -> np.ndarray:
        """Return the time constants [s], fastest first, shape (draw, mode)."""

    @abstractmethod
    def amplitudes(self, z: Draws) -> tuple[np.ndarray, np.ndarray]:
        """Return their mean [K], shape (draw, mode), and factor, shape (draw, mode, amplitude)."""


SHARE, SHARE_SD = np.array([0.06, 0.2, 0.3, 0.5]), np.array([0.06, 0.2, 0.25, 0.4])
"""Of the modes of winding, winding, rotor and teeth, and housing in the rise [1]."""

HEATED_K_PER_S, HEATED_LOG_SD = 0.18, 0.95
"""How fast the copper began to cool, which is how fast it was heated before: J² rho / c. Copper at
120 °C takes 0.17 K/s at 5 A/mm², 0.7 K/s at 10 A/mm², and in a water jacket 1.5 K/s at 15 A/mm²;
insulation takes a fifth of it. So no fast mode can hide a large drop."""

RATE, RATE_SD = np.array([0.35, 0.55]), 0.3
"""Share of the modes of winding in that rate [1]."""


def winding_drops(rise_K: float, tau: np.ndarray, heated: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return mean and standard deviation of the drops of the winding's modes [K], as `tau`.

    Args:
        rise_K: Of the first reading.
        tau: Time constants of the modes, the one within the winding first [s], shape (draw, mode).
        heated: Standard normal number of how fast the copper was heated, shape (draw, 1).
    """
    num = tau.shape[1]
    heated_K = HEATED_K_PER_S * np.exp(HEATED_LOG_SD * heated) * tau
    by_rate, by_share = (RATE_SD * heated_K) ** -2.0, (rise_K * SHARE_SD[:num]) ** -2.0
    both = by_rate + by_share
    mean = RATE[:num] * heated_K * by_rate + rise_K * SHARE[:num] * by_share
    return mean / both, both**-0.5


@dataclass(frozen=True, kw_only=True)
class UsualModes(AbstractModes):
    """Two modes of the winding, one of teeth and rotor, one of the housing, of any machine.

    Slot part and end winding cool to the iron in some minutes and part from each other in less;
    rotor and teeth come to the temperature of the housing within an hour, and the housing to that
    of the air within hours. Medians and factors (k = 1) span stators from some 100 W to some MW.
    """

    rise_K: float  # Of the first reading, which the amplitudes are measured by [K].
    # As `AbstractModes`.
    of_times: tuple[str, ...] = (
        "time constant of the winding",
        "time constant within the winding",
        "time constant of rotor and teeth",
        "time constant of the housing",
        "heating of the copper before switch-off",
        "whether the winding has a drop within",
        "whether rotor and teeth have a drop",
    )
    # As `AbstractModes`.
    of_amplitudes: tuple[str, ...] = (
        "drop within the winding",
        "drop from winding to iron",
        "drop from rotor and teeth to housing",
        "rise of the housing",
    )
    num_winding: int = 2  # As `AbstractModes`.
    are_positive: bool = True  # As `AbstractModes`.
    basis: str = "wound machines in general"  # As `AbstractModes`.

    def times(self, z: Draws) -> np.ndarray:
        """Return the time constants, as `AbstractModes`."""
        winding = 130.0 * np.exp(0.8 * z[:, 0])
        within = winding / (1.0 + 1.6 * np.exp(0.5 * z[:, 1]))
        rotor = winding * (1.0 + 5.0 * np.exp(0.6 * z[:, 2]))
        housing = rotor * (1.0 + 3.0 * np.exp(0.7 * z[:, 3]))
        return np.stack([within, winding, rotor, housing], axis=1)

    def amplitudes(self, z: Draws) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and factor of the amplitudes, as `AbstractModes`."""
        tau, rise = self.times(z), max(self.rise_K, 5.0)
        mean = np.tile(rise * SHARE, (len(z), 1))
        sd = np.tile(rise * SHARE_SD, (len(z), 1))
        mean[:, :2], sd[:, :2] = winding_drops(rise, tau[:, :2], z[:, 4:5])
        present = is_there(z[:, [5, 6]])
        mean[:, [0, 2]] *= present
        sd[:, [0, 2]] *= present
        return mean, sd[:, :, None] * np.eye(len(SHARE))


@dataclass(frozen=True)
class Cooling:
    """Readings after switch-off, and all that they depend on."""

    time_s: np.ndarray  # Since the stated moment of switch-off [s], shape (time,).
    # Readings as temperatures, by the stated cold resistance, shape (time,).
    reading_degC: np.ndarray
    sink_degC: float  # What the machine cools to.
    motor: Motor  # Material, cold resistance, leads.
    # Cold resistance of the measured circuit with its leads [ohm]; None where a sensor was read.
    reference_ohm: float | None
    modes: AbstractModes  # Prior of time constants and amplitudes.
    scatter: np.ndarray  # Of the readings over that of a single one [1], shape (time,).

    @property
    def said(self) -> ShutDown:
        """What the motor file says of such readings."""
        return self.motor.shutdown

    @cached_property
    def sources(self) -> dict[str, Source]:
        """What the extrapolation depends on beside the modes, by a key, where not exactly known."""
        said = self.said
        run_down = (15.0, 0.8) if said.run_down_s is None else (said.run_down_s, 0.2)
        noise = (0.1, 0.9) if said.reading_sd_K is None else (said.reading_sd_K, 0.3)
        found = {
            "moment": Source("moment of switch-off", "s", 0.0, said.moment_sd_s),
            "speed": Source("time constant of the run-down", "s", *run_down, "log-normal"),
            # about a third of all losses does not come from the current and goes with the speed
            "run_down": Source("losses of the run-down", "1", 0.3, 0.5, "log-normal"),
            # the end winding, which gives off a third of the heat, is cooled 2.5 times better by a
            # rotor that turns than by one that stands
            "stirring": Source("cooling of the run-down", "1", 0.35, 0.7, "often none"),
            "losses_after": Source(
                "losses that stay", "1", said.losses_after, said.losses_after_sd
            ),
            "noise": Source("scatter of the readings", "K", *noise, "log-normal"),
            # by hand to half a second, by a logger to the time that a bridge takes to settle
            "clock": Source("scatter of their times", "s", 0.1, 0.8, "log-normal"),
        }
        if said.run_down_s == 0.0:
            found = {key: found[key] for key in ("moment", "losses_after", "noise", "clock")}
        if self.reference_ohm is None and said.sensor_lag_s > 0.0:
            found["lag"] = Source("lag of the sensor", "s", said.sensor_lag_s, 0.4, "log-normal")
        return {key: one for key, one in found.items() if one.standard_uncertainty > 0.0}

    @cached_property
    def instruments(self) -> dict[str, Source]:
        """Errors that all readings share, which no reading tells anything of."""
        said = self.said
        if self.reference_ohm is None:
            found = {"offset": Source("offset of the sensor", "K", 0.0, said.sensor_sd_K)}
        else:
            leads = said.lead_sd * self.motor.lead_resistance_ohm
            found = {
                "cold": Source("cold resistance", "1", 0.0, said.cold_resistance_sd),
                "cold_degC": Source("cold temperature", "K", 0.0, said.cold_temperature_sd_K),
                "B": Source("B of the material", "K", 0.0, said.coefficient_sd_degC),
                "leads": Source("leads", "ohm", 0.0, leads),
            }
        return {key: one for key, one in found.items() if one.sd > 0.0}

    @cached_property
    def sink(self) -> Source:
        """The temperature that the readings would end at, as their instruments show it."""
        at = np.full(1, self.sink_degC)
        errors = [
            float(self.true(at, {key: source.sd})[0]) - self.sink_degC
            for key, source in self.instruments.items()
        ]
        sd = float(np.linalg.norm([self.said.sink_sd_K, *errors]))
        return Source("temperature of the sink", "K", 0.0, sd)

    @property
    def num_nonlinear(self) -> int:
        """Number of standard normal numbers that readings are not linear in."""
        return len(self.modes.of_times) + len(self.sources)

    @property
    def names(self) -> tuple[str, ...]:
        """What each standard normal number stands for; those that readings are linear in last."""
        of_sources = (source.name for source in self.sources.values())
        return (*self.modes.of_times, *of_sources, *self.modes.of_amplitudes, self.sink.name)

    def values(self, z: Draws) -> Mapping[str, np.ndarray]:
        """Return the values of the sources by key, shape (draw, 1) each."""
        first = len(self.modes.of_times)
        return {
            key: source(z[:, first + place])
            for place, (key, source) in enumerate(self.sources.items())
        }

    def true(self, read_degC: np.ndarray, errors: Mapping[str, np.ndarray | float]) -> np.ndarray:
        """Return the temperatures behind readings [degC].

        Args:
            read_degC: As they follow from what is stated.
            errors: Of the instruments, by key; the shape is that of the readings.
        """
        if self.reference_ohm is None:
            return read_degC - errors.get("offset", 0.0)
        motor, stated = self.motor, self.motor.lead_resistance_ohm
        B, cold_degC = motor.resistance_coefficient_degC, motor.reference_temperature_degC
        ohm = (read_degC + B) / (B + cold_degC) * (self.reference_ohm - stated) + stated
        leads = stated + errors.get("leads", 0.0)
        ratio = (ohm - leads) / (self.reference_ohm * (1.0 + errors.get("cold", 0.0)) - leads)
        B = B + errors.get("B", 0.0)
        return ratio * (B + cold_degC + errors.get("cold_degC", 0.0)) - B

    def _linear(
        self, z: Draws, time_s: np.ndarray, lag_s: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the course without the linear numbers [degC], and what each of these adds [K].

        Args:
            z: Nonlinear numbers, at least.
            time_s: Since the true moment of switch-off [s], shape (time,) or (draw, time).
            lag_s: Of a sensor that was in equilibrium before [s], shape (draw, 1).

        Returns:
            Shapes (draw, time) and (draw, linear, time).
        """
        values = self.values(z)
        tau = self.modes.times(z)[:, :, None]
        mean, factor = self.modes.amplitudes(z)
        time_s = np.broadcast_to(np.maximum(time_s, 0.0), (len(z), np.shape(time_s)[-1]))[:, None]
        stays = np.full(tau.shape, self.said.current_after**2)
        kept = values.get("losses_after", np.full((len(z), 1), self.said.losses_after))
        stays[:, -1] = np.clip(kept, 0.0, 1.0)  # the slow mode is fed by all losses
        decay = _lagged(time_s, tau, np.asarray(lag_s)[..., None])
        decay = (1.0 - stays) * decay + stays
        if "speed" in values:
            speed = values["speed"]
            turning = np.exp(-time_s[:, 0] / speed)
            still_heated = values["run_down"] * speed / tau[:, -1]
            decay[:, -1] += still_heated * (1.0 - turning)
            of_winding = slice(self.modes.num_winding)
            still_cooled = values["stirring"] * speed * turning
            decay[:, of_winding] += still_cooled[:, None] / tau[:, of_winding]
        of_sink = np.full((len(z), 1, time_s.shape[-1]), self.sink.sd)
        added = np.concatenate([np.swapaxes(factor, 1, 2) @ decay, of_sink], axis=1)
        return self.sink_degC + (mean[:, None] @ decay)[:, 0], added

    def winding(self, z: Draws, time_s: np.ndarray) -> np.ndarray:
        """Return the winding's temperature as the readings' instruments show it [degC].

        Args:
            z: All numbers.
            time_s: Since the true moment of switch-off [s], shape (time,).

        Returns:
            Shape (draw, time).
        """
        return self._joined(z, *self._linear(z, time_s))

    def predicted(self, z: Draws, time_s: np.ndarray | None = None) -> np.ndarray:
        """Return what would be read, as `reading_degC`, shape (draw, time).

        Args:
            z: All numbers.
            time_s: Since the stated moment of switch-off [s]; that of the readings if None.
        """
        return self._joined(z, *self._read(z, self.time_s if time_s is None else time_s))

    def _read(self, z: Draws, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = self.values(z)
        return self._linear(z, time_s + values.get("moment", 0.0), values.get("lag", 0.0))

    def _joined(self, z: Draws, course: np.ndarray, added: np.ndarray) -> np.ndarray:
        return course + (z[:, None, self.num_nonlinear :] @ added)[:, 0]

    @cached_property
    def slope_K_per_s(self) -> np.ndarray:
        """How fast the readings fall, by the exponentials that fit them best, shape (time,)."""
        since_s = self.time_s - self.time_s[0]
        rates = 1.0 / np.geomspace(10.0, 1e4, 10)
        decay = np.exp(-since_s[:, None] * rates)
        amplitudes, _ = nnls(decay / self.scatter[:, None],
                             (self.reading_degC - self.sink_degC) / self.scatter)  # fmt: skip
        return decay @ (rates * amplitudes)

    def noise_K(self, z: Draws) -> np.ndarray:
        """Return the scatter of a reading and of its time [K], shape (draw, time)."""
        values = self.values(z)
        return np.hypot(values["noise"], values["clock"] * self.slope_K_per_s)

    def _given(self, z: Draws) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return residuals over their scatter, that [K], precision and its vector of the others."""
        course, added = self._read(z, self.time_s)
        sd = self.noise_K(z) * self.scatter
        residual, added = (self.reading_degC - course) / sd, added / sd[:, None]
        vector = (added @ residual[:, :, None])[:, :, 0]
        return residual, sd, np.eye(added.shape[1]) + added @ np.swapaxes(added, 1, 2), vector

    def log_likelihood(self, z: Draws) -> np.ndarray:
        """Return the log likelihood of nonlinear numbers, the linear ones integrated out."""
        residual, sd, precision, vector = self._given(z)
        moved = np.linalg.solve(precision, vector[:, :, None])[:, :, 0]
        squares = np.sum(residual**2, axis=1) - np.sum(vector * moved, axis=1)
        log_det = np.linalg.slogdet(precision)[1]
        return -0.5 * (squares + log_det) - np.sum(np.log(sd), axis=1)

    def posterior(self, seed: int) -> Draws:
        """Return draws of all numbers, given the readings, shape (draw, number).

        Args:
            seed: Random seed.
        """
        z = sample(self.log_likelihood, self.num_nonlinear, seed)
        _, _, precision, vector = self._given(z)
        random = np.random.default_rng([seed, 2])
        factor = np.swapaxes(np.linalg.cholesky(precision), 1, 2)
        centre = np.linalg.solve(precision, vector[:, :, None])
        mean, by = self.modes.amplitudes(z)
        found, drawn = list[Draws](), z
        for _ in range(MOST_TRIES):
            added = np.linalg.solve(factor, random.standard_normal(centre.shape))
            linear = (centre + added)[:, :, 0]
            amplitudes = mean + (by @ linear[:, :-1, None])[:, :, 0]
            drawn = np.concatenate([z, linear], axis=1)
            possible = np.all(amplitudes > 0.0, axis=1) | (not self.modes.are_positive)
            found.append(drawn[possible])
            if sum(map(len, found)) >= NUM_DRAWS:
                break
        if any(map(len, found)):  # else a hotter rotor feeds the winding
            drawn = np.concatenate(found)
        return drawn[np.linspace(0, len(drawn) - 1, NUM_DRAWS).astype(int)]


def _lagged(time_s: np.ndarray, tau: np.ndarray, lag_s: np.ndarray) -> np.ndarray:
    """Return exp(-t/tau) as a sensor of first order shows it that began in equilibrium."""
    decay = np.exp(-time_s / tau)
    if np.all(lag_s == 0.0):
        return decay
    lag = np.where(np.abs(tau - lag_s) < 1e-3 * tau, 1.002 * tau, lag_s)  # the limit is finite
    return (tau * decay - lag * np.exp(-time_s / lag)) / (tau - lag)


NUM_DRAWS = 2000
MOST_TRIES = 60
"""Draws of the amplitudes for each of the other numbers, until enough of them are positive."""
KEPT = 0.5
"""Effective share of the draws that a step of the temperature leaves [1]."""
MOVES, LAST_MOVES = 8, 40
ACCEPTED = 0.25
"""Of the proposals of a random walk in many dimensions: near the best (Roberts and Rosenthal)."""


def sample(log_likelihood: Callable[[Draws], np.ndarray], size: int, seed: int) -> Draws:
    """Return draws of the posterior of standard normal numbers.

    Args:
        log_likelihood: Of draws, shape (draw,).
        size: Number of parameters.
        seed: Random seed.
    """
    random = np.random.default_rng(seed)
    z = random.standard_normal((NUM_DRAWS, size))
    value = log_likelihood(z)
    power, scale = 0.0, 2.38 / np.sqrt(size)
    while power < 1.0:
        step = _step(value, 1.0 - power)
        power += step
        weight = np.exp(step * (value - np.max(value)))
        places = (random.random() + np.arange(NUM_DRAWS)) / NUM_DRAWS
        kept = np.searchsorted(np.cumsum(weight / np.sum(weight)), places).clip(max=NUM_DRAWS - 1)
        z, value = z[kept], value[kept]
        factor = np.linalg.cholesky(np.cov(z.T) + 1e-9 * np.eye(size))
        for _ in range(MOVES if power < 1.0 else LAST_MOVES):
            near = z + scale * random.standard_normal(z.shape) @ factor.T
            new = log_likelihood(near)
            gain = power * (new - value) - 0.5 * np.sum(near**2 - z**2, axis=1)
            taken = np.log(random.random(NUM_DRAWS)) < gain
            z, value = np.where(taken[:, None], near, z), np.where(taken, new, value)
            scale *= np.exp(np.mean(taken) - ACCEPTED)
    return z


def _step(value: np.ndarray, most: float) -> float:
    """Return the step of the temperature that leaves `KEPT` of the draws, or what is left of it."""

    def effective(step: float) -> float:
        weight = np.exp(step * (value - np.max(value)))
        return float(np.sum(weight) ** 2 / np.sum(weight**2) / value.size)

    low, high = 0.0, most
    if effective(high) >= KEPT:
        return high
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= KEPT else (low, middle)
    return max(low, 1e-12)
