"""Records of the reference motor with more than its winding measured, from the simulated bench."""

import numpy as np

from heatrun.record.record import Record


def lagging(reading, lag_s, step_s):
    """A first-order lag in small explicit steps."""
    shown = np.empty_like(reading)
    shown[0] = reading[0]
    fine = 20
    for index in range(1, reading.size):
        value = shown[index - 1]
        for part in np.linspace(0.0, 1.0, fine, endpoint=False) + 0.5 / fine:
            now = reading[index - 1] + part * (reading[index] - reading[index - 1])
            value += step_s / fine / lag_s * (now - value)
        shown[index] = value
    return shown


def measured_record(generator, profile, seed, name="duty", *, stator=True, shaft_gain=None):
    """A record at 1 Hz.

    With `stator`, its sensor lags by 15 s, reads 1 % of the rise too much and 0.4 K too high.
    With `shaft_gain`, torque is measured, and the mechanical power is more than measured by that
    share of it.
    """
    machine = generator.reference_motor()
    truth = generator.simulate(machine, profile, sample_s=1.0, steps_per_sample=20)
    rng = np.random.default_rng(seed)
    columns = generator.measure(truth, rng, generator.Instruments(resolution_K=0.1))
    channels = {
        "time_s": columns["t"], "phase_current_A": columns["Is"], "losses_W": columns["Pd"],
        "ambient_degC": columns["Te"], "winding_degC": columns["Tw_m"],
        "speed_rpm": columns["speed_rpm"],
    }  # fmt: skip
    if stator:
        shown = lagging(truth.stator_degC, 15.0, 1.0)
        shown = shown + 0.01 * (shown - truth.ambient_degC) + 0.4
        noisy = shown + 0.15 * rng.standard_normal(shown.size)
        channels["stator_degC"] = 0.1 * np.rint(noisy / 0.1)
    if shaft_gain is not None:
        torque = 60.0 * profile.torque(truth.time_s)
        power = torque * truth.speed_rpm * np.pi / 30.0
        channels["torque_Nm"] = torque
        channels["losses_W"] = channels["losses_W"] + shaft_gain * power
    return Record(name, channels)
