"""What a fit leaves of parameters and noise: draws, enough to predict any test with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from ..motor import Motor
from . import noise as noise_module
from .loggers import Loggers
from .model import Model
from .noise import Noise
from .parameters import ParameterSet
from .plausible_effects import PlausibleEffects

NUM_NOISE = len(noise_module.NOISE)


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of parameters and noise with all that gives them a meaning.

    Attributes:
        model: Network with effects and nuisances.
        motor: The machine.
        parameters: What stands in which place of a vector, with priors and fixed values.
        vectors: Scores of parameters and noise, shape (draw, all).
        plausible: Effects behind the draws; None where all are of the model alone.
        loggers: Noise of each logger.
    """

    model: Model
    motor: Motor
    parameters: ParameterSet
    vectors: Float[np.ndarray, "draw all"]
    plausible: PlausibleEffects | None = None
    loggers: Loggers = field(default_factory=dict)

    def thin(self, num: int, seed: int = 0) -> Draws:
        """Return `num` of the draws, picked evenly at random without repetition."""
        picked = np.random.default_rng(seed).permutation(self.vectors.shape[0])[:num]
        plausible = None if self.plausible is None else self.plausible.pick(picked)
        return replace(self, vectors=self.vectors[picked], plausible=plausible)

    def values(self) -> dict[str, np.ndarray]:
        """Return the draws of the free parameters by slot name [their units], shape (draw,)."""
        return self.parameters.physical(self.vectors[:, : self.parameters.num_free])

    def of_test(self, test: str | None) -> dict[str, np.ndarray]:
        """Return the draws that hold for a test by bare name [their units], shape (draw,).

        Args:
            test: Name of a test that was fitted; None for any other test, which takes over
                what all tests share.
        """
        index = None if test is None else self.parameters.tests.index(test)
        size = self.vectors.shape[0]
        result = {}
        for name, parameter in self.parameters.by_test[index or 0].items():
            if parameter.fixed is not None and (index is not None or not parameter.per_test):
                result[name] = np.full(size, parameter.fixed)
        values = self.values()
        for slot in self.parameters.slots:
            if slot.test is None or slot.test == index:
                result[slot.parameter.name] = values[slot.name]
        return result

    def noise(self) -> Noise:
        """Return the noise of the first logger for each draw, shape (draw,) each."""
        return noise_module.from_scores(self.vectors[:, -NUM_NOISE:].T)
