"""Do torque and power read zero when nothing turns and no current flows?

A balance of powers is a small difference of large ones: what the torque reads at rest stands in the
losses times the speed, and what the power reads stands in them as it is.
"""

from __future__ import annotations

import numpy as np

from ...io.quantities import rounded
from ...motor import Motor
from ..channels.derive import RAD_PER_S_PER_RPM
from ..record import Finding, Record
from .losses import STANDSTILL_RPM
from .samples import is_loaded, place, runs, samples

REST_SHARE = 0.02
"""Current at rest, in parts of its largest value [1]."""

RESTS_S = 30.0
"""Shortest stretch at rest that counts [s], and what is left out of it at either end [s]."""
SETTLES_S = 10.0

HARMFUL = 0.02
"""Share of the losses under load [1]: parameters are off by as much."""

SIGMAS = 6.0
"""Standard errors of the mean from which it is no noise [1]."""


def zero_offset(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report torque and electrical power that are not zero at rest, without current.

    Needs speed and current, losses from a balance, and half a minute of rest. A warning where it is
    more than `HARMFUL` of the losses under load.
    """
    if motor.losses != "balance":
        return ()
    found = []
    for name in ("torque_Nm", "electrical_power_W"):
        time_s, values, speed, current, losses = samples(
            record, name, "speed_rpm", "phase_current_A", "losses_W"
        )
        if time_s.size < 3:
            continue
        rests = (np.abs(speed) < STANDSTILL_RPM) & (
            np.abs(current) < REST_SHARE * float(np.quantile(np.abs(current), 0.99))
        )
        kept = np.zeros(time_s.size, dtype=bool)
        for a, b in zip(*runs(rests), strict=True):
            if time_s[b - 1] - time_s[a] >= RESTS_S:
                inner = time_s >= time_s[a] + SETTLES_S * (a > 0)
                inner &= time_s <= time_s[b - 1] - SETTLES_S
                kept |= inner & (np.arange(time_s.size) >= a) & (np.arange(time_s.size) < b)
        loaded = is_loaded(losses)
        if kept.sum() < 3 or not loaded.any():
            continue
        zero = float(np.mean(values[kept]))
        error = float(np.std(values[kept])) / np.sqrt(kept.sum())
        turning = float(np.median(np.abs(speed[loaded])))
        watts = abs(zero) * (turning * RAD_PER_S_PER_RPM if name == "torque_Nm" else 1.0)
        usual = float(np.median(losses[loaded]))
        if watts <= HARMFUL * usual or abs(zero) <= SIGMAS * error:
            continue
        from_s, to_s = float(time_s[kept][0]), float(time_s[kept][-1])
        found.append(_finding(record, name, zero, (watts, usual, turning), (from_s, to_s)))
    return tuple(found)


def _finding(
    record: Record,
    name: str,
    zero: float,
    under_load: tuple[float, float, float],
    span: tuple[float, float],
) -> Finding:
    watts, usual, turning = under_load
    is_torque = name == "torque_Nm"
    unit = "Nm" if is_torque else "W"
    seen = f"at {turning:.0f} rpm {rounded(watts)} W" if is_torque else f"{rounded(watts)} W"
    column = next((one.column for one in record.mapping if one.channel == name), "the column")
    remedy = f"Subtract {zero:.3g} {unit} from '{column}', or zero the instrument"
    remedy += (
        f". [parameters.torque_offset] sd = {max(abs(zero), 1e-9):.2g} lets the fit estimate it."
        if is_torque
        else "; where it is what an inverter takes at rest, it is no heat of the machine either."
    )
    return Finding(
        "zero_offset",
        "warning",
        f"Expected {name} 0 at rest without current; it reads {zero:+.3g} {unit}, {seen} of the "
        f"{rounded(usual)} W of losses under load ({100.0 * watts / usual:.0f} %).",
        place(record, name, *span),
        remedy,
        values={"zero": zero, "share_of_losses": watts / usual, "from_s": span[0]},
    )
