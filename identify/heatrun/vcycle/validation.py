"""Validation of a prototype: two records of one manoeuvre, aligned and compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ..bench.checks.samples import median_step, samples
from ..bench.record import Finding, Record
from ..motor import Motor
from .compare_signals import SignalComparison, compare_signals
from .pair import Pair, pair_records
from .reference import Limits, Reference, bands_on_axis


@dataclass(frozen=True)
class Validation:
    """Two prototypes beside each other.

    Attributes:
        pair: Both on one axis.
        signals: Signal by signal, in the order of the test's channels.
        bands: Lower and upper 95 % limit of the reference on the common axis, by channel.
        findings: Doubts.
    """

    pair: Pair
    signals: tuple[SignalComparison, ...]
    bands: Mapping[str, Limits]
    findings: tuple[Finding, ...]

    @property
    def judged(self) -> tuple[SignalComparison, ...]:
        """The signals that are evidence."""
        return tuple(s for s in self.signals if s.verdict not in ("input", "not comparable"))


def validate(
    test: Record,
    reference: Reference,
    motor: Motor,
    *,
    tolerances: Mapping[str, float] | None = None,
    offset_s: float | None = None,
) -> Validation:
    """Align two records of one manoeuvre and compare them signal by signal.

    Args:
        test: The record whose clock is kept.
        reference: The other prototype's.
        motor: The machine.
        tolerances: By channel, in its unit (K for temperatures).
        offset_s: What is added to the reference's clock [s]; searched if None, and 0 for a run
            that the test itself drove.

    Raises:
        InputError: If they share no signal or no time, or the offset cannot be found.
    """
    if offset_s is None and reference.run:
        offset_s = 0.0
    pair = pair_records(test, reference.record, motor, offset_s=offset_s)
    if offset_s is None and reference.is_on_clock_of_test:
        pair = _on_clock_of_test(pair, test, reference, motor)
    bands = bands_on_axis(reference, pair)
    signals = compare_signals(pair, tolerances, bands, reference.inputs)
    findings = (*pair.findings, *_not_used(tolerances, pair))
    return Validation(pair, signals, bands, findings)


def _on_clock_of_test(pair: Pair, test: Record, reference: Reference, motor: Motor) -> Pair:
    """Without an offset where the search finds no more than a step of a simulated record.

    The inputs in such a record are means over the step before each stamp, its temperatures are
    those at the stamp: half a step of offset in the inputs is none of the temperatures.
    """
    found_s = pair.offset.offset_s
    if abs(found_s) > median_step(samples(reference.record)[0]):
        return pair
    pair = pair_records(test, reference.record, motor, offset_s=0.0)
    method = (
        f"none: the reference was simulated on the clock of a test (a search gives {found_s:+.2f} "
        "s, within its step)"
    )
    return replace(pair, offset=replace(pair.offset, method=method))


def _not_used(tolerances: Mapping[str, float] | None, pair: Pair) -> tuple[Finding, ...]:
    unused = [channel for channel in tolerances or {} if channel not in pair.ours]
    if not unused:
        return ()
    return (
        Finding(
            "tolerance_not_used",
            "warning",
            f"A tolerance was given for {', '.join(unused)}, which the records do not share.",
            f"{pair.test}, {pair.reference}",
            f"The signals in common are {', '.join(pair.ours)}.",
            pair.test,
        ),
    )
