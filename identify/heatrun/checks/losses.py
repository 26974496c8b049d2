"""Can the losses be what the record says, given its current, phase resistance, torque and speed?"""

import math
from collections.abc import Iterator

import numpy as np

from ..io.quantities import part_of
from ..record.balance_errors import (
    BEYOND,
    BLOCK_S,
    LEAST_POWER,
    SHAFT_GAIN_SD,
    SIGMAS,
    STANDSTILL_RPM,
    excess_of_shaft,
    own_errors,
    prior_of,
    told_beside,
    with_shaft,
)
from ..record.derive import RAD_PER_S_PER_RPM, recorded_shaft_power
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import block_means, is_loaded, place, runs, samples
from .course import warming

COPPER_TOLERANCE = 0.03
"""Power and current instruments of a bench, and Rs0, are together good to about 3 % [1]."""

FIRM_TOLERANCE = 2.0 * COPPER_TOLERANCE
"""What lies beyond is no matter of instruments [1]. A coil under direct current, whose losses are
its copper's, lies 3 % below in one case of twenty."""

SUSTAINED_S = 30.0
"""What lasts 30 s is no transient: the rotor's kinetic energy passes in seconds."""

MOST = 0.5
"""Share of the loaded time [1] from which a fault is the state of the record, not an event in
it."""

FAR_ABOVE, OFTEN = 1.25, 0.1
"""Copper loss over the total [1], and share of the loaded time [1]: no transient, tolerance of a
resistance or torque sensor lasts so long and reaches so far."""

NEGATIVE_SHARE = 0.03
"""Losses below minus this share of their peak are no offset of the instruments [1]."""

NOISE_SIGMAS = 6.0
"""Gaussian noise exceeds six standard deviations once in 5e8 samples."""

EXPLAINED = 0.9
"""Part of the blocks [1] in which an explanation must hold."""

EXPLANATIONS = (
    (2.1, "whether phase_current_A is an amplitude (factor 2 in the copper loss; then "
     'phase_current_A = "COLUMN [A_peak]" in [columns])'),
    (2.1, "whether phase_resistance_ohm was measured between terminals (factor 2 in star, 2/3 in "
     "delta)"),
    (3.1, "whether phases is right (1 for a coil)"),
    (4.2, "whether the clamp reads right (factor 4 for two turns through it)"),
    (math.inf, "whether the losses are complete"),
)  # fmt: skip
"""Copper loss over the losses that each explains at most [1]."""

AMPLITUDE_SQUARED = 2.0
"""The square of amplitude over rms of a sine [1]."""


def _copper_and_total(record: Record, motor: Motor) -> tuple[np.ndarray, ...]:
    """Block times, copper loss from the declared current and measured total; empty if not known."""
    nothing = (np.empty(0),) * 3
    if motor.losses != "balance" or motor.phase_resistance_ohm is None:
        return nothing
    time_s, current, losses, winding = samples(
        record, "phase_current_A", "losses_W", "winding_degC"
    )
    if time_s.size == 0:
        return nothing
    return block_means(time_s, BLOCK_S, motor.copper_loss_W(current, winding), losses)


def copper_shares(record: Record, motor: Motor) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] of blocks under current and copper's share in them [1], shape (blocks,).

    Infinite where the total is zero or less; empty without a balance or a resistance.
    """
    time_s, copper, total = _copper_and_total(record, motor)
    flows = is_loaded(copper)
    copper, total = copper[flows], total[flows]
    share = np.full(total.size, np.inf)
    np.divide(copper, total, out=share, where=total > 0.0)
    return time_s[flows], share


def heat_of_current(record: Record, motor: Motor) -> float | None:
    """Return what of the losses goes with the square of the current, over the copper loss [1], at
    least; None where speed and current do not tell it apart from what else is lost.
    """
    if motor.losses != "balance" or motor.phase_resistance_ohm is None:
        return None
    turns = motor.phases > 1
    names = ("phase_current_A", "losses_W", "winding_degC", *("speed_rpm",) * turns)
    time_s, current, losses, winding, *speed = samples(record, *names)
    if time_s.size < 2:
        return None
    copper = motor.copper_loss_W(current, winding)
    _, copper, losses, *speed = block_means(time_s, BLOCK_S, copper, losses, *map(np.abs, speed))
    known = np.stack([np.ones(copper.size), *speed, *(each**2 for each in speed)], axis=1)
    told = told_beside(known, copper, losses)
    return None if told is None else told[0] - SIGMAS * told[1]


def share_in_words(copper_share: float) -> str:
    """Return what the losses are of a copper loss of this share in them [1], in words."""
    return "zero or less" if np.isinf(copper_share) else part_of(1.0 / copper_share, "it")


def losses_below_copper(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a measured total that is less than the copper loss alone.

    Needs `phase_resistance_ohm` and losses that are a balance. An error if it holds for most of the
    time under current by more than `FIRM_TOLERANCE`, or for a tenth of it by a quarter; a warning
    if for 30 s or more, or where the error that is allowed for the mechanical power
    (`shaft_power_gain`) explains it: a fit estimates that.
    """
    time_s, share = copper_shares(record, motor)
    below = share > 1.0 + COPPER_TOLERANCE
    first, past = runs(below)
    if first.size == 0:
        return
    is_most = float(np.mean(below)) > MOST
    longest = int(np.argmax(past - first))
    from_s, to_s = float(time_s[first[longest]]), float(time_s[past[longest] - 1])
    if not is_most and to_s - from_s + BLOCK_S < SUSTAINED_S:
        return
    typical = float(np.median(share[below]))
    is_far = float(np.mean(share > FAR_ABOVE)) > OFTEN
    is_firm = float(np.mean(share > 1.0 + FIRM_TOLERANCE)) > MOST
    is_explained = shaft_explains(record, motor)
    yield Finding(
        "losses_below_copper",
        "error" if (is_firm or is_far) and not is_explained else "warning",
        f"Expected losses above the copper loss; in {100.0 * np.mean(below):.0f} % of the time "
        f"under current they are {share_in_words(typical)}. Every thermal resistance and "
        "capacity would be biased.",
        place(record, "losses_W", from_s, to_s),
        f"Check {', '.join(text for most, text in EXPLANATIONS if most >= typical)}, and whether "
        "torque and power have one scale ([parameters.shaft_power_gain] sd says how far they may "
        "differ).",
        values={
            "share_of_time": float(np.mean(below)),
            "copper_share": typical,
            "from_s": from_s,
            "to_s": to_s,
        },
    )


def shaft_explains(record: Record, motor: Motor) -> bool:
    """Return whether the error allowed for the mechanical power explains losses below copper's."""
    _, copper, total = _copper_and_total(record, motor)
    allowed = _shaft_error_W(record, motor, "phase_current_A", "losses_W", "winding_degC")
    if allowed.size != total.size:  # the mechanical power is missing where the losses are not
        return False
    gap = copper - total
    is_below = gap > COPPER_TOLERANCE * total
    return _holds(gap[is_below] <= allowed[is_below])


def _shaft_error_W(record: Record, motor: Motor, *beside: str) -> np.ndarray:
    """Return the error of the mechanical power that a fit allows for [W], empty without a shaft.

    It is in the blocks in which the channels `beside` are known.
    """
    shaft = recorded_shaft_power(record.channels)
    if shaft is None:
        return np.empty(0)
    prior = prior_of(motor, "shaft_power_gain", SHAFT_GAIN_SD)
    allowed = {"shaft_power_gain": abs(prior.centre) + BEYOND * prior.sd}
    allowed |= {own.name: abs(own.mean) + BEYOND * own.sd for own in own_errors(record, motor)}
    error = allowed["shaft_power_gain"] * np.abs(shaft) + allowed.get("shaft_power_offset", 0.0)
    if "torque_offset" in allowed:
        error += allowed["torque_offset"] * RAD_PER_S_PER_RPM * np.abs(record["speed_rpm"])
    allowing = record.having({"mechanical_power_W": error})
    time_s, error, *_ = samples(allowing, "mechanical_power_W", *beside)
    return block_means(time_s, BLOCK_S, error)[1]


def _holds(explained: np.ndarray) -> bool:
    """Return whether an explanation holds in nearly all blocks that ask for one."""
    return explained.size > 0 and float(np.mean(explained)) > EXPLAINED


def current_amplitude(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a current that looks like an amplitude where rms is expected.

    With an amplitude the copper loss comes out twice too large. Where it then exceeds the measured
    total, `losses_below_copper` says so; here it leaves next to nothing of it in a machine that
    turns, or may do so.
    """
    time_s, share = copper_shares(record, motor)
    if share.size < 3 or any(losses_below_copper(record, motor)):
        return
    typical = float(np.median(share))
    speed_s, speed = samples(record, "speed_rpm")
    turns = speed_s.size > 0 and float(np.median(np.abs(speed))) > STANDSTILL_RPM
    if typical <= 1.0 - COPPER_TOLERANCE or (speed_s.size > 0 and not turns):
        return
    yield Finding(
        "current_amplitude",
        "warning" if turns else "note",
        "Expected rms values; read as rms, the copper loss is "
        f"{part_of(typical, 'the losses')}; read as amplitudes, "
        f"{part_of(typical / AMPLITUDE_SQUARED, 'them')}. A wrong reading doubles the copper "
        "loss.",
        place(record, "phase_current_A", float(time_s[0]), float(time_s[-1])),
        'If the column holds amplitudes, say so in [columns]: phase_current_A = "COLUMN [A_peak]".',
        values={"copper_share": typical, "copper_share_halved": typical / AMPLITUDE_SQUARED},
    )


def losses_negative(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report losses below zero: an error if sustained for 30 s, a warning if isolated.

    A warning too where the error that is allowed for the mechanical power (`shaft_power_gain`)
    explains what is sustained: a fit estimates that.

    Noise about zero at rest is no finding: samples count below minus six standard deviations, means
    over 10 s below minus 3 % of the peak.
    """
    time_s, losses = samples(record, "losses_W")
    if time_s.size < 3:
        return
    means_s, means = block_means(time_s, BLOCK_S, losses)
    peak = float(np.quantile(np.abs(losses), 0.99))
    floor = -NEGATIVE_SHARE * peak
    # The noise of one sample from the changes between neighbours, which carry it twice.
    noise = 1.4826 * float(np.median(np.abs(np.diff(losses)))) / np.sqrt(2.0)
    is_negative = means < floor
    first, past = runs(is_negative)
    lasts_s = means_s[past - 1] - means_s[first] + BLOCK_S
    isolated = losses < min(floor, -NOISE_SIGMAS * noise)
    if first.size and lasts_s.max() >= SUSTAINED_S:
        longest = int(np.argmax(lasts_s))
        from_s, to_s = means_s[first[longest]], means_s[past[longest] - 1]
        allowed = _shaft_error_W(record, motor, "losses_W")
        is_allowed = allowed.size == means.size and motor.losses == "balance"
        is_explained = is_allowed and _holds(-means[is_negative] <= allowed[is_negative])
        severity = "warning" if is_explained else "error"
    elif isolated.any() or first.size:
        at = time_s[isolated] if isolated.any() else means_s[is_negative]
        severity, from_s, to_s = "warning", at[0], at[-1]
    else:
        return
    lowest = float(losses.min())
    yield Finding(
        "losses_negative",
        severity,
        f"Expected losses of at least 0 W; {int(np.sum(losses < floor))} samples are "
        f"negative, down to {lowest:.3g} W. Negative losses would cool the model.",
        place(record, "losses_W", float(from_s), float(to_s)),
        "Check the signs of electrical and mechanical power, braking, and zero and gain "
        "of the torque ([parameters.shaft_power_gain] sd says how far it may be off).",
        values={
            "lowest_W": lowest,
            "num_samples": float(np.sum(losses < floor)),
            "from_s": float(from_s),
            "to_s": float(to_s),
        },
    )


LEAST_RATIO, MOST_RATIO = 0.97, 2.0
"""Losses over mechanical power [1] between which they may be the input power: an efficiency of 50 %
and more, and instruments of 3 %."""

SAME_POWER = 0.03
"""Losses that are the mechanical power itself agree with it to this share [1]."""

HOLDS = 0.9
"""Part of the loaded blocks in which it must be so [1]."""

SPREAD = 0.15
"""Standard deviation of the logarithm of that ratio [1]; losses of a machine go with its square."""

LEAST_COPPER = 0.15
"""Copper loss over the losses at the highest currents [1] below which these may be the input of a
machine whose shaft is not recorded: iron and friction make no six times of it there."""

MOST_COPPER = 0.5
"""Copper loss over such losses [1] above which they may be losses all the same."""


def losses_of_shaft(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report recorded losses that are nearly torque times speed.

    They are the input power, or the shaft's own. An error where the load varies and the copper
    loss is known to be a small part of them, else a warning: an efficiency may be below 50 %. A
    warning, too, of losses from a balance that hold a good part of the shaft's power.
    """
    if (excess := excess_of_shaft(record, motor)) is not None:
        yield _off_scale(record, excess)
        return
    whole = with_shaft(record, motor)
    reading = record.read_of("losses_W")
    if reading is None or reading.unit_from == "derived":
        return
    line = f'"{reading.column}" under [columns]'
    if whole is record:
        yield from _far_above_copper(record, motor, line)
        return
    time_s, losses, power = samples(whole, "losses_W", "mechanical_power_W")
    time_s, losses, power = block_means(time_s, BLOCK_S, losses, np.abs(power))
    is_driven = power > LEAST_POWER * np.max(power, initial=0.0)
    if np.sum(is_driven) < 6 or not np.all(losses[is_driven] > 0.0):
        return
    ratio = losses[is_driven] / power[is_driven]
    is_near = (ratio > LEAST_RATIO) & (ratio < MOST_RATIO)
    _, share = copper_shares(record, motor)
    copper = float(np.median(share)) if share.size else None
    if (
        float(np.mean(is_near)) < HOLDS
        or float(np.std(np.log(ratio))) > SPREAD
        or (copper is not None and copper > MOST_COPPER)
    ):
        return
    typical = float(np.median(ratio))
    is_output = float(np.quantile(np.abs(ratio - 1.0), HOLDS)) < SAME_POWER
    is_varied = float(np.ptp(power[is_driven])) > 0.3 * float(np.max(power))
    yield Finding(
        "losses_of_shaft",
        "error" if is_varied and copper is not None else "warning",
        f"Expected losses; losses_W is {typical:.3g} times torque·omega at every load: "
        + (
            "it is the power of the shaft."
            if is_output
            else f"it is the input power, at an efficiency of {100.0 / typical:.0f} %."
        ),
        place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
        f"Write mechanical_power_W = {line} in place of losses_W, and record the electrical "
        "power: the losses are the difference."
        if is_output
        else f"Write electrical_power_W = {line} in place of losses_W: the losses are then "
        "what the shaft does not take.",
        values={"ratio": typical, "is_output": float(is_output)},
    )


def _off_scale(record: Record, excess: float) -> Finding:
    return Finding(
        "losses_of_shaft",
        "warning",
        "Expected losses that go with the square of the current; beside these, losses_W holds "
        f"{100.0 * excess:.0f} % of the mechanical power: the electrical power reads "
        f"{1.0 + excess:.3g} times what it should, or the torque {1.0 / (1.0 + excess):.2g} of it.",
        place(record, "losses_W", *map(float, record.time_s[[0, -1]])),
        "Check the unit of the torque (0.74: pound-feet taken for N m), and the ratio of the "
        "current transformers. Where a gear or an inverter lies between the two, its losses are "
        "none of the machine's.",
        values={"excess": excess},
    )


def _far_above_copper(record: Record, motor: Motor, line: str) -> Iterator[Finding]:
    """Report losses beside which the copper loss is next to nothing at the highest current."""
    time_s, copper, total = _copper_and_total(record, motor)
    speed = samples(record, "speed_rpm")[1]
    rise_K, least_K, *_ = warming(record)
    stands = bool(speed.size and np.max(np.abs(speed)) < STANDSTILL_RPM)
    if time_s.size < 6 or stands or rise_K <= least_K:
        return
    is_high = copper > 0.8 * np.max(copper)
    share = copper[is_high] / np.maximum(total[is_high], 1e-12)
    if np.max(copper) <= 0.0 or np.median(share) > LEAST_COPPER or np.max(share) > MOST_COPPER:
        return
    yield Finding(
        "losses_of_shaft",
        "warning",
        f"Expected losses; at the highest currents losses_W is {np.median(total[is_high]):.3g} W, "
        f"{1.0 / np.median(share):.2g} times the copper loss: it may be the input power, of which "
        "the shaft takes the most.",
        place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
        f"If so, write electrical_power_W = {line} in place of losses_W, and record torque_Nm and "
        "speed_rpm; if not, check phase_resistance_ohm and the unit of the current.",
        values={"copper_share": float(np.median(share))},
    )
