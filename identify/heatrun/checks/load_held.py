"""A load that stands still, or reads nothing, though the machine goes on: held, lost or stated."""

from collections.abc import Iterator

import numpy as np

from ..record.channels import CHANNEL
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import is_loaded, place, runs, samples, sink_channel, with_all_heat
from ..record.stretch import bridge, within
from .advice import Part, Remedy, use_line, widened
from .frozen import (
    AS_WELL,
    FLICKERS,
    LIVE_S,
    LIVE_SAMPLES,
    MIN_STRETCH_S,
    REST_SHARE,
    STEADY,
    longest_held,
)
from .heat import UNHEATED_K
from .load_spike import of_the_load
from .quick_fit import QuickFit, quick_fit
from .time_axis import MAX_GAP_S, MAX_GAP_SHARE


def load_stuck(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report the longest stretch in which a column of the load stands still, at no zero, though
    its last digit changes elsewhere: the logger has held its last value. A power is held at zero
    too, where current flows.

    An error where it is as long as a gap that is one, and another column of the load goes on (a
    load that is set, not measured, may stand still), and of a power while current flows; also where
    all of the load reads nothing though the winding stays warm, and where losses stay while neither
    a current flows nor the shaft turns. A warning where a torque is zero throughout a run.
    """
    yield from _lost_load(record, motor)
    yield from _losses_at_rest(record)
    yield from _no_torque(record)
    told: list[tuple[float, float]] = []
    load = of_the_load(record)
    for channel in load:
        time_s, values = samples(record, channel)
        largest = float(np.max(np.abs(values), initial=0.0))
        held = _lost_power(record, channel)
        is_lost = held is not None
        if not is_lost:
            held = longest_held(time_s, values, rest=REST_SHARE * largest)
        if held is None or abs(held[2]) == largest:  # a flat top is `saturation`'s
            continue
        from_s, to_s, value = held
        if any(from_s < end and begin < to_s for begin, end in told):
            continue  # the logger held all of its channels at once
        if _is_at_rest(record, channel, from_s, to_s):
            continue
        told.append((from_s, to_s))
        parts = [
            (float(np.nanmin(record.time_s)), from_s), (to_s, float(np.nanmax(record.time_s)))
        ]  # fmt: skip
        long = [part for part in parts if part[1] - part[0] > MIN_STRETCH_S]
        advice: tuple[Part, ...] = ()
        if any(_is_steady(record, other, from_s, to_s) for other in load if other != channel):
            advice = " To run straight over it: ", widened(record, "bridge", [(from_s, to_s)]), "."
        elif long:
            advice = " To use what is before and behind: ", use_line(record, *long), "."
        inside = within(record.time_s, [(from_s, to_s)])
        goes_on = any(np.mean(np.diff(record[other][inside]) != 0.0) > 0.5 for other in load)
        is_long = to_s - from_s > min(MAX_GAP_S, MAX_GAP_SHARE * record.duration_s)
        why = "while current flows" if is_lost else "but its last digit changes elsewhere"
        yield Finding(
            "load_stuck",
            "error" if is_lost or (is_long and goes_on) else "warning",
            f"{channel} stands at {value:.6g} {CHANNEL[channel].unit} for {to_s - from_s:.0f} s, "
            f"{why}: the value was held, not measured.",
            place(record, channel, from_s, to_s),
            Remedy("Check logger and bus.", *advice),
            values={"from_s": from_s, "to_s": to_s, "value": value},
        )  # fmt: skip


def _lost_load(record: Record, motor: Motor) -> Iterator[Finding]:
    """Yield where all of the load reads nothing, though the winding goes on as under it."""
    names = ("winding_degC", sink_channel(motor), "losses_W")
    time_s, winding, sink, losses = samples(with_all_heat(record, motor), *names)
    current_s, current = samples(record, "phase_current_A")
    if time_s.size < LIVE_SAMPLES or not is_loaded(losses).any():
        return
    rests = ~is_loaded(losses)
    if current_s.size:
        rests &= ~(np.interp(time_s, current_s, is_loaded(np.square(current))) > 0.0)
    as_read: QuickFit | None = None
    for a, b in zip(*runs(rests), strict=True):
        is_between = a > 0 and b < time_s.size and time_s[b] - time_s[a] >= MIN_STRETCH_S
        if not is_between or winding[a] - sink[a] < UNHEATED_K or winding[b] < winding[a]:
            continue
        span = (float(time_s[a]), float(time_s[b - 1]))
        as_read = as_read or quick_fit(record, motor)
        held = quick_fit(bridge(record, [span], ""), motor)
        if held is None or (as_read is not None and AS_WELL * held.rms_K > as_read.rms_K):
            continue
        yield Finding(
            "load_stuck",
            "error",
            f"The load reads nothing for {span[1] - span[0]:.0f} s, but the winding does not cool: "
            f"it goes from {winding[a]:.1f} to {winding[b]:.1f} °C. The load was on, and not "
            "recorded.",
            place(record, "losses_W", *span),
            Remedy("Check logger and bus. To run straight over it: ",
                   widened(record, "bridge", [span]), "."),
            values={"from_s": span[0], "to_s": span[1], "value": 0.0},
        )  # fmt: skip


def _losses_at_rest(record: Record) -> Iterator[Finding]:
    """Yield a column of losses that stays where neither a current flows nor the shaft turns."""
    if "losses_W" not in of_the_load(record):
        return
    time_s, losses, current, speed = samples(record, "losses_W", "phase_current_A", "speed_rpm")
    if time_s.size < LIVE_SAMPLES:
        return
    flows = is_loaded(np.square(current))
    still = (np.abs(current) <= REST_SHARE * np.max(np.abs(current))) & (np.abs(speed) < 1.0)
    if not flows.any() or np.sum(still) < LIVE_SAMPLES:
        return
    stated_W = float(np.median(losses[still]))
    if stated_W < FLICKERS * np.median(losses[flows]):
        return
    yield Finding(
        "load_stuck",
        "error",
        f"losses_W is {stated_W:.6g} W while neither a current flows nor the shaft "
        "turns: the losses are stated, not measured.",
        place(record, "losses_W", *map(float, time_s[still][[0, -1]])),
        "Take losses_W from a column that is measured, or from the powers.",
        values={"value": stated_W},
    )


def _no_torque(record: Record) -> Iterator[Finding]:
    """Yield a column of torque that reads nothing at all while the machine turns under current."""
    if "torque_Nm" not in of_the_load(record):
        return
    time_s, torque, current, speed = samples(record, "torque_Nm", "phase_current_A", "speed_rpm")
    runs_loaded = is_loaded(np.square(current)) & (np.abs(speed) >= 1.0)
    if np.any(torque) or np.sum(runs_loaded) < LIVE_SAMPLES:
        return
    yield Finding(
        "load_stuck",
        "warning",
        "torque_Nm reads 0 N m throughout, though the machine turns under current: all of the "
        "electrical power counts as losses.",
        place(record, "torque_Nm", *map(float, time_s[runs_loaded][[0, -1]])),
        "Check the transducer. Where the machine ran without load: torque_Nm = 0 under "
        "[constants], in place of the column.",
        values={"value": 0.0},
    )


def _is_at_rest(record: Record, channel: str, from_s: float, to_s: float) -> bool:
    """Return whether no current flows while another channel of the load stands still."""
    if channel == "phase_current_A":
        return False
    time_s, current = samples(record, "phase_current_A")
    inside = within(time_s, [(from_s, to_s)])
    return bool(inside.any()) and not is_loaded(np.square(current))[inside].any()


def _is_steady(record: Record, channel: str, from_s: float, to_s: float) -> bool:
    """Return whether a channel of the load is live, and the same all through a stretch and beside
    it.
    """
    time_s, values = samples(record, channel)
    around = values[within(time_s, [(from_s - LIVE_S, to_s + LIVE_S)])]
    is_live = np.mean(np.diff(around) != 0.0) > FLICKERS if around.size > 1 else False
    return bool(is_live and np.ptp(around) < STEADY * np.max(np.abs(values)))


def _lost_power(record: Record, channel: str) -> tuple[float, float, float] | None:
    """Return, as `longest_held`, where a power reads nothing while current flows."""
    if CHANNEL[channel].quantity != "power":
        return None
    time_s, values, current = samples(record, channel, "phase_current_A")
    flows = is_loaded(np.square(current))
    held = longest_held(time_s[flows], values[flows], LIVE_S)
    is_nothing = held is not None and abs(held[2]) <= REST_SHARE * np.max(np.abs(values))
    return held if is_nothing else None
