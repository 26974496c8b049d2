"""What the population of a machine type says of the next one before its first test."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.toml_text import text_of
from ..record.motor import HEAT_LIMITS, ParameterOverride

NAME = "population.json"
"""The file of a population, in its folder."""

HEAT = "unmodelled_heat"
"""Name of the heat that a network misses, among the parameters of the noise and in `[adequacy]`."""


@dataclass(frozen=True)
class NextMachine:
    """What a population says of its next machine before its first test."""

    parameters: dict[str, ParameterOverride]  # Prior of each thermal parameter.
    effects: tuple[str, ...] = ()  # Ids of the effects that its machines were calibrated with.
    # `[adequacy]`: how much heat the network misses, empty where the machines do not tell it.
    adequacy: Mapping[str, float] = field(default_factory=dict)


def next_of_population(section: Mapping[str, Any], where: str) -> NextMachine:
    """Return what is known of a machine of a known type; nothing where no type is given.

    Each parameter has its own: correlations over the machines are left aside, and covariates are at
    their mean over the machines. A folder is sought from where the motor file is.

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

    Raises:
        InputError: If there is no such file, or it is not one that heatrun wrote.
    """
    path = folder / NAME if folder.is_dir() else folder
    remedy = "Give the folder that `heatrun population` wrote."
    try:
        content = json.loads(path.read_bytes())
        found = {name: _prior(said) for name, said in content["parameters"].items()}
        noise = (content.get("noise") or {}).get("parameters", {}).get(HEAT)
        heat = None if noise is None else _positive(noise["next_median"])
        if not found:
            raise ValueError
    except OSError as error:
        types = sorted(each.parent.name for each in folder.glob(f"*/{NAME}"))
        raise InputError(
            f"Expected a population, found no readable {path} ({error.strerror}).",
            where=where,
            remedy=f"Name one of the types in it: {', '.join(types)[:200]}." if types else remedy,
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
        raise InputError(
            "Expected a population as heatrun writes it, with positive medians and widths of the "
            f"parameters, got another content in {path}.",
            where=where,
            remedy=remedy,
        ) from None
    effects = dict.fromkeys(name.partition(".")[0] for name in found if "." in name)
    # as far as a motor file may say it: the tail of a law may reach beyond
    told = {} if heat is None else {HEAT: min(max(heat, HEAT_LIMITS[0]), HEAT_LIMITS[1])}
    return NextMachine(found, tuple(effects), told)


def _prior(said: dict[str, Any]) -> ParameterOverride:
    if said.get("transform", "log") == "linear":
        centre = float(said["next_median"])
        if not math.isfinite(centre):
            raise ValueError
        return ParameterOverride(value=centre, sd=_positive(said["next_sd"]))
    width = _positive(math.expm1(float(said["next_log_sd"])))
    return ParameterOverride(value=_positive(said["next_median"]), relative_sd=width)


def _positive(said: Any) -> float:
    number = float(said)
    if not 0.0 < number < math.inf:
        raise ValueError
    return number
