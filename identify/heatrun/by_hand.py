"""A network whose parameters are moved by hand along one test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .bench.blocks import Blocks
from .bench.record import Record
from .inference.catalogue import known_effects
from .inference.draws import Draws
from .inference.model import Model
from .inference.predict import of_test
from .inference.virtual import reduce_driven
from .motor import Motor
from .simulation import exact_draws

if TYPE_CHECKING:
    from .runs.run import Run


@dataclass(frozen=True)
class ByHand:
    """A model and a test, with the values that it starts from.

    Attributes:
        model: The network with its effects.
        test: The reduced record.
        values: All parameters by name, in their units.
    """

    model: Model
    test: Blocks
    values: Mapping[str, float]

    @classmethod
    def of(cls, record: Record, motor: Motor, run: Run | None = None) -> ByHand:
        """Start from a run, or, without one, from the priors of a second order for this machine.

        Args:
            record: With currents, losses and sink.
            motor: How its bench measures.
            run: Its last network is taken.

        Raises:
            InputError: If the record lacks a channel, or the motor file a parameter.
        """
        test = reduce_driven(record, motor)
        if run is not None:
            return cls._of(run.draws(), test, run.fitted_as(record))
        model = Model.of("second", motor, known_effects(motor)).scaled(motor, [test])
        return cls._of(exact_draws(model, motor, {}, test), test, None)

    @classmethod
    def _of(cls, draws: Draws, test: Blocks, fitted_as: str | None) -> ByHand:
        owner = fitted_as if fitted_as in draws.parameters.tests else None
        return cls(draws.model, test, of_test(draws, test, fitted_as=owner).middle())

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters that are moved, by name: those of the network."""
        return {p.name: p.unit for p in self.model.form.parameters if p.fixed is None}

    def course(self, moved: Mapping[str, float]) -> Float[np.ndarray, " block"]:
        """Return the modelled means of the winding over the blocks [degC].

        Args:
            moved: Parameters with other values than those of the start, by name.
        """
        values = {name: jnp.asarray(value) for name, value in {**self.values, **moved}.items()}
        means = _block_means(self.model, values, self.test.observation())
        return np.asarray(means)[: self.test.measured.size]


@partial(jax.jit, static_argnums=0)
def _block_means(model: Model, values: Any, test: Any) -> Any:
    return model.block_means(values, test)
