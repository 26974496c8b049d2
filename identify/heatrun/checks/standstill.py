"""At standstill all losses are copper losses: a check of the scales of current and losses.

A machine that turns hides an error of the current's scale: the copper loss changes with its square,
and the other losses take up the difference. At standstill there are no others (direct current or a
few hertz), so that current, losses and phase resistance must agree, and the losses over the squared
current must rise with the temperature as the winding's resistance does.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..io.quantities import off_by, part_of, rounded
from ..record.balance_errors import BLOCK_S, STANDSTILL_RPM
from ..record.by_resistance import CIRCUITS, by_resistance, measured_resistance, resistance_sd
from ..record.derive import DQ as AXES
from ..record.derive import WITH_INVERTER, constants_of, dq_power, formulas
from ..record.motor import COEFFICIENTS_degC, Motor
from ..record.record import Finding, Record
from ..record.samples import block_means, is_loaded, place, runs, samples

LASTS_S = 180.0
"""Shortest stretch that counts [s]: the filters of power meters and the regulation have settled."""

CURRENT_SD = 0.005
"""Of the current [1]: transducer and analyser of class 0.5 together; the loss has twice that."""

POWER_SD = 0.01
"""Of power, and of a voltage over a current [1]: class 0.5 at the small power factor and the low
voltage that a machine at standstill needs."""

RANGE_SD = 0.0005
"""Of power, in parts of the largest power of the record [1]: offset of an analyser of class 0.05
that keeps the range which the loaded machine needs."""

SENSOR_SD_K, SENSOR_SD_SHARE = 1.0, 0.05
"""Winding sensor against the mean of the winding [K], and in parts of the rise over the lowest
reading [1]: a sensor in the end winding reads more, one in the slot less."""

OF_LOSSES = ("speed_rpm", "phase_current_A", "losses_W", "winding_degC")
DQ = "u_d·i_d"
"""In the formula of losses that are derived from voltages and currents in d and q."""

DECISIVE = 2.0
"""Standard deviations from one that make the finding a warning [1]."""

FEWEST_BLOCKS = 6
"""Of a resistance at several temperatures."""

OF_WHAT = {
    **{factor: f"that of {circuit}" for factor, circuit in CIRCUITS.items() if factor != 1.0},
    0.5: "half that of one phase: a value of one phase is not to be halved",
}
"""What may stand as the resistance of a phase, over that [1]."""

APART = 0.12
"""Half the distance between two of them [1]: an instrument that may be off so far tells none."""

FAR = 10.0
"""Ratio from which a unit is wrong and not an instrument [1]."""


@dataclass(frozen=True)
class Agreement:
    """What current and resistance say of the power, over all stretches at standstill."""

    ratio: float  # Measured over expected [1].
    sd: float  # Its standard deviation, of the instruments and of scatter [1].
    from_s: float  # Begin of the first stretch [s].
    to_s: float  # End of the last one [s].
    lasts_s: float  # Time of all stretches together [s].
    current_A: float  # Root mean square of the current [A].

    @property
    def agrees(self) -> bool:
        """Whether the ratio is one within two standard deviations."""
        return abs(self.ratio - 1.0) <= DECISIVE * self.sd


def standstill_losses(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report how losses and current agree with the phase resistance while the machine stands still.

    A ratio of 2, 1.5, 2/3 or 1/2 names what may stand as `phase_resistance_ohm` instead: an error
    towards too small a resistance shows nowhere else, for the other losses take up the difference.

    Needs the speed, `phase_resistance_ohm`, and three minutes under current in one stretch. Losses
    from a map are no measurement, and those behind an inverter hold its own. Where the record has
    voltages and currents in d and q that the losses do not come from, their quotient is checked in
    the same way.
    """
    losses = _of_losses(record, motor)
    if losses is not None:
        # in losses from d and q the same current stands once more
        power = 1.0 if DQ in _formula(record) else 2.0
        yield _finding(record, motor, losses, "losses_W", "the losses", power)
    quotient = _of_voltage(record, motor)
    if quotient is not None:
        what = "the powers of voltage and current in d and q"
        yield _finding(record, motor, quotient, "u_q_V", what, 1.0)


@dataclass(frozen=True)
class Rise:
    """A resistance over the temperature of the winding, as a straight line."""

    zero_degC: float  # B at which it is no more, as the line says [degC].
    sd: float  # Relative standard deviation of B + T [1], of the sensor and of scatter.
    mean_degC: float  # Mean temperature [degC].
    span_degC: tuple[float, float]  # Lowest and highest temperature [degC].
    ohm: float  # At the mean temperature [ohm].

    def above(self, B: float) -> float:
        """Return its B + T over that of a stated B [1]."""
        return (self.zero_degC + self.mean_degC) / (B + self.mean_degC)

    def at(self, temperature_degC: float) -> float:
        """Return the resistance at a temperature [ohm]."""
        zero = self.zero_degC
        return self.ohm * (zero + temperature_degC) / (zero + self.mean_degC)


def resistance_coefficient(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a resistance that does not rise with the winding's temperature as B says.

    Needs a sensor in the winding, and beside it a meter of the resistance (or direct voltage and
    current), or the losses at standstill, where these agree with the phase resistance.
    """
    B = motor.resistance_coefficient_degC
    seen = _by_meter(record, motor)
    what, where = "the resistance that was measured", "winding_resistance_ohm"
    if seen is None:
        seen, what, where = _by_losses(record, motor), "losses_W/I² at standstill", "losses_W"
    if seen is None or abs(np.log(seen.above(B))) <= DECISIVE * seen.sd:
        return
    above, band = seen.above(B), DECISIVE * seen.sd
    usual = [name for name, known in COEFFICIENTS_degC.items()
             if abs(np.log(seen.above(known))) <= band]  # fmt: skip
    line = (
        "material = " + " or ".join(f'"{name}"' for name in usual)
        if usual
        else f"resistance_coefficient_degC = {seen.zero_degC:.0f}"
    )
    leads = "" if above < 1.0 or where == "losses_W" else (
        " Or leads that stay cold are in the reading: [winding] lead_resistance_ohm = "
        f"{rounded(motor.lead_resistance_ohm + seen.ohm * (1.0 - 1.0 / above), 2)}."
    )  # fmt: skip
    low, high = seen.span_degC
    uncertain = band * (seen.zero_degC + seen.mean_degC)
    right = replace(motor, resistance_coefficient_degC=seen.zero_degC)
    off = float(motor.resistance_ratio(np.asarray(high)) / right.resistance_ratio(np.asarray(high)))
    yield Finding(
        "resistance_coefficient",
        "warning",
        f"Expected the winding's resistance to rise with B = {B:g} °C; {what} rises with B = "
        f"{seen.zero_degC:.0f} ± {uncertain:.0f} °C (95 %) between {low:.0f} and {high:.0f} "
        f"°C. The copper loss at {high:.0f} °C is {abs(100.0 * (off - 1.0)):.0f} % too "
        f"{'high' if off > 1.0 else 'low'}.",
        place(record, where, *samples(record, "winding_degC")[0][[0, -1]]),
        f"Correct the material: [winding] {line}.{leads} If it is right, the sensor rises by "
        f"{rounded(above, 3)} K where the mean of the winding rises by 1 K: check its place.",
        values={"coefficient_degC": seen.zero_degC, "coefficient_sd_K": 0.5 * uncertain},
    )


def _by_meter(record: Record, motor: Motor) -> Rise | None:
    measured = None if by_resistance(record) else measured_resistance(record)
    if measured is None or "winding_degC" not in record:
        return None
    both = {"time_s": record.time_s, "winding": record["winding_degC"],
            "ohm": measured[0] - motor.lead_resistance_ohm}  # fmt: skip
    time_s, winding, ohm = samples(Record("", both), "winding", "ohm")
    _, winding, ohm = block_means(time_s, BLOCK_S, winding, ohm)
    return _rise(winding, ohm)


def _by_losses(record: Record, motor: Motor) -> Rise | None:
    agreement = _of_losses(record, motor)
    if agreement is None or motor.phase_resistance_ohm is None:
        return None
    time_s, speed, current, losses, winding = samples(record, *OF_LOSSES)
    copper = motor.copper_loss_W(current, winding)
    standing = _standing(time_s, speed, copper, losses, current**2, winding)
    if standing is None:
        return None
    _, kept, _, *beside = standing
    power, squared, temperature = (part[kept] for part in beside)
    linear = np.hypot(POWER_SD, 2.0 * CURRENT_SD) * np.std(squared) / np.mean(squared)
    seen = _rise(temperature, power / squared / motor.phases, float(linear))
    if seen is None:
        return None
    # leads, iron or another current shift the line: then B is not what is wrong
    stated = seen.at(motor.reference_temperature_degC) / motor.phase_resistance_ohm
    return seen if abs(stated - 1.0) <= DECISIVE * agreement.sd else None


def _rise(temperature: np.ndarray, ohm: np.ndarray, linear: float = 0.0) -> Rise | None:
    """Fit a line to blocks; scatter lasts, as that of a sensor that lags: it counts in full.

    `linear` is what instruments may be off between small and large values [1].
    """
    if temperature.size < FEWEST_BLOCKS:
        return None
    mean, spread, mean_ohm = (float(x) for x in (temperature.mean(), temperature.std(), ohm.mean()))
    slope = float(np.mean((temperature - mean) * ohm)) / spread**2 if spread > 0.0 else 0.0
    if not slope > 0.0 or not mean_ohm > 0.0:
        return None
    scatter = float(np.std(ohm - slope * temperature)) + linear * mean_ohm
    return Rise(
        zero_degC=mean_ohm / slope - mean,
        sd=float(np.hypot(SENSOR_SD_SHARE, scatter / (slope * spread))),
        mean_degC=mean,
        span_degC=(float(temperature.min()), float(temperature.max())),
        ohm=mean_ohm,
    )


def current_scale_unchecked(motor: Motor, records: Sequence[Record]) -> Iterator[Finding]:
    """Yield the note that no test of a calibration can show an error of the current's scale."""
    has_copper_loss = motor.phase_resistance_ohm is not None or "Rs0" in motor.parameters
    if not has_copper_loss or any(any(standstill_losses(record, motor)) for record in records):
        return
    yield Finding(
        "current_scale_unchecked",
        "note",
        "No test has three minutes at standstill under current, so that an error of the "
        "current's scale cannot be seen: 1 % of it changes the copper loss by 2 %, and the "
        "winding's Ceq_w and Req_w with it. The 95 % intervals allow for the class of the "
        "instrument that current_gain states, no more.",
        motor.path or motor.name,
        "A few minutes at standstill with a known direct current would show it, or the input "
        "power by a second instrument. Another class goes into [parameters.current_gain] sd.",
    )


def _of_losses(record: Record, motor: Motor) -> Agreement | None:
    """Losses over copper loss."""
    if motor.losses != "balance" or motor.phase_resistance_ohm is None:
        return None
    if WITH_INVERTER in _formula(record):
        return None
    instruments = float(np.hypot(POWER_SD, 2.0 * CURRENT_SD))
    return _agreement(record, motor, samples(record, *OF_LOSSES), instruments)


def _of_voltage(record: Record, motor: Motor) -> Agreement | None:
    """Voltage over current, as the power that it stands for."""
    if motor.phase_resistance_ohm is None or DQ in _formula(record):
        return None
    time_s, speed, winding, *axes = samples(record, "speed_rpm", "winding_degC", *AXES)
    channels: dict[str, np.ndarray] = dict(zip(AXES, axes, strict=True))
    current = np.hypot(channels["i_d_A"], channels["i_q_A"]) / np.sqrt(2.0)
    columns = (time_s, speed, current, dq_power(channels, motor.phases), winding)
    # one current stands in both powers: its error enters once
    return _agreement(record, motor, columns, float(np.hypot(POWER_SD, CURRENT_SD)))


def _formula(record: Record) -> str:
    """Return how the losses were derived, empty if they were measured."""
    read = {one.channel for one in record.mapping if one.unit_from != "derived"}
    given = read | constants_of(record.notes)
    return formulas(record.channels, given).get("losses_W", "")


def _agreement(
    record: Record, motor: Motor, columns: Sequence[np.ndarray], instruments: float
) -> Agreement | None:
    """Compare a power with the copper loss over the stretches at standstill; None without one.

    Columns are the time, and as `OF_LOSSES`.
    """
    time_s, speed, current, measured, winding = columns
    expected = motor.copper_loss_W(current, winding)
    standing = _standing(time_s, speed, expected, measured, current**2, winding)
    if standing is None:
        return None
    at, kept, copper, power, squared, temperature = standing
    total = float(np.sum(copper[kept]))
    ratio = float(np.sum(power[kept])) / total
    scatter = float(np.std(power[kept] - ratio * copper[kept])) * np.sqrt(kept.sum()) / total
    mean = total / float(kept.sum())
    # the largest power that the record holds, whose range the analyser may have kept
    powers = (samples(record, f"{name}_power_W")[1] for name in ("electrical", "mechanical"))
    widest = next((each for each in powers if each.size), measured)
    largest = max(float(np.quantile(np.abs(widest), 0.99)), mean)
    warm = temperature[kept].mean() - temperature.min()
    sensor_K = np.hypot(SENSOR_SD_K, SENSOR_SD_SHARE * warm)
    of_temperature = sensor_K / (motor.resistance_coefficient_degC + temperature[kept].mean())
    parts = (instruments, resistance_sd(motor), of_temperature, RANGE_SD * largest / mean, scatter)
    sd = float(np.sqrt(sum(part**2 for part in parts)))
    if not np.isfinite([ratio, sd]).all():
        return None
    where = np.flatnonzero(kept)
    return Agreement(
        ratio=ratio,
        sd=sd,
        from_s=float(at[where[0]]),
        to_s=float(at[where[-1]]),
        lasts_s=float(kept.sum()) * BLOCK_S,
        current_A=float(np.sqrt(np.mean(squared[kept]))),
    )


def _standing(
    time_s: np.ndarray, speed: np.ndarray, copper: np.ndarray, *beside: np.ndarray
) -> tuple[np.ndarray, ...] | None:
    """Return times, what is kept at standstill, and the channels, as blocks; None if none is."""
    if time_s.size < 2:
        return None
    at, speed, copper, *others = block_means(time_s, BLOCK_S, np.abs(speed), copper, *beside)
    stands = (speed < STANDSTILL_RPM) & is_loaded(copper)
    kept = np.zeros(stands.size, dtype=bool)
    for first, past in zip(*runs(stands), strict=True):
        # the blocks at either end may hold a part of what came before or after
        if at[past - 1] - at[first] + BLOCK_S >= LASTS_S and past - first > 3:
            kept[first + 1 : past - 1] = True
    return (at, kept, copper, *others) if kept.any() else None


def _leads(ratio: float) -> str:
    """Return what leads would take of the power, empty where there is none to take."""
    if ratio <= 1.0:
        return ""
    return (
        " Leads and contacts between the power meter and the winding would explain it by taking "
        f"{100.0 * (1.0 - 1.0 / ratio):.0f} % of the power: they heat no node of the network. "
        'Where only the copper is loaded, write losses = "map" and [constants] losses_W = 0.'
    )


def _of_what(seen: Agreement, motor: Motor) -> str:
    """Return what phase_resistance_ohm would be of, by the losses; empty where that is none."""
    near = min(DECISIVE * seen.sd, APART)
    told = (what for factor, what in OF_WHAT.items() if abs(seen.ratio * factor - 1.0) <= near)
    return next(told, "") if motor.phases == 3 else ""


def _finding(
    record: Record, motor: Motor, seen: Agreement, channel: str, what: str, power: float
) -> Finding:
    expected = "phases·R(T)·I²"
    band = 100.0 * DECISIVE * seen.sd
    stretch = f"over {seen.lasts_s / 60.0:.0f} min at {seen.current_A:.4g} A"
    where = place(record, channel, seen.from_s, seen.to_s)
    values = {
        "ratio": seen.ratio,
        "ratio_sd": seen.sd,
        "current_A": seen.current_A,
        "from_s": seen.from_s,
        "to_s": seen.to_s,
    }
    if seen.agrees:
        return Finding(
            "standstill_losses",
            "note",
            f"At standstill, {stretch}, {what} are {seen.ratio:.3f} of {expected}; the instruments "
            f"allow {band:.1f} % (95 %). This test checks the scale of current, losses and phase "
            "resistance together to that.",
            where,
            values=values,
        )
    is_of_units = not 1.0 / FAR < seen.ratio < FAR
    they_are = part_of(seen.ratio, "it") if is_of_units else f"{seen.ratio:.3f} of it"
    first = (
        f"Check the units of {what} and phase_current_A: instruments are not off by so much."
        if is_of_units
        else "Compare phase_current_A with a second instrument (reading "
        f"{off_by(seen.ratio ** (-1.0 / power))} explains this: {power:.0f} % per 1 %)."
    )
    else_, ohm = _of_what(seen, motor), motor.phase_resistance_ohm or 0.0
    if else_:
        values["phase_ohm"] = seen.ratio * ohm
        first = (
            f"Check phase_resistance_ohm: {rounded(seen.ratio * ohm, 3)} ohm per phase explains "
            f"this, and {rounded(ohm, 3)} ohm would then be {else_}. Or {first[:1].lower()}"
            f"{first[1:]}"
        )
    leads = "" if is_of_units else _leads(seen.ratio)
    # a rotor that is said to be locked says nothing of direct current
    is_said = "speed_rpm" in constants_of(record.notes) and motor.phases > 1
    may_alternate = is_said and seen.ratio > 1.0 and not is_of_units
    if may_alternate:
        first = (
            "Nothing need be done where the rotor is locked under alternating current: its bars "
            f"and the iron take the rest. Under direct current: {first[:1].lower()}{first[1:]}"
        )
    return Finding(
        "standstill_losses",
        "note" if may_alternate else "warning",
        f"Expected {what} equal to {expected} at standstill within {band:.1f} % (95 %, of the "
        f"instruments and Rs0); {stretch} they are {they_are}. The copper loss of the "
        "loaded tests, and with it Ceq_w and Req_w, is off by as much if the current or "
        "phase_resistance_ohm is the cause.",
        where,
        f"{first} Then compare {what} and phase_resistance_ohm with its temperature.{leads} "
        "With direct current the phases do not share it equally: phase_current_A must be the rms "
        "of the three.",
        values=values,
    )
