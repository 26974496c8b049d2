"""How finely was the winding temperature written down, and was it rounded or cut off?"""

from __future__ import annotations

import numpy as np

from ...motor import Motor
from ..record import Finding, Record
from ..rounding import rounding_step
from .course import lead_in
from .samples import place, samples, sink_channel, with_all_heat

NOTED_STEP_K = 0.05
"""A step of 0.05 K adds 0.015 K rms, below the noise of any sensor on a bench."""

HARMFUL_STEP_K = 0.2
"""Truncation shifts a reading by half a step on average: 0.1 K, a third of what a thermocouple is
good for, and a fifth of the cost that is known for 1 degC."""

COMPANION_SHARE = 0.25
"""The sink must be at least four times finer than the winding to show which way that was
rounded."""

TELLING_MARGIN = 0.1
"""Distance, in steps, by which an offset must lie outside of what rounding or truncation allows."""

EQUILIBRIUM_STEPS = 2.0
"""A start further from the sink than this, in steps, is no common equilibrium of both sensors."""


def resolution(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Note the step that the winding temperature was rounded to."""
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < NOTED_STEP_K * (1.0 - 1e-6):
        return ()
    return (
        Finding(
            "resolution",
            "note",
            f"The resolution is {step:.3g} K, which adds {step / np.sqrt(12.0):.2g} K rms of "
            "rounding noise: a smaller RMSE would be overfitting.",
            place(record, "winding_degC", float(time_s[0]), float(time_s[-1])),
            "Export more decimals if the logger has them.",
            values={"step_K": step},
        ),
    )


def truncation(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Tell, as far as the record can, whether readings were rounded or cut off.

    Cutting off is rounding with an offset of half a step, so the shape of the record does not show
    it; only a start in equilibrium with a finer sink does. There a rounded reading lies within half
    a step of the sink, a cut-off one between one step below and the sink itself. In the common part
    of the two, or without such a start, the record cannot tell, and the note asks. On the reference
    motor truncation to 1 degC costs +3.5 % on Ceq_w and -4.2 % on Req_sr.
    """
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < HARMFUL_STEP_K * (1.0 - 1e-6):
        return ()
    offset = _offset_at_start(record, motor, step)
    values = {"step_K": step}
    if offset is not None:
        values["offset_K"] = offset
    share = float("nan") if offset is None else offset / step
    cost = (
        f"Truncation to {step:.3g} K reads {step / 2.0:.2g} K low on average; truncation to 1 K "
        "biases Ceq_w of the reference motor by +3.5 % and Req_sr by -4.2 %."
    )
    where = place(record, "winding_degC", float(time_s[0]))
    if share < -0.5 - TELLING_MARGIN:
        return (
            Finding(
                "truncation",
                "warning",
                f"In equilibrium at the start the winding reads {offset:+.2f} K against the sink, "
                f"where rounding allows {step / 2.0:.2g} K: the values are truncated, or the "
                f"sensor reads low. {cost}",
                where,
                "Look up in the logger's manual whether it rounds or truncates.",
                values=values | {"is_suspected": 1.0},
            ),
        )
    if TELLING_MARGIN < share <= 0.5 + TELLING_MARGIN:
        message = (
            f"Rounded, not truncated: the winding starts {offset:+.2f} K above the sink. The "
            "readings are not biased by it."
        )
        return (
            Finding("truncation", "note", message, where, values=values | {"is_suspected": 0.0}),
        )
    return (
        Finding(
            "truncation",
            "note",
            f"Rounded or truncated: the record does not show which. {cost}",
            where,
            "Look up in the logger's manual whether it rounds or truncates.",
            values=values,
        ),
    )


def _offset_at_start(record: Record, motor: Motor, step: float) -> float | None:
    """Winding less sink [K] before heat flows, or None if the record does not show it."""
    time_s, winding, sink, losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_channel(motor), "losses_W"
    )
    lead = lead_in(time_s, losses)
    if lead == 0:
        return None
    sink_step = rounding_step(samples(record, sink_channel(motor))[1])
    if sink_step is not None and sink_step > COMPANION_SHARE * step:
        return None
    offset = float(np.mean(winding[:lead] - sink[:lead]))
    return offset if abs(offset) <= EQUILIBRIUM_STEPS * step else None
