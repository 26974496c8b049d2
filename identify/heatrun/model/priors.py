"""The numbers of a parameter set, for the numerics."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .parameters import Form, ParameterSet


class Priors(eqx.Module):
    """The numbers of a parameter set.

    Attributes:
        centre: Centre of each slot's prior [its unit], shape (parameter,).
        sd: Its standard deviation, of the logarithm [1] or [its unit], shape (parameter,).
        largest: Largest score of each slot, shape (parameter,): a share is one at most.
        fixed: Fixed values by name, for each test.
    """

    centre: Float[Any, " parameter"]
    sd: Float[Any, " parameter"]
    largest: Float[Any, " parameter"]
    fixed: tuple[dict[str, Float[Any, ""]], ...]

    def values(
        self, form: Form, z: Float[Any, " parameter ..."], test: int
    ) -> dict[str, Float[Any, "..."]]:
        """Return the values of all parameters for one test [their units].

        Args:
            form: What stands in which slot.
            z: Scores, of JAX or of NumPy.
            test: Index of the test.
        """
        exp = np.exp if isinstance(z, np.ndarray) else jnp.exp  # eager JAX would compile it
        result = dict(self.fixed[test])
        for position, (name, transform, owner) in enumerate(form):
            if owner is None or owner == test:
                shift = self.sd[position] * z[position]
                centre = self.centre[position]
                result[name] = centre * exp(shift) if transform == "log" else centre + shift
        return result

    @classmethod
    def of(cls, parameters: ParameterSet) -> Priors:
        """Return centres, standard deviations, and fixed values of a parameter set."""
        return cls(
            centre=np.asarray([slot.parameter.centre for slot in parameters.slots]),
            sd=np.asarray([slot.parameter.sd for slot in parameters.slots]),
            largest=np.asarray([slot.parameter.largest_score for slot in parameters.slots]),
            fixed=tuple(
                {
                    name: np.asarray(parameter.fixed, dtype=float)
                    for name, parameter in of_test.items()
                    if parameter.fixed is not None
                }
                for of_test in parameters.by_test
            ),
        )
