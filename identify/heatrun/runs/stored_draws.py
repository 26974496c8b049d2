"""The draws of a run as they lie in its files, read without what made them.

xarray reads the same, in ten times the time that it takes to load h5py.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..model.parameters import ParameterSet
from ..record.motor import Adequacy

if TYPE_CHECKING:
    from ..model.draws import PlausibleEffect, PlausibleEffects

Groups = Mapping[str, Mapping[str, np.ndarray]]
"""Arrays by group and name, those of draws of shape (chain, draw) or (chain, draw, test)."""

ABSENT = -12.0
"""Score of unmodelled heat in a run that was made before there was any: nothing of the loss."""

SIZE = "maybe_missing_size"
"""Name of the sizes of the effects behind each draw."""


def groups_of(data: bytes) -> Groups:
    """Return the draws and what belongs to each of them, from the bytes of a NetCDF file."""
    import h5py

    with h5py.File(io.BytesIO(data)) as file:
        return {
            group: {name: np.asarray(each) for name, each in held.items()}
            for group, held in file.items()
            if group in ("posterior", "sample_stats") and isinstance(held, h5py.Group)
        }


def by_name(groups: Groups) -> dict[str, np.ndarray]:
    """Return the draws of what was free by the name of its slot [their units], shape (draw,)."""
    group = groups["posterior"]
    found = {name: each.ravel() for name, each in group.items() if each.ndim == 2}
    for name, each in group.items():
        if each.ndim == 3:
            tests = group.get(f"test_of_{name}", group.get("test", np.array([])))
            for place, test in enumerate(tests):
                found[f"{name}[{test.decode()}]"] = each[..., place].ravel()
    return found


def vectors(
    groups: Groups, parameters: ParameterSet, adequacy: Adequacy
) -> Float[np.ndarray, "chain draw all"]:
    """Return the scores of parameters and noise of the draws in the groups of a run.

    Args:
        groups: From `groups_of`.
        parameters: What stands in which place.
        adequacy: Prior of the heat.
    """
    group = groups["posterior"]
    from ..model.noise import NOISE, noise_parameters

    columns = []
    for slot in parameters.slots:
        values = np.asarray(group[slot.parameter.name], dtype=float)
        if slot.test is not None:
            held = [s.name for s in parameters.slots if s.parameter.name == slot.parameter.name]
            values = values[..., held.index(slot.name)]
        columns.append(slot.parameter.score(values))
    for parameter in noise_parameters(adequacy):
        if parameter.name in group:
            columns.append(parameter.score(np.asarray(group[parameter.name], dtype=float)))
        else:  # runs of old have no unmodelled heat
            columns.append(np.full(np.shape(group[NOISE[0].name]), ABSENT))
    return np.stack(columns, axis=-1)


def plausible(groups: Groups, effects: tuple[PlausibleEffect, ...]) -> PlausibleEffects | None:
    """Return the effects behind the draws of a run, None where there are none.

    Args:
        groups: From `groups_of`.
        effects: As they stand in the result.
    """
    if not effects:
        return None
    from ..model.draws import PlausibleEffects

    size = np.asarray(groups["sample_stats"][SIZE], dtype=float)
    return PlausibleEffects(effects, size.reshape(-1, len(effects)))
