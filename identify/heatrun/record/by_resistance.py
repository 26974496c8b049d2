r"""Temperature of a winding by its resistance (IEC 60034-1, 8.6.2).

$$ T = \frac{R - R_l}{R_0} (B + T_{ref}) - B $$

The mean over the winding, without the lag of a sensor. $R$ is what an ohmmeter shows, or direct
voltage over current, $R_l$ the leads in it and $R_0$ the same winding at the reference temperature.
"""

from __future__ import annotations

from collections.abc import Container

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from .derive import Channels, Derivation
from .motor import Motor
from .record import Record
from .stretch import windows

METER_SD, QUOTIENT_SD = 0.002, 0.005
"""Of a resistance [1]: four-wire ohmmeter; voltage and current of class 0.5 each (k = 1.7)."""

REFERENCE_SD = 0.01
"""Of the reference [1]: four-wire measurement, winding temperature known to 2 K (0.4 %/K)."""

LEADS_SD = 0.2
"""Of the leads [1]: measured or computed once, and some ten kelvin warmer under load."""

LEAST_CURRENT = 0.1
"""In parts of the largest current [1]: below, the offsets of class 0.5 are some ten kelvin."""

OPEN_OHM = 1e9
"""No winding has it; meters that are open write 9.9e37 [ohm]."""

SAME = 0.04
"""A cold winding and its sink agree to this share of the resistance [1], 10 K."""

COLD_SAMPLES = 5
"""Readings of which the lowest is the cold resistance [1]: windings warm, and a current that is
switched on shows more than the ohms."""

CIRCUITS = {
    1.0: "one phase",
    2.0: "two phases in series, as between terminals of a star",
    2.0 / 3.0: "one phase beside two, as between terminals of a delta",
    1.5: "one phase and two beside each other",
    3.0: "three phases in series",
    1.0 / 3.0: "three phases beside each other",
}
"""What may be measured, by its resistance over that of a phase [1]."""

LINE = "[winding] measured_resistance_ohm"


def with_winding(record: Record, motor: Motor) -> Record:
    """Return a record whose winding temperature follows from its resistance, where it may.

    A winding that a sensor has measured stays as it is. Where no current flows, voltage over
    current tells nothing: such windows are masked.

    Raises:
        InputError: If nothing says the resistance at a known temperature.
    """
    if "winding_degC" in record:
        return record
    measured = measured_resistance(record)
    if measured is None:
        return record
    ohm, how = measured
    if not np.isfinite(ohm).any():
        raise InputError(
            f"Expected resistances of the winding above 0 ({how}), got none.",
            where=record.name,
            remedy="Check the columns in [columns], or leave them out and map winding_degC.",
        )
    reference, known_by = _reference(record, motor, ohm)
    B, leads = motor.resistance_coefficient_degC, motor.lead_resistance_ohm
    winding = (ohm - leads) / reference * (B + motor.reference_temperature_degC) - B
    less = f" less {leads:g} ohm of leads" if leads else ""
    note = f"winding_degC follows from the resistance, {how}{less}; {known_by}."
    masks = record.masks
    if "winding_resistance_ohm" not in record:
        masks = (*masks, *windows(record.time_s, ~np.isfinite(ohm)))
    return record.having({"winding_degC": winding}, note, masks=masks)


def tells_winding(channels: Container[str]) -> bool:
    """Return whether the winding temperature follows from a resistance among channels."""
    return "winding_resistance_ohm" in channels or "winding_voltage_V" in channels


def by_resistance(record: Record) -> bool:
    """Return whether the winding temperature of a record follows from a resistance."""
    is_read = any(one.channel == "winding_degC" for one in record.mapping)
    return "winding_degC" in record and tells_winding(record) and not is_read


def sensor_sd(record: Record, motor: Motor) -> tuple[float, float] | None:
    """Return the standard uncertainty of a winding temperature by resistance; None for a sensor.

    An error of the resistance by a share of it is one of B + T by that share: an offset at the
    sink's temperature [K], and a relative error of the rise above it [1]. `[parameters.Rs0]` says
    how well the reference is known.
    """
    measured = measured_resistance(record) if by_resistance(record) else None
    if measured is None:
        return None
    above_B = motor.resistance_coefficient_degC + record["winding_degC"]
    of_meter = METER_SD if "winding_resistance_ohm" in record else QUOTIENT_SD
    gain = float(np.hypot(of_meter, resistance_sd(motor)))
    leads = motor.lead_resistance_ohm
    of_leads = LEADS_SD * leads * float(np.nanmedian(above_B / (measured[0] - leads)))
    sink = motor.resistance_coefficient_degC + float(np.nanmean(record[f"{motor.sink}_degC"]))
    return float(np.hypot(gain * sink, of_leads)), gain


def resistance_sd(motor: Motor) -> float:
    """Return the standard deviation of the phase resistance [1], as the motor file has it."""
    said = motor.parameters.get("Rs0")
    if said is None or motor.phase_resistance_ohm is None:
        return REFERENCE_SD
    if said.fixed is not None:
        return 0.0
    if said.relative_sd is not None:
        return said.relative_sd
    return REFERENCE_SD if said.sd is None else said.sd / motor.phase_resistance_ohm


def measured_resistance(record: Record) -> tuple[Float[np.ndarray, " time"], str] | None:
    """Return the resistance [ohm], NaN where it is none, and how it was measured; None without."""
    if "winding_resistance_ohm" in record:
        ohm = record["winding_resistance_ohm"]
        return _possible(ohm), "as the meter shows it"
    way = next((one for one in QUOTIENTS if one.is_open(record.channels)), None)
    return None if way is None else (way.compute(record.channels, 1), way.formula)


def quotient(
    volts: Float[np.ndarray, " time"], amperes: Float[np.ndarray, " time"]
) -> Float[np.ndarray, " time"]:
    """Return the resistance [ohm] by voltage [V] and current [A], NaN where too little flows."""
    flows = np.abs(amperes) > LEAST_CURRENT * np.nanmax(np.abs(amperes), initial=0.0)
    return _possible(np.divide(volts, amperes, out=np.full(amperes.shape, np.nan), where=flows))


def _quotient(current: str) -> Derivation:
    def compute(channels: Channels, _: int) -> np.ndarray:
        return quotient(channels["winding_voltage_V"], channels[current])

    needs = ("winding_voltage_V", current)
    return Derivation("winding_resistance_ohm", needs, compute, f"winding_voltage_V over {current}")


QUOTIENTS = tuple(map(_quotient, ("dc_current_A", "phase_current_A")))
"""Ways to a resistance that no meter shows, in order of preference."""


def _possible(ohm: Float[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
    """Return resistances [ohm], NaN for what is none: an open meter, a wire that is off."""
    return np.where((ohm > 0.0) & (ohm < OPEN_OHM), ohm, np.nan)


def _reference(record: Record, motor: Motor, ohm: Float[np.ndarray, " time"]) -> tuple[float, str]:
    """Return the resistance at the reference temperature, without leads [ohm], and how it is known;
    it must be stated.
    """
    at = f"at {motor.reference_temperature_degC:g} °C"
    if motor.measured_resistance_ohm is not None:
        known = motor.measured_resistance_ohm - motor.lead_resistance_ohm
        return known, f"reference {known:.5g} ohm {at}"
    cold = np.flatnonzero(np.isfinite(ohm))[:COLD_SAMPLES]
    sink = record.channels.get(f"{motor.sink}_degC", np.full(ohm.shape, np.nan))
    first = float(np.min(ohm[cold], initial=np.inf))
    sink_degC = float(np.nanmean(sink[cold])) if np.isfinite(sink[cold]).any() else np.nan
    ratio = float(motor.resistance_ratio(np.asarray(sink_degC)))
    if motor.phase_resistance_ohm is not None:
        times = (first - motor.lead_resistance_ohm) / (motor.phase_resistance_ohm * ratio)
        for factor, circuit in CIRCUITS.items():
            if abs(times / factor - 1.0) < SAME:
                known = factor * motor.phase_resistance_ohm
                return known, (
                    f"reference {known:.5g} ohm {at}: phase_resistance_ohm times {factor:.3g} "
                    f"({circuit}), which the cold reading of {first:.5g} ohm shows"
                )
    is_cold_known = np.isfinite(ratio)
    problem = "The winding's resistance was measured, and nothing says what it is cold."
    if motor.phase_resistance_ohm is not None and is_cold_known:
        problem = (
            f"The first reading is {first:.5g} ohm; phase_resistance_ohm gives "
            f"{motor.phase_resistance_ohm * ratio:.5g} ohm for one phase at the "
            f"{sink_degC:.1f} °C of the {motor.sink}, and no circuit of phases has that ratio."
        )
    leads = motor.lead_resistance_ohm
    line = f"{LINE} = {(first - leads) / ratio + leads:.5g}"
    soaked = f" If the winding was as cold as the {motor.sink} at first: {line}."
    raise InputError(
        problem,
        where=f"{record.name}, winding_resistance_ohm",
        remedy=f"State the resistance of the same circuit, leads included, {at}: {LINE}."
        f"{soaked if is_cold_known else ''} The resistance of a Pt100 or an NTC is no winding's: "
        "have the logger convert it.",
    )
