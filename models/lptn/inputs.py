"""What drives a network: mean currents, losses and temperatures over consecutive intervals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

SIGNALS = (
    "current_squared", "losses", "ambient", "speed", "coolant", "fan", "shaft_power", "second_sink",
)  # fmt: skip
"""What varies in time among the inputs, those that may be absent among it."""


class Inputs(eqx.Module):
    """Means over consecutive intervals; the state lives at their edges.

    A mean of the *square* of the current is kept, not the square of its mean, because the loss
    follows the former. Between edges every quantity counts as constant, so a coarse grid stays
    exact in energy.

    Attributes:
        step: Length of the intervals [s]: a scalar if all are equal (the fast path), else
            shape (time,).
        current_squared: Mean of the squared rms phase current [A^2], shape (time,).
        losses: Mean of the measured loss channel [W], shape (time,); its meaning is declared by
            `lptn.CopperLosses.kind`.
        ambient: Mean temperature T0 of the sink [degC], shape (time,).
        speed: Mean mechanical speed [rad/s], shape (time,), or None if not recorded.
        coolant: Mean coolant temperature [degC], shape (time,), or None.
        fan: Fan or coolant flow relative to its rated value [1], shape (time,), or None.
        shaft_power: Mean mechanical power Pm, positive as a motor [W], shape (time,), or None.
        second_sink: Mean temperature of the second sink [degC], shape (time,), or None; only a
            network with a second boundary has a use for it.
        rated_speed: Speed that laws are scaled with [rad/s].
        rated_current: Rms current that laws are scaled with [A].
    """

    step: Float[Any, "..."]
    current_squared: Float[Any, " time"]
    losses: Float[Any, " time"]
    ambient: Float[Any, " time"]
    speed: Float[Any, " time"] | None = None
    coolant: Float[Any, " time"] | None = None
    fan: Float[Any, " time"] | None = None
    shaft_power: Float[Any, " time"] | None = None
    second_sink: Float[Any, " time"] | None = None
    rated_speed: Float[Any, ""] | float = 1.0
    rated_current: Float[Any, ""] | float = 1.0

    def __check_init__(self) -> None:
        if jnp.ndim(self.current_squared) != 1:
            raise ValueError(
                f"Inputs.current_squared has shape {jnp.shape(self.current_squared)}, expected "
                "(time,): give one mean per interval."
            )
        num_time = self.num_time
        for name in SIGNALS[1:]:
            values = getattr(self, name)
            if values is not None and values.shape != (num_time,):
                raise ValueError(
                    f"Inputs.{name} has shape {values.shape}, expected {(num_time,)} as "
                    "`current_squared` has: give one mean per interval."
                )
        if jnp.shape(self.step) not in ((), (num_time,)):
            raise ValueError(
                f"Inputs.step has shape {jnp.shape(self.step)}, expected () for equal intervals or "
                f"{(num_time,)}."
            )

    @property
    def num_time(self) -> int:
        """Number of intervals."""
        return self.current_squared.shape[0]

    @property
    def is_uniform(self) -> bool:
        """Whether all intervals have one length."""
        return jnp.ndim(self.step) == 0

    def edges(self) -> Float[Array, " edge"]:
        """Return the times of the edges [s], shape (time + 1,), from 0."""
        steps = jnp.broadcast_to(self.step, (self.num_time,))
        return jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps)])

    def ambient_at_edges(self) -> Float[Array, " edge"]:
        """Return the sink temperature at the edges [degC], shape (time + 1,).

        An edge between two intervals takes the mean of theirs.
        """
        inner = 0.5 * (self.ambient[1:] + self.ambient[:-1])
        return jnp.concatenate([self.ambient[:1], inner, self.ambient[-1:]])

    def drive(self) -> Drive:
        """Return the arrays that vary in time, with times at the middle of the intervals."""
        edges = self.edges()
        return Drive(
            time=0.5 * (edges[:-1] + edges[1:]),
            current_squared=self.current_squared,
            losses=self.losses,
            ambient=self.ambient,
            speed=None if self.speed is None else self.speed / self.rated_speed,
            speed_rad=self.speed,
            coolant=self.coolant,
            fan=self.fan,
            shaft_power=self.shaft_power,
            second_sink=self.second_sink,
            current_ratio_squared=self.current_squared / self.rated_current**2,
        )


class Drive(eqx.Module):
    """The inputs of one interval (scalars), or of all of them (arrays): what an effect sees.

    Attributes:
        time: Middle of the interval since the start of the test [s].
        current_squared: Mean squared rms phase current [A^2].
        losses: Mean of the measured loss channel [W].
        ambient: Sink temperature T0 [degC].
        speed: Speed over rated speed [1], or None.
        speed_rad: Speed [rad/s], or None.
        coolant: Coolant temperature [degC], or None.
        fan: Fan or flow over its rated value [1], or None.
        current_ratio_squared: Mean squared current over the squared rated current [1].
        shaft_power: Mechanical power [W], or None.
        second_sink: Temperature of the second sink [degC], or None.
    """

    time: Float[Array, "..."]
    current_squared: Float[Array, "..."]
    losses: Float[Array, "..."]
    ambient: Float[Array, "..."]
    speed: Float[Array, "..."] | None
    speed_rad: Float[Array, "..."] | None
    coolant: Float[Array, "..."] | None
    fan: Float[Array, "..."] | None
    current_ratio_squared: Float[Array, "..."]
    shaft_power: Float[Array, "..."] | None = None
    second_sink: Float[Array, "..."] | None = None

    @classmethod
    def constant(
        cls,
        *,
        current_squared: Float[Array, ""] | float,
        losses: Float[Array, ""] | float,
        ambient: Float[Array, ""] | float,
        speed: Float[Array, ""] | float | None = None,
        coolant: Float[Array, ""] | float | None = None,
        fan: Float[Array, ""] | float | None = None,
        shaft_power: Float[Array, ""] | float | None = None,
        second_sink: Float[Array, ""] | float | None = None,
        time: Float[Array, ""] | float = 0.0,
        rated_speed: Float[Array, ""] | float = 1.0,
        rated_current: Float[Array, ""] | float = 1.0,
    ) -> Drive:
        """Return inputs that hold all the time.

        Args:
            current_squared: Squared rms phase current [A^2].
            losses: The loss channel [W].
            ambient: Sink temperature T0 [degC].
            speed: Speed [rad/s], or None.
            coolant: Coolant temperature [degC], or None.
            fan: Fan or flow over its rated value [1], or None.
            shaft_power: Mechanical power [W], or None.
            second_sink: Temperature of the second sink [degC], or None.
            time: Instant since the start of a test at which effects that follow the time
                stand [s].
            rated_speed: As in `Inputs`.
            rated_current: As in `Inputs`.
        """

        def number(value: Any) -> Any:
            """Keep what NumPy knows in NumPy: eager JAX would compile each step with it."""
            if value is None or isinstance(value, jax.Array):
                return value
            return np.asarray(value, dtype=float)

        squared = number(current_squared)
        return cls(
            time=number(time),
            current_squared=squared,
            losses=number(losses),
            ambient=number(ambient),
            speed=None if speed is None else number(speed) / rated_speed,
            speed_rad=number(speed),
            coolant=number(coolant),
            fan=number(fan),
            shaft_power=number(shaft_power),
            second_sink=number(second_sink),
            current_ratio_squared=squared / number(rated_current) ** 2,
        )

    def scale_current(self, factor: Float[Array, ""] | float) -> Drive:
        """Return the inputs with the squared current multiplied by a factor [1]."""
        return replace(
            self,
            current_squared=factor * self.current_squared,
            current_ratio_squared=factor * self.current_ratio_squared,
        )
