"""MDF files as asammdf writes them, for the tests of the reader."""

from datetime import datetime

import numpy as np
import pytest

asammdf = pytest.importorskip("asammdf")
FAST = np.arange(0.0, 20.0, 0.1)
SLOW = np.arange(0.0, 20.0, 1.0)


def signal(name, values, time=SLOW, unit="", **options):
    return asammdf.Signal(np.asarray(values), time, name=name, unit=unit, **options)


def written(path, *groups, version="4.10", compression=0):
    """Write groups of signals, `(name, signals)` each."""
    file = asammdf.MDF(version=version)
    file.start_time = datetime(2025, 11, 20, 18, 2, 33)
    for name, signals in groups:
        file.append(signals, acq_name=name)
    file.save(path, overwrite=True, compression=compression)
    file.close()
    return path


def drive_and_temperatures(path, **options):
    """Two rates, a text, states and invalid samples."""
    drive = [
        signal("phase_current_A", 300.0 * np.sin(FAST), FAST, "A"),
        signal("losses_W", (FAST * 100).astype("u2"), FAST, "W", invalidation_bits=FAST >= 15.0),
    ]
    temperatures = [
        signal("ambient_degC", np.full(SLOW.size, 25.0), unit="degC"),
        signal("winding", SLOW, unit="K", conversion={"a": 2.0, "b": 293.15}),
        signal("state", (SLOW % 2).astype("u1"), conversion={"val_0": 0, "text_0": b"off",
               "val_1": 1, "text_1": b"on", "default": b"?"}),
        signal("note", np.full(SLOW.size, b"abc"), encoding="utf-8"),
    ]  # fmt: skip
    return written(path, ("Drive", drive), ("Rig", temperatures), **options)
