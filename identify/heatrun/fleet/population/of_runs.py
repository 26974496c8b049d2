"""The evidence of machines from the runs of their calibrations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...runs.run import Run
from .evidence import Evidence

FEWEST = 3
"""Machines that a spread can be told from."""


def evidence_of_runs(runs: Sequence[Run], network: str | None = None) -> Evidence:
    """Return what the tests of each machine say of the logarithms of its thermal parameters.

    Args:
        runs: One for each machine, all with one network.
        network: Name of the network, where a run has several; by default the one that its sheet is
            of.

    Raises:
        InputError: If there are too few runs, or one was fitted with another network, a fixed
            parameter, or an effect that others do not have.
    """
    if len(runs) < FEWEST:
        raise InputError(
            f"Expected the runs of {FEWEST} machines or more, got {len(runs)}.",
            remedy="Calibrate more machines of the type; a spread cannot be told from fewer.",
        )
    names: tuple[str, ...] = ()
    rows = []
    for run in runs:
        draws = run.draws(network)
        found = {
            place: slot.parameter
            for place, slot in enumerate(draws.parameters.slots)
            if slot.parameter.role == "network" and slot.test is None
        }
        own = tuple(parameter.name for parameter in found.values())
        if names and own != names:
            raise InputError(
                f"Expected free parameters {', '.join(names)} as in {runs[0].path}, got "
                f"{', '.join(own)}.",
                where=str(run.path),
                remedy="Calibrate all machines with one network, and fix none of its parameters.",
            )
        names = own
        scores = draws.vectors[:, list(found)]
        scale = np.array([parameter.sd for parameter in found.values()])
        centre = np.log([parameter.centre for parameter in found.values()])
        logs = centre + scale * scores
        rows.append((logs.mean(axis=0), np.cov(logs.T), centre, np.diag(scale**2)))
    return Evidence.of_posteriors(names, *map(np.stack, zip(*rows, strict=True)))
