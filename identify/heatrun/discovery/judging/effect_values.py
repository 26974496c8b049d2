"""What a joint fit says of an effect's parameters, in their units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from lptn.effects import AbstractEffect, NodeEffect

from ...inference.effect_parameters import qualified
from ...inference.fitting.fit_result import Fit
from ...inference.parameters import Slot
from ..screening.engine import Engine, Refit


def named_values(
    engine: Engine, refit: Refit, own: Iterable[int]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and standard deviations of an effect's parameters by name [their units].

    Args:
        engine: The extended model.
        refit: The fit.
        own: Slots of the effect.
    """
    slots = list(own)
    spread = np.sqrt(np.diag(_covariance(engine, refit, slots)))
    return _named([engine.slots[slot] for slot in slots], refit.z[slots], spread)


def amplitude_sd(engine: Engine, refit: Refit, own: Iterable[int]) -> dict[str, float]:
    """Return the standard deviations by which an effect's amplitudes are judged [their units].

    Those of the joint fit; where the effect has a body of its own, those with its other parameters
    held: capacity and time constant of a body go together, and neither is sure though the body is.

    Args:
        engine: The extended model.
        refit: The fit.
        own: Slots of the effect.
    """
    slots = list(own)
    chosen = [engine.slots[slot] for slot in slots]
    kind = engine.kinds[chosen[0].parameter.name.split(".", 1)[0]]
    spread = _judged_by(kind, _covariance(engine, refit, slots))
    return _named(chosen, refit.z[slots], spread)[1]


def of_fit(
    fit: Fit, kind: type[AbstractEffect], test: int | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return an effect's values in a fit, and what its amplitudes are judged by [their units].

    Args:
        fit: A fit with the effect.
        kind: The effect.
        test: Index of the test that it happens in; None if it acts in all of them.
    """
    names = {qualified(kind, name) for name in kind.card.parameters}
    places = [
        place
        for place, slot in enumerate(fit.slots)
        if slot.parameter.name in names and slot.test == test
    ]
    spread = _judged_by(kind, fit.covariance[np.ix_(places, places)])
    return _named([fit.slots[place] for place in places], fit.z[places], spread)


def _judged_by(
    kind: type[AbstractEffect], covariance: Float[np.ndarray, "slot slot"]
) -> Float[np.ndarray, " slot"]:
    """Return the standard deviations of scores that an effect's amplitudes are judged by [1]."""
    if issubclass(kind, NodeEffect):
        return np.diag(np.linalg.inv(covariance)) ** -0.5
    return np.sqrt(np.diag(covariance))


def _covariance(
    engine: Engine, refit: Refit, slots: Sequence[int]
) -> Float[np.ndarray, "slot slot"]:
    """Return the joint covariance of the scores of some slots [1]."""
    columns = engine.whiten(refit.noise, refit.jacobian)
    covariance = np.linalg.inv(columns.T @ columns + np.eye(len(refit.free)))
    places = [refit.free.index(slot) for slot in slots]
    return covariance[np.ix_(places, places)]


def _named(
    slots: Sequence[Slot], z: Float[np.ndarray, " slot"], spread: Float[np.ndarray, " slot"]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and, from those of the scores, standard deviations [their units]."""
    values, sd = {}, {}
    for slot, score, size in zip(slots, z, spread, strict=True):
        parameter = slot.parameter
        name = parameter.name.split(".", 1)[1]
        values[name] = float(parameter.value(np.asarray(score)))
        scale = values[name] if parameter.transform == "log" else 1.0
        sd[name] = parameter.sd * scale * float(size)
    return values, sd
