"""How far two prototypes may differ and still count as agreeing, and what decides it.

Two limits are formed for each signal. One is what the difference matters against: a share of the
rise for a temperature of the machine, a share of the largest magnitude for any other signal. The
other is what the two instruments could differ by if the machines were the same: their combined
uncertainty. The larger one is the tolerance, since a difference that does not matter is no
disagreement, and one that the instruments cannot tell is none either. A tolerance that the user
gives stands in place of both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

SHARE = 0.05
"""Share of the rise, of the largest magnitude or of a figure [1]; ours, no standard."""

COVER = 2.0
"""Coverage factor k of the combined uncertainty [1]: about 95 %."""

DecidedBy = Literal["given", "rise", "magnitude", "uncertainty", "nothing"]

PERCENT = f"{100.0 * SHARE:.0f} %"

RULE = (
    f"The larger of two limits. First, {PERCENT} of the rise for a temperature of the machine "
    "(what the reference's rise over the sink exceeds for a twentieth of the time; without a sink, "
    f"over its lowest reading), {PERCENT} of the reference's largest magnitude for any other "
    "signal, no such limit for air and coolant. Second, the combined uncertainty of both sides, "
    f"k = {COVER:.0f}, from the classes of the sensors, the step of the readings and the 95 % "
    "band of a simulation, as far as they are known. Figures such as the energy may differ by "
    f"{PERCENT} of the reference's. The shares are ours and follow no standard; a tolerance that "
    "is given (--tolerance NAME=VALUE) takes the place of both limits."
)
"""The rule in words of the report."""


@dataclass(frozen=True)
class Tolerance:
    """A tolerance and what decided it.

    Attributes:
        value: In the unit of the channel (K for temperatures) or figure.
        decided_by: Which limit it is.
        basis: For the report, with the limit that did not decide.
        uncertainty: Combined uncertainty of both sides, k = 2, in the same unit; 0 where nothing
            is known of it.
    """

    value: float
    decided_by: DecidedBy
    basis: str
    uncertainty: float = 0.0


@dataclass(frozen=True)
class Scale:
    """What the difference of a signal matters against.

    Attributes:
        value: Rise [K] or largest magnitude [unit of the channel]; 0 for none.
        kind: Which of the two.
        unit: As printed.
    """

    value: float
    kind: Literal["rise", "magnitude"]
    unit: str


def tolerance_of(
    channel: str, scale: Scale, uncertainty: float, given: Mapping[str, float]
) -> Tolerance:
    """Return the tolerance of a signal.

    Args:
        channel: The signal.
        scale: What its difference matters against.
        uncertainty: Combined standard uncertainty of both sides, in the unit of the channel.
        given: The user's, by channel.
    """
    expanded = COVER * uncertainty
    if channel in given:
        return Tolerance(given[channel], "given", "given", expanded)
    relative = SHARE * scale.value
    what = "rise" if scale.kind == "rise" else "largest magnitude"
    matters = f"{PERCENT} of the {what} of {scale.value:.1f} {scale.unit}"
    known = f"combined uncertainty {expanded:.2g} {scale.unit} (k = {COVER:.0f})"
    if expanded == 0.0:
        known = "nothing is known of the uncertainty"
    if scale.value == 0.0:
        return Tolerance(expanded, "uncertainty", known, expanded)
    if expanded > relative:
        basis = f"{known}, above {matters} = {relative:.2g} {scale.unit}"
        return Tolerance(expanded, "uncertainty", basis, expanded)
    return Tolerance(relative, scale.kind, f"{matters}; {known}", expanded)


def tolerance_of_figure(name: str, reference: float, given: Mapping[str, float]) -> Tolerance:
    """Return the tolerance of a figure such as the energy.

    Args:
        name: As in the General Information table.
        reference: Figure of the reference.
        given: The user's, by name.
    """
    if name in given:
        return Tolerance(given[name], "given", "given")
    return Tolerance(SHARE * abs(reference), "magnitude", f"{PERCENT} of the reference's figure")
