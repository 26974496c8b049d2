"""What a run says of a test, and the record of the other prototype that a report sets beside it.

A report names the digest of its files, so that they must still be the files it was made of. What
makes a comparison weaker than it looks, such as a simulation in place of a measured prototype, is
said on its first line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError
from heatrun.io.open_file import digest, is_pipe
from heatrun.io.own_files import SIMULATED
from heatrun.readers.read import read_raw, read_record
from heatrun.record.channels import CHANNELS
from heatrun.record.motor import Motor
from heatrun.record.record import Record, Source
from heatrun.record.samples import sink_channel
from heatrun.runs.run import open_run

from .analysis.pair import Pair


def refuse_changed(sources: Iterable[Source]) -> None:
    """Check that files on disk are those that were read.

    Raises:
        InputError: If a file is gone or holds other bytes than when it was read.
    """
    for source in sources:
        if is_pipe(source.path):  # it was read once and cannot be read again, nor replaced
            continue
        try:
            now = digest(source.path)
        except OSError as error:
            raise InputError(
                f"The file was there and cannot be opened any more ({error.strerror}).",
                where=source.path,
                remedy="Start again when nothing else writes to it.",
            ) from error
        if now != source.sha256:
            raise InputError(
                f"The file was replaced while it was read: SHA-256 {source.sha256[:16]} was read, "
                f"{now[:16]} lies there now.",
                where=source.path,
                remedy="Start again when the logger or the copy has finished.",
            )


SIDES = ("low", "high")
Limits = tuple[Float[np.ndarray, " time"], Float[np.ndarray, " time"]]


@dataclass(frozen=True)
class Reference:
    """The record that a test is compared with."""

    record: Record  # On its own clock.
    # Lower and upper 95 % limit by channel, on the record's time axis.
    bands: Mapping[str, Limits] = field(default_factory=dict)
    # Channels that drove a simulation, and say nothing of how good it is.
    inputs: frozenset[str] = frozenset()
    # Where the first sample of a simulated file lies on the clock of the bench test that it was
    # simulated along [s]; None for any other record.
    starts_at_s: float | None = None
    run: str = ""  # The run folder that was driven by the test; empty for a file.
    is_seen: bool = False  # Whether that run was calibrated on the test.
    # Whether it is given as a virtual prototype: whatever made it, no sensor did.
    is_model: bool = False

    @property
    def is_of_heatrun(self) -> bool:
        """Whether heatrun simulated it."""
        return self.starts_at_s is not None or bool(self.run)

    @property
    def is_simulated(self) -> bool:
        """Whether it is a simulation, by heatrun or another program."""
        return self.is_of_heatrun or self.is_model


def read_reference(path: Path, motor: Motor) -> Reference:
    """Read the record of the other prototype.

    A column that `[columns]` names and that this file lacks is no error, since prototypes are
    logged by different devices; canonical and known names are found as ever. A band is two columns
    such as `winding_95_low_degC` and `winding_95_high_degC`, in the unit of the channel.

    Raises:
        InputError: If the file cannot be read, or changes meanwhile.
    """
    record = read_record(path, motor, is_part=True)
    columns = {column.name.strip(): column.values for column in read_raw(path).columns}
    refuse_changed(record.sources)
    bands = {}
    for channel in CHANNELS:
        stem = channel.name.removesuffix(f"_{channel.unit}")
        names = [f"{stem}_95_{side}_{channel.unit}" for side in SIDES]
        if channel.name in record and all(name in columns for name in names):
            low, high = (np.asarray(columns[name], dtype=float) for name in names)
            bands[channel.name] = (low, high)
    is_ours = all(name in columns for name in ("time_s", *SIMULATED))
    return Reference(
        record=record,
        bands=bands,
        inputs=driving(motor) if is_ours else frozenset(),
        starts_at_s=float(columns["time_s"][0]) if is_ours else None,
    )


def reference_of_run(run: Path, record: Record, motor: Motor) -> Reference:
    """Return the winding and stator that a run says of a test, as the record of a prototype; the
    motor says how the bench of the test measures.

    Raises:
        InputError: As `heatrun.runs.run.Run.predict`.
    """
    found = open_run(run).predict(record, motor=motor)
    channels = {"time_s": found.time_s, "winding_degC": found.median}
    bands = {"winding_degC": found.total["95"]}
    stator = found.model.form.sensed("stator_degC")
    if stator is not None:
        channels["stator_degC"] = found.nodes[stator]
        bands["stator_degC"] = found.nodes_95[stator]
    return Reference(
        record=Record(f"run {run.name}", channels), bands=bands, inputs=driving(motor),
        run=str(run), is_seen=not found.is_held_out,
    )  # fmt: skip


def driving(motor: Motor) -> frozenset[str]:
    """Return the channels that drive a simulation of the network."""
    return frozenset(("phase_current_A", "losses_W", "speed_rpm", sink_channel(motor)))


def bands_on_axis(reference: Reference, pair: Pair) -> dict[str, Limits]:
    """Return the bands of a reference on the common axis of a pair, by channel."""
    clock = reference.record.time_s + pair.offset.offset_s
    return {
        channel: (_on_axis(pair.time_s, clock, low), _on_axis(pair.time_s, clock, high))
        for channel, (low, high) in reference.bands.items()
        if channel in pair.theirs
    }


def _on_axis(axis: np.ndarray, clock: np.ndarray, values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values) & np.isfinite(clock)
    if not known.any():
        return np.full(axis.size, np.nan)
    return np.interp(axis, clock[known], values[known], left=np.nan, right=np.nan)


def simulated_as(role: str, record: Record) -> str:
    """Return the sentence on a simulation in the place of a measured prototype; else nothing."""
    if not all(name in record.unused for name in SIMULATED):
        return ""
    return f"{record.name}, given as {role}, is a simulation by heatrun and no measured prototype."


def fitted_by(run: Path, record: Record) -> str:
    """Return the sentence on a record that a run was calibrated on; else nothing."""
    test = open_run(run).fitted_as(record)
    if test is None:
        return ""
    return (
        f"{record.name} is the calibration test {test} of the run {run.name} (same SHA-256): its "
        "agreement with the network is no validation."
    )


def same_file(first: Record, second: Record) -> str:
    """Return the sentence on two records of the same bytes; else nothing."""
    digests = [{source.sha256 for source in record.sources} for record in (first, second)]
    if not digests[0] or digests[0] != digests[1]:
        return ""
    return f"{first.name} and {second.name} are the same file (same SHA-256)."


def before(sentences: Iterable[str], summary: str) -> str:
    """Return a summary with what must be said first before it, each sentence once."""
    return " ".join([*dict.fromkeys(s for s in sentences if s), summary])
