"""Validation of a prototype: two records of one manoeuvre, aligned and compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ....bench.checks.samples import median_step, samples
from ....bench.record import Finding, Record
from ....motor import Motor
from ..reference import Limits, Reference, bands_on_axis
from .compare_signals import SignalComparison, compare_signals
from .pair import Pair, pair_records


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
        offset_s: What is added to the reference's clock [s]; searched if None; a run that the
            test itself drove brings its own.

    Raises:
        InputError: If they share no signal or no time, or the offset cannot be found.
    """
    pair = _aligned(test, reference, motor, offset_s)
    bands = bands_on_axis(reference, pair)
    signals = compare_signals(pair, tolerances, bands, reference.inputs)
    findings = (*pair.findings, *_not_used(tolerances, pair))
    return Validation(pair, signals, bands, findings)


def _aligned(test: Record, reference: Reference, motor: Motor, offset_s: float | None) -> Pair:
    """The pair at an offset that is given, brought along by the reference, or found.

    The inputs in a simulated record are means over the step before each stamp, its temperatures
    those at the stamp: a search by the inputs is off by half a step for the temperatures. So the
    offset that such a record brings along holds where the search is within a step of it.
    """
    if offset_s is not None:
        return pair_records(test, reference.record, motor, offset_s=offset_s)
    if reference.run:
        pair = pair_records(test, reference.record, motor, offset_s=0.0)
        return _by(pair, "none to be found: the test itself drove the run")
    pair = pair_records(test, reference.record, motor)
    found_s, known_s = pair.offset.offset_s, reference.starts_at_s
    if known_s is None or abs(found_s - known_s) > median_step(samples(reference.record)[0]):
        return pair
    pair = pair_records(test, reference.record, motor, offset_s=known_s)
    return _by(
        pair,
        "the first stamp of the reference, which was simulated on the clock of a test (a search "
        f"gives {found_s:+.2f} s, within a step of it)",
    )


def _by(pair: Pair, method: str) -> Pair:
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
