"""Does the test excite what a fit is to find: more than one level, and long enough?"""

from collections.abc import Iterator

import numpy as np

from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import block_means, is_loaded, lead_in, place, samples, with_all_heat
from .course import settling_constants
from .quick_fit import quick_fit

BLOCK_S = 30.0
"""Levels are means over 30 s, a third of a winding's time constant: faster changes average out."""

SAME_LEVEL = 0.1
"""Levels within this share of the largest are one [1]: 10 % in current is 20 % in copper loss, the
least that leaves a second transient above the noise."""

LOSS_STEP = 0.2
"""A change of the losses from block to block by this share [1] is a step of the operating point,
not copper growing with temperature (0.4 %/K, some ten kelvin in 30 s at most)."""

FEW_CONSTANTS = 0.75
"""Below this many slow time constants the warning comes. At one, the reference motor's Ceq_sr and
Req_sr come out to 9 and 10 %; the quick fit's constant itself is good to a quarter."""

UNKNOWN_LOG_SD = 0.4
"""A slow constant known to a factor of 1.5 only has not been seen."""

APART = 5.0
"""Factor between the two time constants of a machine at least [1]: a winding and its iron."""

ENOUGH_CONSTANTS = 2.0
"""From two on, both are good to 4 % and nothing is said."""

SHORTEST_S = 120.0
"""About the time constant of a winding [s]: until then hardly any heat has reached the body behind
it, and what settles is not the machine."""

TWO_HOURS_S = 7200.0
KNOWN_CONSTANTS = (1.0, 2.0, 3.0)
KNOWN_SD = ((9.0, 3.6, 2.5), (10.0, 1.2, 0.8))
"""Relative sd of Ceq_sr and Req_sr [%] against the length of the test in slow time constants,
reference motor at 1 degC; beyond the ends they are a bound and no more."""


def single_step(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Warn if what heats holds one level from the moment the load comes to the end.

    Idle time before the load is no second level, since nothing is warm; idle time after it is one.
    Current and speed hold theirs while the copper loss grows; steps of the losses count besides.
    """
    time_s, losses = samples(with_all_heat(record, motor), "losses_W")
    loaded = is_loaded(losses)
    if not loaded.any():
        return ()
    from_s, to_s = float(time_s[np.argmax(loaded)]), float(time_s[-1])

    def levels(times: np.ndarray, values: np.ndarray) -> np.ndarray:
        later = times >= from_s
        # the first and last block may be cut by an edge of the load
        return block_means(times[later], BLOCK_S, values[later])[1][1:-1]

    powers = levels(time_s, losses)
    held = [levels(*samples(record, name)) for name in ("phase_current_A", "speed_rpm")]
    if powers.size < 2 or np.any(np.abs(np.diff(powers)) > LOSS_STEP * np.max(np.abs(powers))):
        return ()
    if any(np.ptp(each) > SAME_LEVEL * np.max(np.abs(each)) for each in held if each.size):
        return ()
    has_current = held[0].size > 0 and bool(np.any(held[0]))
    channel, what, unit = (
        ("phase_current_A", "current is", "A") if has_current else ("losses_W", "losses are", "W")
    )
    level = float(np.mean(held[0] if has_current else powers))
    return (
        Finding(
            "single_step",
            "warning",
            f"Expected several levels of load; the {what} {level:.4g} {unit} throughout. "
            "A single load step hardly separates winding from stator parameters, and missing "
            "effects cannot be distinguished.",
            place(record, channel, from_s, to_s),
            "Add a cool-down, or steps in which current and speed change independently.",
            values={channel.removeprefix("phase_"): level, "from_s": from_s, "to_s": to_s},
        ),
    )


def _brief(record: Record, from_s: float, to_s: float) -> Finding:
    return Finding(
        "too_short",
        "warning",
        f"Expected a test of many minutes; it goes on for {to_s - from_s:.0f} s from the first "
        "load on. That tells the heat capacity of the winding, Ceq_w, and little of its "
        "resistance to the body behind it, Req_w; Ceq_sr and Req_sr keep their priors.",
        place(record, "winding_degC", from_s, to_s),
        "Hold one load until the temperature settles, and record the cool-down.",
        values={"duration_s": to_s - from_s},
    )


def too_short(record: Record, motor: Motor) -> Iterator[Finding]:
    """Compare the length of the test with the slow time constant that the record itself shows.

    A warning below three quarters of a time constant, or where the constant stays unknown to a
    factor of one and a half; a note below two. A record that settles shows a constant that is short
    against it, so nothing is said. Under two minutes no constant is that of the machine: it is said
    what such a test can tell.
    """
    time_s, losses = samples(with_all_heat(record, motor), "losses_W")
    if not is_loaded(losses).any():
        return
    from_s, to_s = float(time_s[max(lead_in(time_s, losses) - 1, 0)]), float(time_s[-1])
    is_settled = settling_constants(record, motor) >= ENOUGH_CONSTANTS
    fit = None if is_settled else quick_fit(record, motor)
    is_brief = to_s - from_s < SHORTEST_S
    if fit is None:
        if is_brief:
            yield _brief(record, from_s, to_s)
        return
    constants = (to_s - from_s) / fit.tau_s
    low, high = fit.tau_s * np.exp([-2.0 * fit.log_sd, 2.0 * fit.log_sd])
    fast_s = fit.taus_s[0]
    # that of a body that the test does not see may be any, of one constant two are made
    is_one = fit.tau_s < APART * fast_s and fit.log_sd > 0.5 * UNKNOWN_LOG_SD
    is_open = fit.log_sd > UNKNOWN_LOG_SD and high > to_s - from_s
    is_open |= is_one and constants < max(KNOWN_CONSTANTS)
    if is_brief and not is_open:  # what seems known is the fast one
        yield _brief(record, from_s, to_s)
        return
    # a slow one as short as the test would show, if it were none of the fast ones
    is_one |= constants >= FEW_CONSTANTS and low < APART * fast_s
    is_short = constants < FEW_CONSTANTS or fit.log_sd > UNKNOWN_LOG_SD or is_open
    if constants >= ENOUGH_CONSTANTS and not is_short:
        return
    open_to = {"fast_from_s": fast_s, "fast_to_s": fit.tau_s if is_one else fast_s}
    open_to = open_to if is_open else {}
    lasts = f"{(to_s - from_s) / 60.0:.0f} min"
    if constants >= ENOUGH_CONSTANTS or is_open:
        between = f"from {low:.0f} s on" if is_one else f"between {low:.0f} and {high:.0f} s"
        message = (
            f"Expected a slow time constant that the record shows; in {lasts} it stays open "
            f"{between}."
        )
        remedy = "Hold one load until the temperature settles, and record the cool-down."
    else:
        now, later = (
            [np.interp(lasts, KNOWN_CONSTANTS, sd) for sd in KNOWN_SD]
            for lasts in (constants, TWO_HOURS_S / fit.tau_s)
        )
        at_least = "more than " if constants < KNOWN_CONSTANTS[0] else "about "
        message = (
            f"Expected at least two slow time constants; the {lasts} of test are "
            f"{constants:.2g} time constants of about {fit.tau_s:.0f} s. The standard "
            f"uncertainties of Ceq_sr and Req_sr will be {at_least}{now[0]:.0f} % and "
            f"{now[1]:.0f} %; after 2 h about {later[0]:.1f} % and {later[1]:.1f} %."
        )
        remedy = "Extend the load until the temperature settles, and record the cool-down."
    yield Finding(
        "too_short",
        "warning" if is_short else "note",
        message,
        place(record, "winding_degC", from_s, to_s),
        remedy,
        values={
            "duration_s": to_s - from_s,
            "time_constants": constants,
            "tau_s": fit.tau_s,
            "tau_log_sd": fit.log_sd,
        }
        | open_to,
    )
