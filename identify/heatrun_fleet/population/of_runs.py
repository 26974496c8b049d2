"""The machines of a type from the runs of their calibrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heatrun.errors import InputError
from heatrun.inference.draws import NUM_NOISE
from heatrun.inference.noise import noise_parameters
from heatrun.inference.parameters import Parameter
from heatrun.runs.run import Run

from ..rows import THERMAL
from .gathered import FEWEST, Gathered, is_positive

Normal = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def gathered_of_runs(runs: Sequence[Run], network: str | None = None) -> Gathered:
    """Return the posterior of each machine's thermal parameters, and of its noise.

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
    kinds = []
    rows, noises = [], []
    of_noise: tuple[Parameter, ...] = ()
    for run in runs:
        draws = run.draws(network)
        found = {
            place: slot.parameter
            for place, slot in enumerate(draws.parameters.slots)
            if slot.parameter.role in THERMAL and slot.test is None
        }
        own = tuple(parameter.name for parameter in found.values())
        if kinds and own != tuple(parameter.name for parameter in kinds):
            raise InputError(
                f"Expected free parameters {', '.join(p.name for p in kinds)} as in "
                f"{runs[0].path}, got {', '.join(own)}.",
                where=str(run.path),
                remedy="Calibrate all machines with one network, and fix none of its parameters.",
            )
        kinds = list(found.values())
        rows.append(_normal(kinds, draws.vectors[:, list(found)]))
        of_noise = noise_parameters(draws.model.adequacy)
        noises.append(_normal(of_noise, draws.vectors[:, -NUM_NOISE:]))
    names = [run.path.name for run in runs]
    if len(set(names)) < len(names):
        names = [str(run.path) for run in runs]
    is_told = [is_positive(covariance, NUM_NOISE) for _, covariance, _, _ in noises]
    own = [name for name, told in zip(names, is_told, strict=True) if told]
    noises = [noise for noise, told in zip(noises, is_told, strict=True) if told]
    return replace(
        _gathered(names, kinds, rows),
        source={"network": runs[0].choose(network)},
        noise=_gathered(own, of_noise, noises) if own else None,
    )


def _normal(kinds: Sequence[Parameter], scores: np.ndarray) -> Normal:
    """Return mean and covariance of draws, then centre and width of the prior, all in the space of
    the transforms.
    """
    scale = np.array([parameter.sd for parameter in kinds])
    centre = np.array([np.log(p.centre) if p.transform == "log" else p.centre for p in kinds])
    values = centre + scale * scores
    return values.mean(axis=0), np.cov(values.T), centre, scale


def _gathered(names: Sequence[str], kinds: Sequence[Parameter], rows: Sequence[Normal]) -> Gathered:
    mean, covariance, prior_mean, prior_sd = map(np.stack, zip(*rows, strict=True))
    return Gathered(
        tuple(names),
        tuple(parameter.name for parameter in kinds),
        tuple(parameter.unit for parameter in kinds),
        tuple(parameter.transform for parameter in kinds),
        mean,
        covariance,
        prior_mean,
        prior_sd,
    )
