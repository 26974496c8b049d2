"""Errors of a balance of powers that the inputs of a test show without any temperature.

Losses from a balance are a small difference of two large powers. Where one of them reads too much,
the error is a share of the mechanical power and changes its sign with it: the machine seems to lose
more as a motor than at the same current and speed as a generator, or the reverse. What a wrong zero
of the torque adds changes its sign with the direction of rotation, and can be read off while the
machine stands without current; so can an offset of the powers.

What contradicts the prior of such an error is the test's own: fit, posterior and prediction take it
in place of that prior, in this test alone (`heatrun.model.bodies.own_errors`). The instruments of
the tests are the same, though: what several tests tell of one is held against each other
(`together`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .derive import ELECTRICAL, RAD_PER_S_PER_RPM, recorded_shaft_power
from .motor import Motor, ParameterOverride
from .record import Finding, Record
from .samples import block_means, place, runs, samples, sink_channel

BLOCK_S = 10.0
"""A balance is the small difference of two large powers: its noise is judged as means over 10 s."""

STANDSTILL_RPM = 1.0
"""At standstill all losses are copper losses, so that a share of one is right."""

SHAFT_GAIN_SD = 0.01
"""Prior of `shaft_power_gain` [1], where the motor file gives no other."""

SHAFT_OFFSET_SHARE = 1e-3
"""Prior of an offset of mechanical power or torque, in parts of the largest one [1]."""

BEYOND = 2.0
"""Standard deviations that a prior allows for [1]."""

SIGMAS = 3.0
"""Standard deviations from which an error is no matter of scatter [1]."""

LEAST_SHARE = 0.05
"""Share of the blocks that each direction of power or rotation needs [1]."""

LEAST_POWER = 0.2
"""In parts of the largest power [1]: blocks below say nothing of its scale."""

LARGEST_GAIN = 0.3
"""A scale that is off by more than this [1] is no transducer's: a unit or a column is wrong."""

LEAST_APART = 1e-3
"""Mean square of the power that current and speed leave, in parts of its own [1]: else they tell
it."""

OPPOSED = 0.9
"""Share of the loaded blocks [1] in which both powers flow in where one has the wrong sign."""

EXPLAINED = 0.5
"""Part of the scatter that the error must explain [1]: losses that current and speed do not tell,
such as those in field weakening, may go with it by chance."""

NUM_PARTS = 10
"""Parts of a record that are left out in turn: what current and speed leave of the losses is no
noise, and neighbouring blocks have it in common."""

ALIKE = 0.02
"""Losses of both directions at one current and speed, for all that is known [1]: the winding is 5 K
warmer in one of them, or the flux another."""

WARM_K, RESISTANCE_SHARE = 50.0, 0.25
"""A winding of which nothing is known, above its sink [K], and how far its resistance may be off
[1]."""

STICTION_SHARE = 0.001
"""Torque that friction and cogging may hold at a stop, in parts of the largest one [1]."""

CHANGES, EXACT = 0.2, 0.01
"""What an instrument's error changes from test to test at least, and how well a test tells it at
most, in parts of its prior [1]."""

UNITS = {"shaft_power_gain": "", "shaft_power_offset": " W", "torque_offset": " N m"}


Blocks = Float[np.ndarray, " block"]


class Told(NamedTuple):
    """An error of the balance, as the inputs of one test tell it."""

    name: str  # The parameter that stands for it.
    mean: float  # Its estimate [unit of the parameter].
    sd: float  # Standard deviation of the estimate [likewise].
    usual: float  # Standard deviation of its prior before any test is looked at [likewise].
    seen: str  # What shows it, a sentence.


def together(tests: Sequence[Sequence[Told]]) -> list[tuple[Told, ...]]:
    """Return what the inputs of several tests tell of their instruments, held against each other.

    An error that several tests tell is one error with a change from test to test. How large that
    is, follows from how far the tests differ; it is a fifth of the usual error at least, since a
    zero drifts with temperature.

    Reference: R. DerSimonian, N. Laird, Meta-analysis in clinical trials, Controlled Clinical
        Trials 7 (1986) 177-188.
    """
    found = [list(test) for test in tests]
    for name in {told.name for test in tests for told in test}:
        places = [(i, j) for i, test in enumerate(tests) for j, told in enumerate(test)
                  if told.name == name]  # fmt: skip
        told = [tests[i][j] for i, j in places]
        mean, own = np.array([(one.mean, one.sd**2) for one in told]).T
        own = np.maximum(own, (EXACT * told[0].usual) ** 2)
        weight = 1.0 / own
        spread = weight @ (mean - weight @ mean / weight.sum()) ** 2 - (mean.size - 1)
        room = weight.sum() - weight @ weight / weight.sum()
        change = max(spread / room if mean.size > 1 else 0.0, (CHANGES * told[0].usual) ** 2)
        weight = 1.0 / (own + change)
        shared = weight @ mean / weight.sum()
        share = change * weight
        variance = share * own + (1.0 - share) ** 2 / weight.sum()
        for (i, j), part, sd in zip(places, share, np.sqrt(variance), strict=True):
            one = found[i][j]
            found[i][j] = one._replace(mean=float(part * one.mean + (1.0 - part) * shared),
                                       sd=float(sd))  # fmt: skip
    return [tuple(test) for test in found]


class Prior(NamedTuple):
    """Centre and standard deviation of an error before a test is looked at, in its unit."""

    centre: float
    sd: float
    is_fixed: bool = False


def prior_of(motor: Motor, name: str, sd: float) -> Prior:
    """Return the prior of an error; where the motor file says none, of this standard deviation."""
    said = motor.parameters.get(name, ParameterOverride())
    if said.fixed is not None:
        return Prior(said.fixed, 0.0, is_fixed=True)
    return Prior(said.value or 0.0, sd if said.sd is None else said.sd)


def own_errors(record: Record, motor: Motor) -> tuple[Told, ...]:
    """Return a test's own errors: told by its inputs and not held by the motor file."""
    told = told_by_inputs(record, motor)
    return tuple(each for each in told if not prior_of(motor, each.name, 0.0).is_fixed)


def with_shaft(record: Record, motor: Motor) -> Record:
    """Return a record of a balance with what it tells of the mechanical power as a channel, itself
    where that is nothing.
    """
    shaft = recorded_shaft_power(record.channels) if motor.losses == "balance" else None
    return record if shaft is None else record.having({"mechanical_power_W": shaft})


def told_by_inputs(record: Record, motor: Motor) -> tuple[Told, ...]:
    """Return the errors of the balance that contradict their priors; no winding reading is used.

    Needs current, speed, losses from a balance, torque or mechanical power.
    """
    whole = with_shaft(record, motor)
    names = ("phase_current_A", "speed_rpm", "losses_W", "mechanical_power_W")
    time_s, current, speed, losses, power = samples(whole, *names)
    if whole is record or time_s.size < 2:
        return ()
    speed = speed * RAD_PER_S_PER_RPM
    _, *means = block_means(time_s, BLOCK_S, current**2, np.abs(speed), losses, power, speed)
    largest_W = float(np.max(np.abs(means[3])))
    fastest = max(float(np.max(means[1])), STANDSTILL_RPM * RAD_PER_S_PER_RPM)
    usual = {
        "shaft_power_gain": SHAFT_GAIN_SD,
        "shaft_power_offset": SHAFT_OFFSET_SHARE * largest_W,
        "torque_offset": SHAFT_OFFSET_SHARE * largest_W / fastest,
    }
    found: dict[str, Told] = {}
    for told in (*_by_direction(*means), *_at_rest(whole, motor)):
        prior = prior_of(motor, told.name, usual[told.name])
        allowed = BEYOND * (usual[told.name] if prior.is_fixed else prior.sd)
        is_scale = told.name != "shaft_power_gain" or abs(told.mean) < LARGEST_GAIN
        if is_scale and abs(told.mean - prior.centre) > max(allowed, SIGMAS * told.sd):
            found.setdefault(told.name, told._replace(usual=usual[told.name]))
    return tuple(found.values())


def shaft_power_disagrees(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report errors of torque and powers that contradict their priors, and what is done about them.

    Needs losses from a balance, current, speed, torque or mechanical power, and a load in both
    directions, rotation in both directions, or a standstill without current. Where electrical and
    mechanical power both flow in, one of them has the wrong sign: an error, for nothing else tells.
    """
    if motor.losses == "balance" and (reversed_sign := _reversed_sign(record, motor)) is not None:
        return (reversed_sign,)
    return tuple(_finding(record, motor, told) for told in told_by_inputs(record, motor))


def _reversed_sign(record: Record, motor: Motor) -> Finding | None:
    """Return the finding that both powers, whose difference the losses are, flow in under load."""
    shaft = recorded_shaft_power(record.channels)
    way = next((one for one in ELECTRICAL if one.is_open(record.channels)), None)
    if shaft is None or way is None or any(one.channel == "losses_W" for one in record.mapping):
        return None
    electrical = np.asarray(way.compute(record.channels, motor.phases), dtype=float)
    powers = Record("", {"time_s": record.time_s, "electrical": electrical, "shaft": shaft})
    time_s, *columns = samples(powers, "electrical", "shaft")
    if time_s.size < 2:
        return None
    means_s, electrical, shaft = block_means(time_s, BLOCK_S, *columns)
    loaded = np.abs(electrical) > LEAST_POWER * np.max(np.abs(electrical))
    loaded &= np.abs(shaft) > LEAST_POWER * np.abs(electrical)
    opposed = loaded & (electrical * shaft < 0.0)
    if np.mean(loaded) < LEAST_SHARE:
        return None
    is_always = np.sum(opposed) >= OPPOSED * np.sum(loaded)
    first, past = runs(opposed)
    at = int(np.argmax(past - first)) if first.size else 0
    if not is_always and (not first.size or past[at] - first[at] < LEAST_SHARE * np.sum(loaded)):
        return None
    whole = tuple(map(float, record.time_s[[0, -1]]))
    from_s, to_s = whole if is_always else (float(means_s[first[at]]), float(means_s[past[at] - 1]))
    return Finding(
        "shaft_power_disagrees",
        "error",
        "Electrical and mechanical power both flow into the machine under load: torque, speed or "
        "electrical power has the wrong sign, and the losses are the sum of the two powers.",
        place(record, "losses_W", from_s, to_s),
        "Export them so that power and torque times speed are positive where the machine drives.",
        values={"shaft_power_gain": -2.0, "from_s": from_s, "to_s": to_s},
    )


def _finding(record: Record, motor: Motor, told: Told) -> Finding:
    prior = prior_of(motor, told.name, 0.0)
    key, unit = f"[parameters.{told.name}]", UNITS[told.name]
    if prior.is_fixed:
        taken = f" The motor file holds {told.name} at {prior.centre:.3g}{unit} all the same."
        remedy = f"Without fixed in {key}, this test would take it from its inputs."
    else:
        taken = (
            f" This test takes {told.name} = {told.mean:.3g} ± {told.sd:.1g}{unit} from its inputs,"
            " for itself alone; no temperature is used."
        )
        remedy = (
            f"To take the signals as they are, write fixed = 0 into {key}; for one value of all "
            f"tests, from their temperatures, sd = {abs(told.mean):.1g}."
        )
    return Finding(
        "shaft_power_disagrees",
        "warning",
        told.seen + taken,
        place(record, "losses_W", *map(float, record.time_s[[0, -1]])),
        f"Check gain and zero of the torque transducer and of the power meter. {remedy}",
        values={told.name: told.mean, "sd": told.sd},
    )


def _by_direction(
    squared: Blocks, magnitude: Blocks, losses: Blocks, power: Blocks, speed: Blocks
) -> Iterator[Told]:
    """Yield what goes with the sign of power or speed in the losses.

    They are laid out over current squared, speed, speed squared, their product, and what has both
    signs.
    """
    signed = {"shaft_power_gain": power, "torque_offset": speed}
    ways = {
        name: [float(np.mean(s * v > LEAST_POWER * np.max(np.abs(v)))) for s in (1.0, -1.0)]
        for name, v in signed.items()
    }
    names = [name for name, shares in ways.items() if min(shares) >= LEAST_SHARE]
    if not names or speed.size < 2 * NUM_PARTS:
        return
    known = [np.ones(speed.size), squared, magnitude, magnitude**2, squared * magnitude]
    columns = np.stack([*known, *(signed[name] for name in names)], axis=1)
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    columns = columns / scale
    weights, spread = (each / scale for each in _by_parts(columns, losses))
    spread = np.hypot(spread, ALIKE * np.sqrt(np.mean(losses**2)) / scale)
    left = _square(columns, losses)
    for at, name in enumerate(names, len(known)):
        others = np.delete(columns, at, axis=1)
        is_apart = _square(others, columns[:, at]) > LEAST_APART * speed.size
        # else current and speed tell the sign
        if is_apart and left < (1.0 - EXPLAINED) * _square(others, losses):
            error = float(weights[at])
            yield Told(name, error, float(spread[at]), math.nan, _words(name, error))


def excess_of_shaft(record: Record, motor: Motor) -> float | None:
    """Return the share of the mechanical power [1] that losses from a balance hold beside those of
    the machine, where it is more than any transducer's error; None where it is not, or not told.

    Losses of a machine go with the square of its current; what goes with the power itself is of
    torque and electrical power on two scales.
    """
    whole = with_shaft(record, motor)
    if whole is record or any(one.channel == "losses_W" for one in record.mapping):
        return None
    names = ("phase_current_A", "speed_rpm", "losses_W", "mechanical_power_W", "winding_degC")
    time_s, current, speed, losses, power, winding = samples(whole, *names)
    if time_s.size < 2:
        return None
    squared = current**2 * (motor.resistance_coefficient_degC + winding)
    _, squared, speed, losses, power = block_means(
        time_s, BLOCK_S, squared, np.abs(speed), losses, np.abs(power)
    )
    known = np.stack([np.ones(speed.size), squared, speed, speed**2], axis=1)
    told = told_beside(known, power, losses)
    return told[0] if told is not None and told[0] - SIGMAS * told[1] > LARGEST_GAIN else None


def told_beside(
    known: Float[np.ndarray, "block column"], column: Blocks, values: Blocks
) -> tuple[float, float] | None:
    """Return the weight of a column in values beside what is known, and its spread without each
    part of the test; None where the known columns tell this one.
    """
    columns = np.column_stack([known, column])
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    columns = columns / scale
    if column.size < 2 * NUM_PARTS:
        return None
    if _square(columns[:, :-1], columns[:, -1]) < LEAST_APART * column.size:
        return None
    weight, spread = (float(each[-1] / scale[-1]) for each in _by_parts(columns, values))
    return weight, spread


def _words(name: str, error: float) -> str:
    if name == "torque_offset":
        return (
            "Expected about the same losses in both directions of rotation; they differ as if the "
            f"torque read {abs(error):.2g} N m too {'little' if error > 0.0 else 'much'} in both."
        )
    return (
        "Expected about the same losses as a motor and as a generator at the same current and "
        f"speed; they differ by {100.0 * abs(error):.2g} % of the mechanical power to each side, "
        f"more as a {'motor' if error > 0.0 else 'generator'}: torque and electrical power do not "
        "have one scale."
    )


def _by_parts(columns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of columns in values, and their spread without each part of the test."""
    every = np.arange(values.size)
    all_but = [np.setdiff1d(every, part) for part in np.array_split(every, NUM_PARTS)]
    weights, *without = (_weights(columns[r], values[r]) for r in (every, *all_but))
    return weights, np.sqrt(NUM_PARTS - 1.0) * np.std(without, axis=0)


def _weights(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(columns, values, rcond=None)[0]


def _square(columns: np.ndarray, values: np.ndarray) -> float:
    """Return the sum of squares that columns leave of values."""
    return float(np.sum((values - columns @ _weights(columns, values)) ** 2))


def _at_rest(record: Record, motor: Motor) -> Iterator[Told]:
    """Yield what losses and torque read while the machine stands without current."""
    names = ["phase_current_A", "speed_rpm", "losses_W", "mechanical_power_W", sink_channel(motor)]
    names += ["torque_Nm"] * ("torque_Nm" in record)
    time_s, current, speed, losses, power, sink_degC, *torque = samples(record, *names)
    if time_s.size < 2 or motor.phase_resistance_ohm is None:
        return
    copper = motor.copper_loss_W(current, sink_degC + WARM_K)
    _, magnitude, copper, losses, power, *torque = block_means(
        time_s, BLOCK_S, np.abs(speed), copper, losses, power, *torque
    )
    unknown_W = RESISTANCE_SHARE * copper
    is_idle = unknown_W < SHAFT_OFFSET_SHARE * np.max(np.abs(power))
    # the blocks at either end of a stop may hold a part of what came before or after
    stops = [
        np.arange(first + 1, past - 1)
        for first, past in zip(*runs((magnitude < STANDSTILL_RPM) & is_idle), strict=True)
        if past - first > 3
    ]
    if not stops:
        return

    def read(values: np.ndarray, unknown: float) -> tuple[float, float]:
        means = [float(np.mean(values[stop])) for stop in stops]
        scatter = float(np.std(values[np.concatenate(stops)]))
        return float(np.mean(means)), float(np.hypot(scatter, unknown) / np.sqrt(len(stops)))

    mean, sd = read(losses - copper, float(np.max(unknown_W[np.concatenate(stops)])))
    seen = f"Expected no losses at standstill without current; they read {mean:.3g} W."
    yield Told("shaft_power_offset", mean, sd, math.nan, seen)
    for values in torque:
        mean, sd = read(values, STICTION_SHARE * float(np.max(np.abs(values))))
        seen = f"Expected no torque at standstill without current; it reads {mean:.2g} N m."
        yield Told("torque_offset", -mean, sd, math.nan, seen)
