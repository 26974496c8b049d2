"""Which values a parameter can have in any machine: what lies outside was mistyped, or is a test.

The ranges are wide: from a motor of some grams to a generator of thousands of tonnes. They keep
numbers out with which nothing can be computed, such as 1e300, and a unit that is wrong by far.
"""

from __future__ import annotations

import math

from .bench.channels.schema import BODIES, body_name
from .errors import InputError
from .motor import ParameterOverride

UNITS = {
    "Ceq": "J/K", "Ceq_w": "J/K", "Ceq_sr": "J/K",
    "Req": "K/W", "Req_w": "K/W", "Req_sr": "K/W",
    "Rs0": "ohm",
    "Tw_start": "degC", "Tsr_start": "degC",
    "sensor_offset": "K", "ambient_offset": "K", "second_sink_offset": "K",
    "power_gain": "1", "sensor_gain": "1", "current_gain": "1",
    "torque_offset": "N m",
    "shaft_power_gain": "1", "shaft_power_offset": "W",
    "load_timing": "s",
    **{
        f"{body_name(channel)}_{part}": unit
        for channel in BODIES
        for part, unit in (("gain", "1"), ("offset", "K"), ("lag", "s"))
    },
}  # fmt: skip
"""Units of the parameters beside those of effects, known before any model is made."""

RANGES = {
    "J/K": (1e-3, 1e10),  # copper has 385 J/(kg K)
    "K/W": (1e-7, 1e5),  # still air around a thumb: some 100 K/W
    "ohm": (1e-9, 1e6),
    "degC": (-273.15, 1500.0),  # absolute zero; where iron melts
    "K": (-500.0, 500.0),
    "1": (-0.99, 10.0),  # relative errors: at -1 nothing is left of what is measured
    "N m": (-1e6, 1e6),
    "W": (-1e9, 1e9),
    "s": (-86400.0, 86400.0),
}
"""Lowest and highest value by unit."""

RELATIVE_SD = (1e-6, 1e3)
"""Standard deviation of a prior relative to its value [1]: below, the parameter is fixed; above,
the interval spans six powers of ten."""

SMALLEST_SHARE = 1e-12
"""Smallest standard deviation of a prior as a share of the range: below, the parameter is fixed."""

WIDTHS = 25.0
"""How far an effect's parameter may lie from the middle of its plausible range, in its widths; the
width is four standard deviations of the prior."""


LOG_WIDTHS = 10.0
"""The same for a log-normal parameter, in standard deviations of the logarithm."""


def refuse_implausible(
    name: str, said: ParameterOverride, unit: str, limits: tuple[float, float], where: str
) -> None:
    """Refuse values of a motor file that no machine has.

    Args:
        name: Of the parameter.
        said: What the motor file says of it.
        unit: Of the parameter.
        limits: Lowest and highest value [unit].
        where: The place in the motor file.

    Raises:
        InputError: With the range.
    """
    low, high = limits
    of_unit = "" if unit == "1" else f" {unit}"
    for label, number in (("fixed", said.fixed), ("value", said.value)):
        if number is not None and not low <= number <= high:
            raise InputError(
                f"{label} = {number:g}{of_unit} is beyond what {name} is in any machine: "
                f"{low:g} to {high:g}{of_unit}.",
                where=where,
                remedy=f"Correct it (the unit is {unit}), or leave it out to have it estimated.",
            )
    widest, smallest = high - min(low, 0.0), SMALLEST_SHARE * (high - low)
    if said.sd is not None and not smallest <= said.sd <= widest:
        raise InputError(
            f"sd = {said.sd:g}{of_unit} is no standard deviation of {name}: expected "
            f"{smallest:.2g} to {widest:g}{of_unit}.",
            where=where,
            remedy="Correct it, or write fixed = … for a value that is known.",
        )
    low, high = RELATIVE_SD
    if said.relative_sd is not None and not low <= said.relative_sd <= high:
        raise InputError(
            f"relative_sd = {said.relative_sd:g} is no standard deviation of {name} relative to "
            f"its value: expected {low:g} to {high:g} (0.2 is 20 %).",
            where=where,
            remedy="Correct it, or write fixed = … for a value that is known.",
        )


def limits_around(centre: float, sd: float, *, is_log: bool) -> tuple[float, float]:
    """Return the limits of an effect's parameter from its prior, which is wide already.

    Args:
        centre: Of the prior [its unit].
        sd: Of the prior, of the logarithm [1] or [its unit].
        is_log: Whether the prior is one of the logarithm.
    """
    if is_log:
        reach = math.exp(min(LOG_WIDTHS * sd, 200.0))
        return centre / reach, centre * reach
    return centre - 4.0 * WIDTHS * sd, centre + 4.0 * WIDTHS * sd
