"""Validation of a prototype: two records of one manoeuvre, aligned and compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from heatrun.bench.checks.samples import median_step, samples
from heatrun.bench.record import Finding, Record
from heatrun.motor import Motor

from ..reference import Limits, Reference, bands_on_axis
from .combined_uncertainty import combined_uncertainty, scale_of
from .compare_figures import FigureComparison, compare_figures, evidence, within
from .compare_signals import SignalComparison, compare_signals
from .drive import with_powers
from .pair import Pair, pair_records
from .tolerances import Tolerance, tolerance_of


@dataclass(frozen=True)
class Validation:
    """Two prototypes beside each other.

    Attributes:
        pair: Both on one axis.
        signals: Signal by signal, in the order of the test's channels.
        figures: Energy, distance and consumption over the time in common.
        bands: Lower and upper 95 % limit of the reference on the common axis, by channel.
        findings: Doubts.
    """

    pair: Pair
    signals: tuple[SignalComparison, ...]
    figures: tuple[FigureComparison, ...]
    bands: Mapping[str, Limits]
    findings: tuple[Finding, ...]

    @property
    def judged(self) -> tuple[SignalComparison, ...]:
        """The signals that are evidence."""
        return tuple(s for s in self.signals if s.verdict not in ("input", "not comparable"))

    @property
    def judged_figures(self) -> tuple[FigureComparison, ...]:
        """The figures that are evidence."""
        return evidence(self.figures)


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
        tolerances: By channel or figure, in its unit (K for temperatures).
        offset_s: What is added to the reference's clock [s]; searched if None; a run that the
            test itself drove brings its own.

    Raises:
        InputError: If they share no signal or no time, or the offset cannot be found.
    """
    pair = align(test, reference, motor, offset_s)
    return judge(test, reference, motor, pair, tolerances or {})


def judge(
    test: Record, reference: Reference, motor: Motor, pair: Pair, given: Mapping[str, float]
) -> Validation:
    """Judge two aligned records signal by signal, and figure by figure.

    Args:
        test: The record whose clock the pair is on.
        reference: The other prototype's.
        motor: The machine.
        pair: Both on one axis, or a part of it.
        given: Tolerances of the user, as `validate`.
    """
    bands = bands_on_axis(reference, pair)
    limits = _tolerances(test, reference, motor, pair, bands, given)
    signals = compare_signals(pair, limits, bands, reference.inputs)
    from_s, to_s = float(pair.time_s[0]), float(pair.time_s[-1])
    shift_s = pair.offset.offset_s
    figures = compare_figures(
        within(test, from_s, to_s), within(reference.record, from_s - shift_s, to_s - shift_s),
        motor, signals, given, reference.inputs,
    )  # fmt: skip
    findings = (*pair.findings, *_not_used(given, pair, figures))
    return Validation(pair, signals, figures, bands, findings)


def _tolerances(
    test: Record,
    reference: Reference,
    motor: Motor,
    pair: Pair,
    bands: Mapping[str, Limits],
    given: Mapping[str, float],
) -> dict[str, Tolerance]:
    """The tolerance of each shared signal."""
    test = with_powers(test, motor)
    reference = replace(reference, record=with_powers(reference.record, motor))
    found = {}
    for channel in pair.ours:
        scale = scale_of(channel, pair, reference.record, motor)
        unknown = combined_uncertainty(channel, scale, test, reference, bands.get(channel), motor)
        found[channel] = tolerance_of(channel, scale, unknown, given)
    return found


def align(test: Record, reference: Reference, motor: Motor, offset_s: float | None) -> Pair:
    """Return the pair at an offset that is given, brought along by the reference, or found.

    The inputs in a simulated record are means over the step before each stamp, its temperatures
    those at the stamp: a search by the inputs is off by half a step for the temperatures. So the
    offset that such a record brings along holds where the search is within a step of it.

    Args:
        test: The record whose clock is kept.
        reference: The other prototype's.
        motor: The machine.
        offset_s: As `validate`.

    Raises:
        InputError: As `validate`.
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


def _not_used(
    given: Mapping[str, float], pair: Pair, figures: tuple[FigureComparison, ...]
) -> tuple[Finding, ...]:
    shared = {*pair.ours, *(figure.name for figure in figures)}
    unused = [name for name in given if name not in shared]
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
