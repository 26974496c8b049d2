"""A test of a calibration, as it stands in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec import UNSET, UnsetType

from ..bench.record import ColumnReading
from .values import Count, Interval, NonNegative, Role


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedTest:
    """What is said of a test.

    Attributes:
        name: Its name in the run.
        role: Whether it was fitted or only predicted.
        path: Its first file as the user gave it; empty for a record that was made in memory.
        sha256: Digest of that file; empty likewise.
        reader: Which reader read it.
        stretch: The part of the files that was used, as it is written behind a file; unset
            for all.
        notes: What was converted, derived and reduced, in sentences.
        mapping: How each channel came about.
        duration_s: Its length [s].
        num_samples: Samples of the record.
        sample_s: Interval of the samples [s].
        step_s: Step of the simulation [s].
        block_s: Length of a block [s].
        rounding_K: Resolution of the winding's readings [K]; 0 if none is seen.
        start_degC: Mean of the winding's first readings [degC].
        current_A: Smallest and largest rms current [A]; null if not recorded.
        losses_W: Smallest and largest losses [W]; null if not recorded.
        speed_rpm: Smallest and largest speed [rpm]; null if not recorded.
        winding_degC: Lowest and highest winding temperature [degC]; null if not recorded.
        sink_degC: Lowest and highest temperature of the sink [degC]; null if not recorded.
        reduction_error_K: Error of reducing the record to blocks [K].
        start: Day on which it began by the clock or the header of the record, ISO 8601; unset where
            that has no date.
    """

    name: str
    role: Role
    path: str
    sha256: str
    reader: str = ""
    stretch: str | UnsetType = UNSET
    notes: tuple[str, ...] = ()
    mapping: tuple[ColumnReading, ...] = ()
    duration_s: NonNegative
    num_samples: Count
    sample_s: float | None
    step_s: float | None
    block_s: float | None
    rounding_K: float | None = None
    start_degC: float | None = None
    current_A: Interval | None
    losses_W: Interval | None
    speed_rpm: Interval | None
    winding_degC: Interval | None
    sink_degC: Interval | None
    reduction_error_K: float | None = None
    start: str | UnsetType = UNSET
