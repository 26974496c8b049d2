"""From a bench file to a record: reader, channel map, time axis, derived channels.

Measurement files are read channel by channel from the disk and never as a whole.
"""

import contextlib
import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..io.open_file import digest_of, open_input, read_stream, unzip
from ..io.quantities import as_printed
from ..record.channels import Columns, constant_notes, positive_rate, resistance_conflict
from ..record.derive import derive
from ..record.motor import Motor
from ..record.raster import at_own_rates, counted_from, exact_grid, from_first_sample
from ..record.record import Finding, Record, Source
from ..record.table import BLF, Table, no_signals, preamble_of, told_apart
from .channel_map import ITS_WORDS, ONLY_CLOCK, MappedColumns, map_columns
from .clock import unwrapped
from .dates import CLOCK_OF_DAY as CLOCK
from .dates import HEADER, HeaderDay, day_of, header_day, second_of_day
from .measurement import Measurement
from .multirate import read_all, read_measurement
from .text.reader import NO_HINTS, Hints, hints_of, missing_rows, with_missing_rows

MDF = (b"MDF     ", b"UnFinMF ")
TDMS = (b"TDSm",)


@contextlib.contextmanager
def opened(
    stream: BinaryIO, where: str, columns: Columns | None = None
) -> Iterator[Measurement | None]:
    """Open a measurement file for the time of the context; give None for a file of another format.

    Raises:
        InputError: If the file is a measurement and damaged, or the library for it is missing.
    """
    stream.seek(0)
    start = stream.read(8)
    stream.seek(0)
    if start.startswith(MDF):  # each reader loads a large library, so late
        from .mdf import open_mdf

        with open_mdf(stream, where) as measurement:
            yield measurement
    elif start.startswith(TDMS):
        from .tdms import open_tdms

        with open_tdms(stream, where, columns) as measurement:
            yield measurement
    else:
        yield None


ZIP = b"PK\x03\x04"
GZIP = b"\x1f\x8b"
HDF5 = b"\x89HDF\r\n\x1a\n"
NETCDF3 = (b"CDF\x01", b"CDF\x02")
HDF5_OFFSET = 512  # MATLAB writes its own header of this size in front
EXPECTED = "Expected CSV, MAT, Parquet, MDF, TDMS or Excel"
AS_CSV, UNPACKED = "Export the recording as CSV; only gzip is unpacked.", "Unpack it first."
OTHER_FORMATS = {
    b"\xd0\xcf\x11\xe0": (
        "an old spreadsheet, or one with a password", "Save it as .xlsx without a password."
    ),
    b"MDF     ": ("a packed MDF measurement file", UNPACKED),
    b"UnFinMF ": ("a packed MDF measurement file", UNPACKED),
    b"TDSm": ("a packed TDMS measurement file", UNPACKED),
    b"TDSh": ("the index of a TDMS file", "Give the TDMS file itself."),
    b"\x80\x04": ("a Python pickle", AS_CSV),
    b"\x80\x05": ("a Python pickle", AS_CSV),
    b"%PDF": ("a PDF document", AS_CSV),
    b"\xfd7zXZ\x00": ("an xz archive", AS_CSV),
    b"CDF\x05": (
        "a netCDF file with 64-bit data",
        "Convert it to netCDF 4, for example by: nccopy -k nc4 OLD.nc NEW.nc",
    ),
    b"BZh": ("a bzip2 archive", AS_CSV),
    b"SQLite format 3": ("an SQLite data base", AS_CSV),
    b"\x28\xb5\x2f\xfd": ("a zstd archive", AS_CSV),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", AS_CSV),
    b"Rar!": ("a RAR archive", AS_CSV),
}  # fmt: skip
"""First bytes of files that are no table for heatrun, what they are, and what to do about them."""


def read_raw(path: str | Path) -> Table:
    """Read a bench file under its own column names.

    The format is told from the content: text (CSV and the like), MATLAB 5 and 7.3, HDF5, netCDF 3
    and 4, Parquet, Excel; each of them also compressed by gzip; MDF 4 and TDMS.

    Of MDF and TDMS it is every channel, on the time axis of the slowest.

    Raises:
        InputError: If the file cannot be read as a table of numbers.
    """
    where = str(path)
    with open_input(path) as stream, opened(stream, where) as measurement:
        if measurement is not None:
            return read_all(measurement, where=where)
        return read_whole(stream, where)


def read_whole(stream: BinaryIO, where: str, hints: Hints = NO_HINTS) -> Table:
    """Read an open bench file that is no measurement file, under its own column names.

    Raises:
        InputError: As `read_raw`.
    """
    return _read_bytes(read_stream(stream, where), where, hints)


def read_record(
    path: str | Path,
    motor: Motor | None = None,
    *,
    rate_Hz: float | None = None,
    name: str | None = None,
    is_part: bool = False,
    sheet: str | None = None,
    is_from_first: bool = True,
) -> Record:
    """Read a bench file as a test with canonical channels.

    Args:
        path: The file.
        motor: The machine; its `[columns]` say which column is which channel, its phases and
            kind of losses how channels are derived.
        rate_Hz: Sampling rate for a file without a time column [Hz].
        name: Name of the test; by default the file's stem.
        is_part: The file is one of several of this test: columns that `[columns]` names may be in
            the others.
        sheet: Sheet of a workbook; by default the one with the channels.
        is_from_first: Times count from the first sample [s]; else as the file counts them.

    Returns:
        The record. Gaps, repeats and backward steps in its time stay as they are; channels that
        are missing are none of this function's business (see
        `heatrun.record.samples.require`).

    Raises:
        InputError: If the file cannot be read, a column is not what `[columns]` says, there is no
            time or no sample.
    """
    where = str(path)
    if rate_Hz is not None:
        positive_rate(rate_Hz, where)
    motor = motor or Motor("")
    columns = motor.columns_of(name_of_test(Path(path), sheet))
    with open_input(path) as stream, opened(stream, where, columns) as measurement:
        if measurement is not None:
            sha256 = digest_of(stream)
            table, mapped = read_measurement(
                measurement, motor, columns, where=where, is_part=is_part
            )
        else:
            data = read_stream(stream, where)
            sha256 = hashlib.sha256(data).hexdigest()
            hints = hints_of(columns, motor.decimal, where=where, sheet=sheet)
            table = _read_bytes(data, where, hints)
            mapped = map_columns(table, columns, where=where, is_part=is_part)
            if motor.raster_s is not None:
                unused = f"raster_s = {motor.raster_s:g} is for MDF and TDMS; "
                mapped.notes.append(f"{unused}the file keeps its times.")
    channels = dict(mapped.channels)
    time_s, origin_s, time_notes, missing = _time(
        mapped, table, rate_Hz, where, is_from_first=is_from_first
    )
    of_rows = time_s
    if time_s.size > table.num_rows and table.sample_numbers is not None:
        channels = with_missing_rows(channels, table.sample_numbers)
        of_rows = time_s[table.sample_numbers]
    differ = mapped.sensors_differ(of_rows)
    channels = {"time_s": time_s} | {key: channels[key] for key in channels if key != "time_s"}
    if measurement is None:
        channels, joined = at_own_rates(channels, where, is_by_tag=table.is_by_tag)
        missing = (*missing, *joined)
    channels, derived = derive(channels, phases=motor.phases, losses=motor.losses)
    test = name or name_of_test(Path(path), sheet)
    if not is_from_first:
        channels["time_s"] = channels["time_s"] + origin_s
    conflict = resistance_conflict(table.constants, motor, where)
    start = day_of(mapped.start)
    headed = HeaderDay() if start else header_day(preamble_of(table.notes))
    # cells of a column that no channel claims are no matter of the record
    idle = {f"{where}, column {name}" for name in mapped.unused}
    told = (replace(one, severity="note") if one.where in idle else one for one in table.findings)
    findings = (*told, *missing, *mapped.findings, *differ, *conflict)
    return Record(
        name=test,
        channels=channels,
        sources=(Source(where, sha256, table.reader),),
        notes=(
            *table.notes,
            *constant_notes(table.constants),
            *mapped.notes,
            *time_notes,
            *derived,
            *((headed.note,) if headed.note else ()),
        ),
        findings=tuple(replace(finding, test=test) for finding in findings),
        unused=mapped.unused,
        mapping=tuple(mapped.readings),
        decided=frozenset(mapped.decided),
        clock_s=second_of_day(mapped.start),
        start=start or headed.day,
        start_from=CLOCK if start else HEADER if headed.day else "",
    )


def _read_bytes(data: bytes, where: str, hints: Hints) -> Table:
    is_packed = data.startswith(GZIP)
    data = unzip(data, where) if is_packed else data
    table = _reader(data, where, hints)(data, where)
    return told_apart(replace(table, reader=f"{table.reader}{', gzip' * is_packed}"))


def _reader(data: bytes, where: str, hints: Hints) -> Callable[[bytes, str], Table]:
    """Return the reader for a content; imported here since each loads a large library."""
    for start, (kind, remedy) in OTHER_FORMATS.items():
        if data.startswith(start):
            raise InputError(f"{EXPECTED}, got {kind}.", where=where, remedy=remedy)
    if data.startswith(BLF):
        raise no_signals("BLF", where)
    if data.startswith(ZIP):
        from .workbook import read_excel

        return partial(read_excel, hints=hints)
    if hints.sheet is not None:
        raise InputError(
            f"The sheet '{hints.sheet}' is asked for, and the file is no Excel workbook.",
            where=where,
            remedy="Give the file without a sheet.",
        )
    if data.startswith(HDF5) or data[HDF5_OFFSET:].startswith(HDF5):
        from .mat import read_hdf5

        return read_hdf5
    if data.startswith(b"MATLAB 5.0") or (where.lower().endswith(".mat")):
        from .mat import read_mat

        return read_mat
    if data.startswith(NETCDF3):
        from .mat import read_netcdf3

        return read_netcdf3
    if data.startswith(b"PAR1"):
        from .stored import read_parquet

        return read_parquet
    from .text.reader import read_text

    return partial(read_text, hints=hints)


def is_text_table(data: bytes, where: str) -> bool:
    """Return whether a content, its first kilobyte will do, is read as a text table.

    Raises:
        InputError: If it is of a format that is not read at all.
    """
    from .text.reader import read_text

    if data.startswith((GZIP, *MDF, *TDMS)):
        return False
    reader = _reader(data, where, NO_HINTS)
    return isinstance(reader, partial) and reader.func is read_text


def _time(
    mapped: MappedColumns, table: Table, rate_Hz: float | None, where: str, *, is_from_first: bool
) -> tuple[np.ndarray, float, tuple[str, ...], tuple[Finding, ...]]:
    """Return times from the first sample and its own [s], notes on them, and what is missing."""
    rows = table.sample_numbers
    measured = mapped.channels.get("time_s")
    found_by = next((one.found_by for one in mapped.readings if one.channel == "time_s"), "")
    if rate_Hz is not None and found_by in (ONLY_CLOCK, ITS_WORDS):
        measured = None  # what is said goes before what was found
    if measured is not None:
        if rate_Hz is not None:
            raise InputError(
                f"The file has a time column; a rate of {rate_Hz:g} Hz would replace it.",
                where=where,
                remedy="Give no rate.",
            )
        if not np.isfinite(measured).any():
            raise InputError(
                "The time column holds no times.", where=where, remedy="Check [columns] time_s."
            )
        measured, turned = unwrapped(measured, "h")
        time_s, origin_s, lost_times = from_first_sample(measured)
        moved = counted_from(origin_s) if is_from_first and origin_s != 0.0 else ""
        shifted = " ".join(filter(None, (moved, lost_times)))
        time_s, gridded = exact_grid(time_s)
        ignored = "The rate in [columns] is not used: the file has its own time."
        turned = turned and f"The times are of a day{turned}."
        notes = (shifted, turned, gridded, ignored if mapped.rate_Hz is not None else "")
        lost = () if rows is None else (missing_rows(rows, None, time_s, where),)
        return time_s, origin_s, tuple(note for note in notes if note), lost
    rate = rate_Hz if rate_Hz is not None else mapped.rate_Hz
    if rate is None:
        names = ", ".join(column.name for column in table.columns)
        texts = f"; columns of text: {', '.join(table.text_columns)}" if table.text_columns else ""
        raise InputError(
            f"The file has no time column; its columns are: {names}{texts}.",
            where=where,
            remedy='Map it by [columns] time_s = "name [s]" in the motor file, a clock with its '
            'format as in "name [hh:mm:ss]", or give the sampling rate by time_s = "rate 10 Hz".',
        )
    note = f"time_s is made from a rate of {rate:g} Hz."
    if rows is None:
        return np.arange(table.num_rows) / rate, 0.0, (note,), ()
    time_s = np.arange(rows[-1] + 1) / rate
    return time_s, 0.0, (note,), (missing_rows(rows, rate, time_s, where),)


def name_of_test(path: Path, sheet: str | None = None) -> str:
    """Return the name of the test in a file, which figures, tables and messages print."""
    stem = Path(path.stem).stem if path.suffix.lower() == ".gz" else path.stem
    return as_printed(stem if sheet is None else f"{stem}_{sheet}")
