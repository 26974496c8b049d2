"""Validation of a prototype: two records of one manoeuvre aligned, and compared signal by signal.

Tolerances come first, then each signal (bias, spread, correlation, verdict) and the figures of the
time in common (energy, distance, consumption).
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from heatrun.errors import InputError
from heatrun.model.bodies import CURRENT_GAIN, INSTRUMENTS
from heatrun.record.channels import CHANNELS
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import median_step, rounding_step, samples, sink_channel

from ..report import NOT_OF_THE_MACHINE, unit
from ..simulated import Limits, Reference, bands_on_axis
from .drive import DC, TERMINALS, electrical_power, integrate, weights, with_powers
from .general_information import J_PER_KWH, figures_of, general_information
from .pair import Pair, pair_records

SHARE = 0.05
"""Share of the rise, of the largest magnitude or of a figure [1]; ours, no standard."""

COVER = 2.0
"""Coverage factor k of the combined uncertainty [1]: about 95 %."""

DecidedBy = Literal["given", "rise", "magnitude", "uncertainty"]

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
    """A tolerance and what decided it."""

    value: float  # In the unit of the channel (K for temperatures) or figure.
    decided_by: DecidedBy  # Which limit it is.
    basis: str  # For the report, with the limit that did not decide.


@dataclass(frozen=True)
class Scale:
    """What a difference of a signal matters against: rise [K] or largest magnitude; 0 for none."""

    value: float
    kind: Literal["rise", "magnitude"]
    unit: str


def tolerance_of(
    channel: str, scale: Scale, uncertainty: float, given: Mapping[str, float]
) -> Tolerance:
    """Return the tolerance of a signal.

    Two limits are formed for each signal. One is what the difference matters against: a share of
    the rise for a temperature of the machine, a share of the largest magnitude for any other
    signal. The other is what the two instruments could differ by if the machines were the same:
    their combined uncertainty. The larger one is the tolerance, since a difference that does not
    matter is no disagreement, and one that the instruments cannot tell is none either. A tolerance
    that the user gives stands in place of both.
    """
    if channel in given:
        return Tolerance(given[channel], "given", "given")
    expanded = COVER * uncertainty
    relative = SHARE * scale.value
    what = "rise" if scale.kind == "rise" else "largest magnitude"
    matters = f"{PERCENT} of the {what} of {scale.value:.1f} {scale.unit}"
    known = f"combined uncertainty {expanded:.2g} {scale.unit} (k = {COVER:.0f})"
    if expanded == 0.0:
        known = "nothing is known of the uncertainty"
    if scale.value == 0.0:
        return Tolerance(expanded, "uncertainty", known)
    if expanded > relative:
        basis = f"{known}, above {matters} = {relative:.2g} {scale.unit}"
        return Tolerance(expanded, "uncertainty", basis)
    return Tolerance(relative, scale.kind, f"{matters}; {known}")


HELD = 0.95
"""The rise is what is exceeded for the rest of the time [1]: a spike is no rise."""

TWO_SIDED_95 = 1.96
"""Standard deviations from the middle of a 95 % band to its limits [1]."""

GAINS = {"phase_current_A": "current_gain", "dc_current_A": "current_gain",
         "losses_W": "power_gain"}  # fmt: skip
"""Channels whose relative error has a class among the instruments of a calibration."""

CLASSES = {p.name: p.sd for p in (*INSTRUMENTS, CURRENT_GAIN)}


def scale_of(channel: str, pair: Pair, reference: Record, motor: Motor) -> Scale:
    """Return what a difference in a signal of a pair matters against; the reference is on its own
    clock.
    """
    symbol = unit(channel, is_difference=True)
    theirs = pair.theirs[channel]
    known = theirs[np.isfinite(theirs)]
    if symbol != "K":
        return Scale(float(np.max(np.abs(known), initial=0.0)), "magnitude", symbol)
    if channel in NOT_OF_THE_MACHINE or known.size == 0:
        return Scale(0.0, "rise", "K")
    clock, part, cold = samples(reference, channel, sink_channel(motor))
    clock = clock + pair.offset.offset_s
    inside = (clock >= pair.time_s[0]) & (clock <= pair.time_s[-1])
    rise = (part - cold)[inside] if inside.any() else known - np.min(known)
    return Scale(max(float(np.quantile(rise, HELD)), 0.0), "rise", "K")


def combined_uncertainty(
    channel: str,
    scale: Scale,
    test: Record,
    reference: Reference,
    band: Limits | None,
    motor: Motor,
) -> float:
    """Return the combined standard uncertainty of a difference, in the unit of the channel.

    Of a simulation only its 95 % band counts.
    """
    ours = reading_uncertainty(channel, scale, test, motor)
    if band is not None:
        half = 0.5 * (band[1] - band[0])
        known = half[np.isfinite(half)]
        theirs = float(np.sqrt(np.mean(known**2))) / TWO_SIDED_95 if known.size else 0.0
    elif reference.is_simulated:
        theirs = 0.0
    else:
        theirs = reading_uncertainty(channel, scale, reference.record, motor)
    return float(np.hypot(ours, theirs))


def reading_uncertainty(channel: str, scale: Scale, record: Record, motor: Motor) -> float:
    """Return the standard uncertainty of a reading [unit of the channel]: class of its sensor, and
    step of its readings.
    """
    step = rounding_step(samples(record, channel)[1]) or 0.0
    parts = [step / np.sqrt(12.0)]
    if channel == sink_channel(motor):
        parts.append(instrument_class("ambient_offset", motor))
    elif channel.endswith("_degC"):
        parts += [
            instrument_class("sensor_offset", motor),
            instrument_class("sensor_gain", motor) * scale.value,
        ]
    elif channel in GAINS:
        parts.append(instrument_class(GAINS[channel], motor) * scale.value)
    return float(np.sqrt(np.sum(np.square(parts))))


def instrument_class(name: str, motor: Motor) -> float:
    """Return the standard uncertainty of an instrument such as `"current_gain"`: the motor file's,
    0 where that holds the value fixed, else that of its class.
    """
    given = motor.parameters.get(name)
    if given is not None and given.fixed is not None:
        return 0.0
    return CLASSES[name] if given is None or given.sd is None else given.sd


Verdict = Literal["agrees", "biased", "differs", "input", "not comparable"]

ORDER = {channel.name: number for number, channel in enumerate(CHANNELS)}

NO_EVIDENCE = ("input", "not comparable", "not judged")
"""Verdicts on what says nothing of how well two prototypes agree."""

INSIDE = 0.95
"""Share of the time that must lie inside the tolerance [1]: what a 95 % band would hold."""

VERDICTS: dict[Verdict, str] = {
    "agrees": "at least 95 % of the time inside the tolerance",
    "biased": "outside, and inside at least 95 % of the time once the bias is taken off",
    "differs": "outside also without the bias",
    "input": "drove the simulation, so that its agreement is no evidence",
    "not comparable": "no common sample",
}
"""What each verdict means."""


@dataclass(frozen=True)
class SignalComparison:
    """One signal of two prototypes; differences are test minus reference."""

    channel: str  # The signal.
    bias: float  # Mean difference, weighted by time [unit of the channel, K for temperatures].
    rmse: float  # Root mean square of the difference [the same].
    largest: float  # Largest difference by magnitude, with its sign [the same].
    largest_at_s: float  # When, on the test's clock [s].
    correlation: float | None  # Of the two courses [1]; None where either is constant.
    tolerance: Tolerance  # What counts as agreement.
    share_inside: float  # Share of the time inside the tolerance [1].
    # Share of the time that the test lies in the reference's 95 % band [1]; None without a band.
    share_in_band: float | None
    # Energy of test and reference over the compared time [kWh]; None for a signal that is no power.
    energy_kWh: tuple[float, float] | None
    verdict: Verdict  # One of `VERDICTS`.


def place(channel: str) -> tuple[int, int]:
    """Return where a signal stands: temperatures of the machine first, of what is about it last."""
    number = ORDER.get(channel, len(ORDER))
    if channel in NOT_OF_THE_MACHINE:
        return 2, number
    return int(not channel.endswith("_degC")), number


def _compare(
    pair: Pair, channel: str, tolerance: Tolerance, band: Limits | None, *, is_input: bool
) -> SignalComparison:
    """Compare a signal of two prototypes; one that drove a simulation is no evidence."""
    ours, theirs = pair.ours[channel], pair.theirs[channel]
    known = np.isfinite(ours) & np.isfinite(theirs)
    if np.sum(known) < 2:
        nan, verdict = float("nan"), "input" if is_input else "not comparable"
        return SignalComparison(
            channel, nan, nan, nan, nan, None, tolerance, nan, None, None, verdict
        )
    time_s, a, b = pair.time_s[known], ours[known], theirs[known]
    weight = weights(time_s)
    weight = weight / np.sum(weight)
    difference = a - b
    bias = float(weight @ difference)
    share = float(weight @ (np.abs(difference) <= tolerance.value))
    unbiased = float(weight @ (np.abs(difference - bias) <= tolerance.value))
    worst = int(np.argmax(np.abs(difference)))
    in_band = None
    if band is not None:
        low, high = (limit[known] for limit in band)
        with_band = np.isfinite(low) & np.isfinite(high)
        if weight @ with_band > 0.0:
            in_band = float(weight @ ((a >= low) & (a <= high) & with_band) / (weight @ with_band))
    energy = None
    if channel.endswith("_W"):
        energy = integrate(time_s, a).net / J_PER_KWH, integrate(time_s, b).net / J_PER_KWH
    verdict: Verdict = (
        "agrees" if share >= INSIDE else "biased" if unbiased >= INSIDE else "differs"
    )
    return SignalComparison(
        channel=channel,
        bias=bias,
        rmse=float(np.sqrt(weight @ difference**2)),
        largest=float(difference[worst]),
        largest_at_s=float(time_s[worst]),
        correlation=_correlation(a, b, weight),
        tolerance=tolerance,
        share_inside=share,
        share_in_band=in_band,
        energy_kWh=energy,
        verdict="input" if is_input else verdict,
    )


def _correlation(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> float | None:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return None
    a, b = a - weight @ a, b - weight @ b
    return float(weight @ (a * b) / np.sqrt((weight @ a**2) * (weight @ b**2)))


FigureVerdict = Literal["agrees", "differs", "input", "not comparable", "not judged"]

OF_THE_DRIVE = ("dc_power_W", "electrical_power_W")
"""Powers whose energy stands in the General Information table already."""


@dataclass(frozen=True)
class FigureComparison:
    """One figure of two prototypes over the time in common; test and reference in its unit."""

    name: str  # As in the General Information table, or `energy_of_CHANNEL_kWh`.
    label: str
    unit: str
    test: float
    reference: float
    # Test minus reference over the reference's magnitude [%]; None where that is 0 or undefined.
    difference_percent: float | None
    tolerance: Tolerance
    verdict: FigureVerdict
    note: str = ""  # Why there is no verdict; else empty.


def within(record: Record, from_s: float, to_s: float) -> Record:
    """Return the part of a record between two moments on its own clock [s]."""
    inside = (record.time_s >= from_s) & (record.time_s <= to_s)
    return replace(record, channels={n: values[inside] for n, values in record.channels.items()})


def compare_figures(
    test: Record,
    reference: Record,
    motor: Motor,
    signals: Sequence[SignalComparison],
    given: Mapping[str, float],
    inputs: Container[str] = (),
) -> tuple[FigureComparison, ...]:
    """Compare the General Information of two records, and the energies of other powers.

    Both are cut to the time in common; what both have is compared, in the order of the table. What
    follows from the speed of a test that drove the reference is no evidence either.
    """
    found = []
    try:
        ours, theirs = (general_information(record, motor) for record in (test, reference))
    except InputError:  # fewer than two samples of a power or a speed: there is no figure
        return ()
    places = [_place(record, motor) for record in (test, reference)]
    for name, label, symbol, needs, _ in figures_of((ours, theirs)):
        a, b = getattr(ours, name), getattr(theirs, name)
        if a is None or b is None:
            continue
        one = _compared(name, label, symbol, a, b, given)
        if name == "reduction_percent":
            one = replace(one, difference_percent=None, verdict="not judged")
        elif "power" in needs and places[0] != places[1]:
            words = f"power of the test {places[0]}, of the reference {places[1]}"
            one = replace(one, verdict="not comparable", note=words)
        elif "speed" in needs and "speed_rpm" in inputs:
            one = replace(one, verdict="input")
        found.append(one)
    has_energy = any(one.name == "energy_kWh" for one in found)
    for signal in signals:
        if signal.energy_kWh is None or (has_energy and signal.channel in OF_THE_DRIVE):
            continue
        stem = signal.channel.removesuffix("_W")
        label = f"Energy by {stem.replace('_', ' ')}"
        one = _compared(f"energy_of_{stem}_kWh", label, "kWh", *signal.energy_kWh, {})
        found.append(replace(one, verdict="input") if signal.verdict == "input" else one)
    return tuple(found)


def _compared(
    name: str, label: str, unit: str, a: float, b: float, given: Mapping[str, float]
) -> FigureComparison:
    tolerance = Tolerance(SHARE * abs(b), "magnitude", f"{PERCENT} of the reference's figure")
    if name in given:
        tolerance = Tolerance(given[name], "given", "given")
    percent = 100.0 * (a - b) / abs(b) if b != 0.0 else None
    # what follows from sums may be off by their rounding
    slack = 1e-9 * max(abs(a), abs(b))
    agrees = bool(np.abs(a - b) <= tolerance.value + slack)
    return FigureComparison(
        name, label, unit, a, b, percent, tolerance, "agrees" if agrees else "differs"
    )


def _place(record: Record, motor: Motor) -> str:
    """Where the electrical power was taken, in words; empty if it was not."""
    try:
        formula = electrical_power(record, motor).formula
    except InputError:
        return ""
    return next((place.partition(":")[0] for place in (DC, TERMINALS) if place in formula), "")


@dataclass(frozen=True)
class Validation:
    """Two prototypes beside each other, signal by signal and figure by figure, with doubts."""

    pair: Pair
    signals: tuple[SignalComparison, ...]
    figures: tuple[FigureComparison, ...]
    # Lower and upper 95 % limit of the reference on the common axis, by channel.
    bands: Mapping[str, Limits]
    findings: tuple[Finding, ...]

    @property
    def judged(self) -> tuple[SignalComparison, ...]:
        """The signals that are evidence."""
        return tuple(s for s in self.signals if s.verdict not in NO_EVIDENCE)

    @property
    def judged_figures(self) -> tuple[FigureComparison, ...]:
        """The figures that are evidence."""
        return tuple(f for f in self.figures if f.verdict not in NO_EVIDENCE)


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
    """Judge two aligned records, or a part of them, signal by signal and figure by figure."""
    bands = bands_on_axis(reference, pair)
    powered = replace(reference, record=with_powers(reference.record, motor))
    signals = []
    for channel in sorted(pair.ours, key=place):
        scale, band = scale_of(channel, pair, powered.record, motor), bands.get(channel)
        unknown = combined_uncertainty(
            channel, scale, with_powers(test, motor), powered, band, motor
        )
        tolerance = tolerance_of(channel, scale, unknown, given)
        is_input = channel in reference.inputs
        signals.append(_compare(pair, channel, tolerance, band, is_input=is_input))
    from_s, to_s = float(pair.time_s[0]), float(pair.time_s[-1])
    shift_s = pair.offset.offset_s
    figures = compare_figures(
        within(test, from_s, to_s), within(reference.record, from_s - shift_s, to_s - shift_s),
        motor, signals, given, reference.inputs,
    )  # fmt: skip
    findings = (*pair.findings, *_not_used(given, pair, figures))
    return Validation(pair, tuple(signals), figures, bands, findings)


def align(test: Record, reference: Reference, motor: Motor, offset_s: float | None) -> Pair:
    """Return the pair at an offset that is given, brought along by the reference, or found.

    The inputs in a simulated record are means over the step before each stamp, its temperatures
    those at the stamp: a search by the inputs is off by half a step for the temperatures. So the
    offset that such a record brings along holds where the search is within a step of it.

    Raises:
        InputError: As `validate`.
    """
    if offset_s is not None:
        return pair_records(test, reference.record, motor, offset_s=offset_s)
    if reference.run:
        known_s, method = 0.0, "none to be found: the test itself drove the run"
    else:
        pair = pair_records(test, reference.record, motor)
        found_s, known_s = pair.offset.offset_s, reference.starts_at_s
        if known_s is None or abs(found_s - known_s) > median_step(samples(reference.record)[0]):
            return pair
        method = (
            "the first stamp of the reference, which was simulated on the clock of a test (a "
            f"search gives {found_s:+.2f} s, within a step of it)"
        )
    pair = pair_records(test, reference.record, motor, offset_s=known_s)
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
