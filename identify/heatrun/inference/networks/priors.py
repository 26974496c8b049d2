"""Priors of a network's parameters: their defaults, and what a network file says of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ...errors import InputError
from ..parameters import Parameter
from .form import Link

RESISTANCE = (
    "log-normal; its 95 % span a factor of 20 to either side, which holds machines from 1 kW "
    "air-cooled to 100 kW water-cooled"
)
_SD_RESISTANCE = 1.5
CAPACITANCE = (
    "log-normal; its 95 % span a factor of 7 to either side: copper and iron of 1 kg to 60 kg "
    "and 3 kg to 150 kg, at 0.39 and 0.48 kJ/(kg K)"
)
_SD_CAPACITANCE = 1.0


def capacitance(node: str, is_winding: bool, said: Mapping, where: str) -> Parameter:
    """Return the heat capacity of a node [J/K], with what the file says of it."""
    found = said_of(said, "capacitance", node)
    name = found or f"Ceq_{node}"
    default = Parameter(
        name, "J/K", f"heat capacity of {node}", "network", "log",
        500.0 if is_winding else 1e4, _SD_CAPACITANCE, CAPACITANCE,
    )  # fmt: skip
    return prior(default, said.get(name, {}), f"{where}, [parameters.{name}]")


def resistance(link: Link, said: Mapping, where: str) -> Parameter:
    """Return the resistance of a link [K/W], with what the file says of it."""
    found = said_of(said, "resistance", list(link)) or said_of(said, "resistance", [*link][::-1])
    name = found or f"Req_{link[0]}_{link[1]}"
    default = Parameter(
        name, "K/W", f"resistance from {link[0]} to {link[1]}", "network", "log",
        0.15, _SD_RESISTANCE, RESISTANCE,
    )  # fmt: skip
    return prior(default, said.get(name, {}), f"{where}, [parameters.{name}]")


def prior(default: Parameter, keys: Mapping[str, Any], where: str) -> Parameter:
    """Return a parameter with the prior that its section gives."""
    numbers = {}
    for key in ("value", "sd", "sd_log", "relative_sd", "fixed"):
        if key in keys:
            number = keys[key]
            is_number = isinstance(number, int | float) and not isinstance(number, bool)
            if not is_number or not math.isfinite(number) or not number > 0.0:
                raise InputError(f"{key} = {number!r:.40}: expected a number above 0.", where=where)
            numbers[key] = float(number)
    for key in ("meaning", "basis"):
        if key in keys and not isinstance(keys[key], str):
            raise InputError(f"{key}: expected a text.", where=where)
    is_log = default.transform == "log"
    wrong = [key for key in numbers if key in (("sd",) if is_log else ("sd_log", "relative_sd"))]
    if wrong:
        raise InputError(
            f"{wrong[0]} has no meaning for {default.name}.",
            where=where,
            remedy="Give relative_sd = 0.5, for example." if is_log else "Give sd.",
        )
    sd = numbers.get("sd_log" if is_log else "sd", default.sd)
    if "relative_sd" in numbers:
        sd = math.log1p(numbers["relative_sd"])
    stated = [key for key in ("value", "sd", "sd_log", "relative_sd") if key in numbers]
    return replace(
        default,
        centre=numbers.get("value", default.centre),
        sd=sd,
        fixed=numbers.get("fixed"),
        meaning=keys.get("meaning", default.meaning),
        basis=keys.get("basis", "stated in the network file" if stated else default.basis),
    )


def prior_text(parameter: Parameter) -> dict[str, Any]:
    """Return the keys of a parameter's section, which read back to the same prior."""
    text: dict[str, Any] = {"meaning": parameter.meaning, "basis": parameter.basis}
    if parameter.fixed is not None:
        return text | {"fixed": parameter.fixed}
    # of a logarithm exactly as it is carried: exp and back would lose the last digit
    sd = "sd_log" if parameter.transform == "log" else "sd"
    return text | {"value": parameter.centre, sd: parameter.sd}


def said_of(said: Mapping[str, Any], key: str, value: Any) -> str | None:
    """Return the section whose key has a value, such as `capacitance = "winding"`."""
    names = [name for name, keys in said.items() if keys.get(key) == value]
    return names[0] if names else None
