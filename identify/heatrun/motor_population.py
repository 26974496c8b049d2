"""`[population]` of a motor file: what its sisters say of a machine before its first test."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import InputError
from .io.toml_values import text_of
from .motor import HEAT_LIMITS, ParameterOverride

NAME = "population.json"
"""The file of a population, in its folder."""

HEAT = "unmodelled_heat"
"""Name of the heat that a network misses, among the parameters of the noise."""


@dataclass(frozen=True)
class NextMachine:
    """What a population says of its next machine before its first test.

    Attributes:
        parameters: Prior of each thermal parameter.
        effects: Ids of the effects that its machines were calibrated with.
        unmodelled_heat: Median of the prior of the heat that the network misses, sd over the mean
            loss [1]; None where the machines do not tell it.
    """

    parameters: dict[str, ParameterOverride]
    effects: tuple[str, ...] = ()
    unmodelled_heat: float | None = None


def next_of_population(section: Mapping[str, Any], where: str) -> NextMachine:
    """Return what is known of a machine of a known type; nothing where no type is given.

    Each parameter has its own: correlations over the machines are left aside, and covariates are at
    their mean over the machines.

    Args:
        section: `[population]`.
        where: The motor file; a folder is sought from where it is.

    Raises:
        InputError: If there is no population where it says.
    """
    if not section:
        return NextMachine({})
    at = f"{where}, [population]"
    folder = Path(where).parent / text_of(section, "run", at)
    return read_next_machine(folder, at)


def read_next_machine(folder: Path, where: str) -> NextMachine:
    """Return what a population says of its next machine before its first test.

    Args:
        folder: Of the population, or its file.
        where: What asked for it, for messages.

    Raises:
        InputError: If there is no such file, or it is not one that heatrun wrote.
    """
    path = folder / NAME if folder.is_dir() else folder
    remedy = "Give the folder that `heatrun population` wrote."
    try:
        content = json.loads(path.read_bytes())
        found = {name: _prior(said) for name, said in content["parameters"].items()}
        heat = _heat(content.get("noise") or {})
    except OSError as error:
        types = sorted(each.parent.name for each in folder.glob(f"*/{NAME}"))
        raise InputError(
            f"Expected a population, found no readable {path} ({error.strerror}).",
            where=where,
            remedy=f"Name one of the types in it: {', '.join(types)[:200]}." if types else remedy,
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
        raise InputError(
            f"Expected a population as heatrun writes it, got another content in {path}.",
            where=where,
            remedy=remedy,
        ) from None
    sound = [_is_sound(each) for each in found.values()]
    if not found or not all(sound) or not (heat is None or 0.0 < heat < math.inf):
        raise InputError(
            f"Expected positive medians and widths of the parameters in {path}.",
            where=where,
            remedy=remedy,
        )
    effects = dict.fromkeys(name.partition(".")[0] for name in found if "." in name)
    return NextMachine(found, tuple(effects), _within_limits(heat))


def _heat(noise: dict[str, Any]) -> float | None:
    said = noise.get("parameters", {}).get(HEAT)
    return None if said is None else float(said["next_median"])


def _within_limits(heat: float | None) -> float | None:
    """Return the heat as far as a motor file may say it: the tail of a law may reach beyond."""
    low, high = HEAT_LIMITS
    return None if heat is None else min(max(heat, low), high)


def _prior(said: dict[str, Any]) -> ParameterOverride:
    centre = float(said["next_median"])
    if said.get("transform", "log") == "linear":
        return ParameterOverride(value=centre, sd=float(said["next_sd"]))
    return ParameterOverride(value=centre, relative_sd=math.expm1(float(said["next_log_sd"])))


def _is_sound(prior: ParameterOverride) -> bool:
    width = prior.sd if prior.relative_sd is None else prior.relative_sd
    assert prior.value is not None
    assert width is not None
    is_positive = prior.relative_sd is None or prior.value > 0.0
    return math.isfinite(prior.value) and is_positive and math.isfinite(width) and width > 0.0
