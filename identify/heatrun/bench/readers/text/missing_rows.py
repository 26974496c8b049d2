"""Lines of a table that hold no sample: where time is counted by lines, they count."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...record import Finding

NUM_NAMED = 5  # so many spans stand in a message


def with_missing_rows(
    channels: Mapping[str, np.ndarray], sample_numbers: np.ndarray
) -> dict[str, np.ndarray]:
    """Return channels with NaN where lines without a sample stand in the file.

    Args:
        channels: Canonical name to values, shape (time,) of the lines with a sample.
        sample_numbers: Which sample each of these lines is, from 0, shape (time,).
    """
    filled = {}
    for name, values in channels.items():
        filled[name] = np.full(int(sample_numbers[-1]) + 1, np.nan)
        filled[name][sample_numbers] = values
    return filled


def missing_rows(
    sample_numbers: np.ndarray, rate_Hz: float | None, time_s: np.ndarray, where: str
) -> Finding:
    """Return the finding about lines without a sample: how many, and where in time.

    Args:
        sample_numbers: As `with_missing_rows`; at least one number is left out.
        rate_Hz: Sampling rate that time is made from [Hz], or None if the file has its own time.
        time_s: Times of the lines with a sample [s], shape (time,), if the file has its own.
        where: The file.
    """
    steps = np.diff(sample_numbers)
    before = np.flatnonzero(steps > 1)
    count = int(np.sum(steps[before] - 1))
    more = " and more" if before.size > NUM_NAMED else ""
    if rate_Hz is None:
        places = ", ".join(f"{time_s[row]:.6g} s" for row in before[:NUM_NAMED])
        return Finding(
            id="rows_missing",
            severity="note",
            message=f"{count} lines between the samples are empty or have another number of cells,"
            f" behind {places}{more}. The file's own times are not moved by them.",
            where=where,
            remedy="Export again if these samples matter.",
            values={"count": count, "from_s": float(time_s[before[0]])},
        )
    first, last = sample_numbers[before] + 1, sample_numbers[before + 1] - 1
    spans = ", ".join(
        f"{low / rate_Hz:.6g} s"
        if low == high
        else f"{low / rate_Hz:.6g} s to {high / rate_Hz:.6g} s"
        for low, high in zip(first[:NUM_NAMED], last[:NUM_NAMED], strict=True)
    )
    return Finding(
        id="rows_missing",
        severity="warning",
        message=f"{count} of {int(sample_numbers[-1]) + 1} samples are missing, at {spans}{more}: "
        "their lines are empty or have another number of cells. The time, made from a rate, goes "
        "on over them.",
        where=where,
        remedy="Export again if these samples matter, and with a time column.",
        values={"count": count, "from_s": float(first[0] / rate_Hz)},
    )
