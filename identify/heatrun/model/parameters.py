"""Parameters by name: unit, transform, prior, fixed or free, shared or one per test.

Every parameter is carried as a standard score z: its transform (log or identity) minus the
prior's centre, over the prior's standard deviation. The prior is then z ~ N(0, 1) for all of
them, steps of a solver are of one size, and a posterior with |z| sd near 1 is one where the data
said nothing.

Behind them stand the parameters of effects, whose priors go with the size of the machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from ..errors import InputError, did_you_mean
from ..motor.file import RANGES, limits_around, refuse_implausible
from ..motor.keys import UNITS
from ..record.motor import Motor, ParameterOverride

if TYPE_CHECKING:
    from lptn.effects import AbstractEffect, Quantity

    from .problem import Priors

Transform = Literal["log", "linear"]
Role = Literal["network", "resistance", "start", "instrument", "change", "effect", "known",
             "noise"]  # fmt: skip
"""`"effect"` is one of an effect, `"known"` one of an effect that a search takes as given."""


@dataclass(frozen=True)
class Parameter:
    """One quantity of a model."""

    name: str  # As in priors, posteriors, sheets and JSON.
    unit: str  # SI unit as printed.
    meaning: str  # What it is, in a few words.
    role: Role  # What it belongs to; `"instrument"` marks a type B uncertainty.
    transform: Transform  # `"log"` for positive quantities.
    centre: float  # Centre of the prior (its median), in `unit`.
    sd: float  # Standard deviation of the prior: of the logarithm [1] or in `unit`.
    basis: str  # Why the prior is what it is.
    per_test: bool = False  # One value for each test instead of one for all.
    fixed: float | None = None  # Held at this value, in `unit`; None if it is estimated.
    # Value that it cannot pass, such as 1 for a share, in `unit`; None if there is none.
    limit: float | None = None

    def value(self, z: Float[Any, "..."]) -> Float[Any, "..."]:
        """Return the value [unit] for standard scores, an array of the library that `z` is of."""
        scaled = self.sd * z
        if self.transform == "linear":
            return self.centre + scaled
        # eager JAX would compile a function for each operation
        if isinstance(z, (np.ndarray, np.generic)):
            return self.centre * np.exp(scaled)
        import jax.numpy as jnp

        return self.centre * jnp.exp(scaled)

    def score(self, value: float | np.ndarray) -> np.ndarray:
        """Return the standard score for values [unit]."""
        if self.transform == "log":
            return np.log(np.asarray(value) / self.centre) / self.sd
        return (np.asarray(value) - self.centre) / self.sd

    @property
    def largest_score(self) -> float:
        """Score of the limit, infinite where there is none."""
        return np.inf if self.limit is None else float(self.score(self.limit))

    def prior_interval_95(self) -> tuple[float, float]:
        """Return the central 95 % of the prior [unit]."""
        return float(self.value(np.float64(-1.96))), float(self.value(np.float64(1.96)))


@dataclass(frozen=True)
class Slot:
    """A place in the vector of scores: a free parameter, of one test or of all."""

    parameter: Parameter  # What stands there.
    test: int | None  # Index of the test it belongs to, or None if shared.
    name: str  # Parameter name, with the test in brackets if it belongs to one.


Form = tuple[tuple[str, Transform, int | None], ...]
"""Name, transform and test of each slot."""


@dataclass(frozen=True)
class ParameterSet:
    """All parameters of a model over several tests, and their order in the vector of scores."""

    tests: tuple[str, ...]  # Names of the tests.
    by_test: tuple[Mapping[str, Parameter], ...]  # The parameters as each test sees them, by name.
    slots: tuple[Slot, ...]  # The free ones, in order.

    @property
    def num_free(self) -> int:
        """Length of the vector of scores."""
        return len(self.slots)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the slots."""
        return tuple(slot.name for slot in self.slots)

    def index(self, name: str) -> int:
        """Return the position of a slot by name."""
        return self.names.index(name)

    @property
    def form(self) -> Form:
        """What stands in which slot, without numbers: hashable, so that it keys a compilation."""
        return tuple((s.parameter.name, s.parameter.transform, s.test) for s in self.slots)

    def priors(self) -> Priors:
        """Return the numbers: centres, standard deviations, and fixed values."""
        from .problem import Priors

        return Priors.of(self)

    def physical(self, z: np.ndarray) -> dict[str, np.ndarray]:
        """Return values by slot name; `z` has shape (..., parameter)."""
        return {
            slot.name: np.asarray(slot.parameter.value(z[..., position]))
            for position, slot in enumerate(self.slots)
        }


def collect(tests: Sequence[str], by_test: Sequence[Mapping[str, Parameter]]) -> ParameterSet:
    """Order the free parameters into one vector: shared ones first, then test by test.

    Args:
        tests: Names of the tests.
        by_test: Parameters of each test by name; those not `per_test` must be equal in all.
    """
    first = by_test[0]
    slots = [
        Slot(parameter, None, name)
        for name, parameter in first.items()
        if parameter.fixed is None and not parameter.per_test
    ]
    for index, test in enumerate(tests):
        slots += [
            Slot(parameter, index, f"{name}[{test}]")
            for name, parameter in by_test[index].items()
            if parameter.fixed is None and parameter.per_test
        ]
    return ParameterSet(tuple(tests), tuple(dict(each) for each in by_test), tuple(slots))


def override(parameters: Sequence[Parameter], motor: Motor) -> dict[str, Parameter]:
    """Return the parameters by name with what the motor file says of them.

    Raises:
        InputError: If a prior is given in a way that the parameter does not take.
    """
    result = {}
    for parameter in parameters:
        said = motor.parameters.get(parameter.name)
        result[parameter.name] = parameter if said is None else _override(parameter, said, motor)
    return result


def check_names(known: Sequence[str], motor: Motor) -> None:
    """Refuse an override of a parameter that no model has.

    Raises:
        InputError: If the motor file names an unknown parameter.
    """
    for name in motor.parameters:
        if name not in known:
            raise InputError(
                f"[parameters.{name}] names no parameter; there are {', '.join(known)}.",
                where=motor.path or motor.name,
                remedy=did_you_mean(name, known),
            )


def _refuse_implausible(parameter: Parameter, said: ParameterOverride, where: str) -> None:
    if parameter.name in UNITS:
        limits = RANGES[UNITS[parameter.name]]
    else:  # of an effect
        is_log = parameter.transform == "log"
        limits = limits_around(parameter.centre, parameter.sd, is_log=is_log)
    refuse_implausible(parameter.name, said, parameter.unit, limits, where)


def _override(parameter: Parameter, said: ParameterOverride, motor: Motor) -> Parameter:
    where = f"{motor.path or motor.name}, [parameters.{parameter.name}]"
    is_log = parameter.transform == "log"
    for label, number in (("fixed", said.fixed), ("value", said.value)):
        if is_log and number is not None and number <= 0:
            raise InputError(
                f"{label} = {number:g} {parameter.unit} where a positive value is expected",
                where=where,
                remedy="Correct it or leave it out.",
            )
    if said.relative_sd is not None and not is_log:
        raise InputError(
            f"relative_sd has no meaning for {parameter.name}, which may be zero",
            where=where,
            remedy=f"Give sd in {parameter.unit}.",
        )
    _refuse_implausible(parameter, said, where)
    centre = parameter.centre if said.value is None else said.value
    sd = parameter.sd
    if said.sd is not None:
        sd = math.log1p(said.sd / centre) if is_log else said.sd
    if said.relative_sd is not None:
        sd = math.log1p(said.relative_sd)
    stated = said.value is not None or said.sd is not None or said.relative_sd is not None
    return replace(
        parameter,
        fixed=said.fixed,
        centre=centre,
        sd=sd,
        per_test=parameter.per_test if said.per_test is None else said.per_test,
        basis="stated in the motor file" if stated else parameter.basis,
    )


WIDE = 4.0
"""A shape parameter whose range spans more than this factor is carried as a logarithm [1]."""

EVENT = "event"
"""Family of the effects that happen once, at their own time in each test."""

EXTRA_NODE = "extra node"
"""Family of the effects whose times are those of bodies; other times are those of sensors."""


FASTEST_S = 5.0
"""Time constant below which no body is sought [s]: the steps of a record do not resolve it, and a
simulation with them would not be stable."""


class Size(NamedTuple):
    """The size of a machine, as far as effects go with it."""

    capacity: float  # Heat capacity of the whole machine as one node [J/K].
    resistance: float  # Its resistance to the sink [K/W].
    speed: float  # Rated speed [rad/s].


CATALOGUE = Size(capacity=10e3, resistance=0.18, speed=600.0)
"""The machine that the catalogue's sizes are usual in, as the heat balance of its tests has it."""


def qualified(kind: type[AbstractEffect], name: str) -> str:
    """Return the name of an effect's parameter among all, such as `"speed_cooling.g"`."""
    return f"{kind.card.id}.{name}"


def effect_names(effects: Sequence[type[AbstractEffect]] = ()) -> tuple[str, ...]:
    """Return the qualified names of the catalogue's parameters and of further effects'."""
    from lptn import EFFECTS

    kinds = dict.fromkeys([*EFFECTS, *effects])
    return tuple(qualified(kind, name) for kind in kinds for name in kind.card.parameters)


def amplitudes(kind: type[AbstractEffect]) -> tuple[str, ...]:
    """Return the names of the parameters whose null value makes the effect vanish."""
    return tuple(n for n, q in kind.card.parameters.items() if q.null is not None)


def null_values(effects: Sequence[type[AbstractEffect]]) -> dict[str, float]:
    """Return the values of amplitudes at which effects vanish, by qualified name [their units]."""
    return {
        qualified(kind, name): quantity.null
        for kind in effects
        for name, quantity in kind.card.parameters.items()
        if quantity.null is not None
    }


def effect_parameters(
    effects: Sequence[type[AbstractEffect]],
    duration_s: float,
    searched: Sequence[type[AbstractEffect]] = (),
    size: Size = CATALOGUE,
) -> list[Parameter]:
    """Return the parameters of effects for one test.

    An effect that is searched may be absent: the score 0 of its amplitude is the null value, so
    that a vector of zeros leaves the network as it was. One that is known to be there has a
    log-normal amplitude around its typical value where it cannot change sign. The physical range
    is four prior standard deviations wide for a shape parameter, and reaches to two of them for
    an amplitude.

    Args:
        effects: In order.
        duration_s: Length of the test, which bounds when an event can happen [s].
        searched: Those of them that may be absent; the others are known.
        size: Of the machine.
    """
    result = []
    for kind in effects:
        is_searched = kind in searched
        for name, of_catalogue in kind.card.parameters.items():
            quantity = sized(kind, of_catalogue, size)
            unit = "" if quantity.unit == "1" else f" {quantity.unit}"
            transform, centre, sd = _prior(kind, quantity, duration_s, is_searched=is_searched)
            result.append(
                Parameter(
                    qualified(kind, name), quantity.unit, quantity.meaning,
                    "effect" if is_searched else "known",
                    transform, centre, sd,
                    f"plausible from {quantity.low:.3g} to {quantity.high:.3g}{unit}",
                    per_test=kind.card.family == EVENT, limit=quantity.limit,
                )
            )  # fmt: skip
    return result


def sized(kind: type[AbstractEffect], quantity: Quantity, size: Size) -> Quantity:
    """Return a quantity as it is usual in a machine of a size.

    The catalogue gives sizes as they are usual in one machine, of some ten kilowatts. A body beside
    a drone's motor weighs grams, one beside a ship's weighs tons, and both are ordinary. So a
    quantity with a dimension goes with the machine: heat capacities, conductances and what follows
    from them.
    """
    capacity = size.capacity / CATALOGUE.capacity
    resistance = size.resistance / CATALOGUE.resistance
    factor = {
        "J/K": capacity,
        "K/W": resistance,
        "W": 1.0 / resistance,  # at one rise
        "m^2": 1.0 / resistance,
        "N m": CATALOGUE.speed / (resistance * size.speed),
        "s": capacity * resistance if kind.card.family == EXTRA_NODE else 1.0,
    }.get(quantity.unit, 1.0)
    low, high, typical = (factor * each for each in (quantity.low, quantity.high, quantity.typical))
    if quantity.unit == "s" and kind.card.family == EXTRA_NODE:
        low = max(low, FASTEST_S)
        high = max(high, 10.0 * low)
        typical = min(max(typical, low), high)
    return quantity._replace(low=low, high=high, typical=typical)


def _prior(
    kind: type[AbstractEffect], quantity: Quantity, duration_s: float, *, is_searched: bool
) -> tuple[Transform, float, float]:
    """Return transform, centre and standard deviation of a prior."""
    low, high = quantity.low, quantity.high
    has_one_sign = quantity.null is not None and quantity.null <= low and quantity.null == 0.0
    if not is_searched and has_one_sign and quantity.typical > 0.0:
        return "log", quantity.typical, max(0.5 * math.log(high / quantity.typical), 0.5)
    if not is_searched and quantity.null is not None and quantity.null > 0.0:
        return "log", quantity.null, 0.5 * math.log(high / quantity.null)
    if quantity.null is not None:
        reach = max(high - quantity.null, quantity.null - low)
        return "linear", quantity.null, 0.5 * reach
    if kind.card.family == EVENT and quantity.unit == "s":
        return "linear", 0.5 * duration_s, 0.25 * duration_s
    if low > 0.0 and high / low > WIDE:
        return "log", math.sqrt(low * high), 0.25 * math.log(high / low)
    return "linear", 0.5 * (low + high), 0.25 * (high - low)
