"""Measured bodies that a discovery leaves out: it looks at the winding alone, and says so."""

from __future__ import annotations

from collections.abc import Sequence

from ..bench.blocks import Blocks
from ..bench.channels.schema import BODIES
from ..bench.record import Finding
from ..inference.model import Model


def unsearched_bodies(model: Model, tests: Sequence[Blocks]) -> tuple[str, ...]:
    """Return the channels of bodies that a calibration of the network would fit.

    Args:
        model: The base network, with what the motor file says of its sensors.
        tests: The reduced records, held-out ones among them.
    """
    measured = {body.channel for test in tests for body in test.bodies}
    return tuple(c for c in BODIES if c in measured and model.form.sensed(c) is not None)


def bodies_sentence(channels: Sequence[str]) -> str:
    """Return what a verdict adds where bodies were left out; empty where none was."""
    if not channels:
        return ""
    verb = "was" if len(channels) == 1 else "were"
    return (
        f" This rests on the winding alone: {' and '.join(channels)} {verb} measured and, beyond "
        "the start, took no part in the search."
    )


def bodies_finding(channels: Sequence[str]) -> Finding | None:
    """Return the same as a finding; None where no body was left out."""
    if not channels:
        return None
    names = " and ".join(channels)
    return Finding(
        id="bodies_not_searched",
        severity="note",
        message="The search for missing effects looked at the winding alone; beyond the start "
        f"temperature, {names} took no part in it, nor in the parameters of this result. An "
        "effect that only another body shows is not found, and one that the body contradicts may "
        "be named.",
        remedy="Run `heatrun calibrate --with EFFECT` with what was named: it fits the bodies too, "
        "and its findings say whether one of them disagrees.",
    )
