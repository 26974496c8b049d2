"""Signals in structs, matrices and groups, and logs of raw bus frames."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from .case import Case, Truth
from .table import Sheet
from .unseen_file import made

CAUSE, FRAMES = "containers", "raw bus frames"
UNITS = ("s", "A", "kW", "degC", "degC")
HEADS, KEYS = "elapsed|Irms|Ploss|Troom|Tcoil", "- - kW - -"


def columns_of(sheet: Sheet, form: str) -> dict[str, str]:
    """Return `[columns]`: each a form of the name, the number and the unit of a column."""
    return {
        column.channel: form.format(name=column.header, k=k, k0=k - 1, unit=unit)
        for k, (column, unit) in enumerate(zip(sheet.columns, UNITS, strict=True), 1)
    }


def structs(*fields: dict[str, Any]) -> np.ndarray:
    """Return a MATLAB array of structs."""
    found = np.empty((1, len(fields)), dtype=[(name, object) for name in fields[0]])
    for k, one in enumerate(fields):
        for name, value in one.items():
            found[0, k][name] = value
    return found


def matlab(content: dict[str, Any]) -> Callable[[Path], None]:
    """Return what writes a MATLAB 5 file."""
    return lambda path: scipy.io.savemat(path, content, oned_as="column")


def stacked(vectors: dict[str, np.ndarray], first: int = 0) -> np.ndarray:
    """Return vectors as columns, from one of them on."""
    return np.column_stack(list(vectors.values())[first:])


def scope(vectors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return what a scope of Simulink logs."""
    signals = structs(*({"values": values, "label": name, "title": ""}
                        for name, values in list(vectors.items())[1:]))  # fmt: skip
    return {"ScopeData": {"time": vectors["elapsed"], "signals": signals, "blockName": "m/S"}}


def one_signal(vectors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return a signal of four columns with its time."""
    signals = {"values": stacked(vectors, 1), "label": ""}
    return {"yout": {"time": vectors["elapsed"], "signals": signals}}


def capture(vectors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return what ControlDesk captures."""
    axes = [
        {"Name": f'"{name}"' if not k else name, "Data": values, "Unit": unit}
        for k, ((name, values), unit) in enumerate(zip(vectors.items(), UNITS, strict=True))
    ]
    return {"rec_004": {"X": axes[0], "Y": structs(*axes[1:]), "Capture": "CLOCK"}}


def cell(vectors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return a cell of vectors."""
    made = np.empty(5, dtype=object)
    for k, values in enumerate(vectors.values()):
        made[k] = values
    return {"sig": made}


MAT: tuple[tuple[str, Callable[[dict[str, np.ndarray]], dict[str, Any]], str, str | None], ...] = (
    ("prova of an Italian bench", lambda v: {"prova": {"operatore": "Neri", **v}},
     "prova.{name} [{unit}]", None),
    ("a struct three levels down",
     lambda v: {"bench": {"cfg": {"gain": np.arange(4.0)}, "slow": {"daq": v}}},
     "bench.slow.daq.{name} [{unit}]", None),
    ("a struct of rows beside scalars", lambda v: {"fs": 0.2, "d": {
        **{name: values[None, :] for name, values in v.items()}, "B": 234.5}},
     "d.{name} [{unit}]", None),
    ("a scope of Simulink", scope, "{name} [{unit}]", "ScopeData.time [s]"),
    ("Simulink, one signal of four columns", one_signal, "yout.signals.values(:,{k0}) [{unit}]",
     "yout.time [s]"),
    ("a capture of ControlDesk", capture, "{name}", ""),
    ("a matrix of N rows", lambda v: {"M": stacked(v)}, "M(:,{k}) [{unit}]", None),
    ("a matrix of N columns", lambda v: {"log": stacked(v).T}, "log({k},:) [{unit}]", None),
    ("a cell of vectors", cell, "sig({k}) [{unit}]", None),
)  # fmt: skip
"""Name, content of the vectors, form of `[columns]`, and that of the time where it is another."""


def mat_files() -> Iterator[Case]:
    """Make what MATLAB, Simulink and dSPACE save."""
    for number, (name, content, form, time) in enumerate(MAT, 1300):
        sheet = made(number, HEADS, KEYS)
        columns = columns_of(sheet, form)
        if time is not None:
            del columns["time_s"]
            columns |= {"time_s": time} if time else {}
        written = matlab(content({column.header: column.numbers for column in sheet.columns}))
        yield sheet.case(CAUSE, name, Truth.READ, written, suffix=".mat", columns=columns)


def hdf_files() -> Iterator[Case]:
    """Make HDF5 files with groups of their own, and MATLAB 7.3."""
    n = count(1320)
    for name, form, write in (
        ("two groups of a rig", "{place}/{name} [{unit}]", _two_groups),
        ("a table of records", "bench/rows/{name} [{unit}]", _records),
        ("a struct of MATLAB 7.3", "run.{name} [{unit}]", _struct_7_3),
        ("units at each data set of a deep group", "a/b/c/{name}", _deep),
    ):
        sheet = made(next(n), HEADS, KEYS)
        columns = {
            column.channel: form.format(name=column.header, unit=unit,
                                        place="rig/heat" if k > 2 else "rig/drive")
            for k, (column, unit) in enumerate(zip(sheet.columns, UNITS, strict=True))
        }  # fmt: skip

        def content(path: Path, sheet: Sheet = sheet, write: Callable = write) -> None:
            with h5py.File(path, "w", userblock_size=512) as file:
                write(file, sheet)

        suffix = ".mat" if "MATLAB" in name else ".h5"
        yield sheet.case(CAUSE, name, Truth.READ, content, suffix=suffix, columns=columns)


def _two_groups(file: h5py.File, sheet: Sheet) -> None:
    for k, column in enumerate(sheet.columns):
        place = "rig/heat" if k > 2 else "rig/drive"
        file[f"{place}/{column.header}"] = column.numbers


def _records(file: h5py.File, sheet: Sheet) -> None:
    kinds = [(column.header, "f8") for column in sheet.columns]
    rows = np.zeros(len(sheet.columns[0].numbers), dtype=[*kinds, ("state", "S6")])
    for column in sheet.columns:
        rows[column.header] = column.numbers
    file["bench/rows"] = rows


def _struct_7_3(file: h5py.File, sheet: Sheet) -> None:
    group = file.create_group("run")
    group.attrs["MATLAB_class"] = np.bytes_("struct")
    for column in sheet.columns:
        item = group.create_dataset(column.header, data=column.numbers[None, :])
        item.attrs["MATLAB_class"] = np.bytes_("double")


def _deep(file: h5py.File, sheet: Sheet) -> None:
    for column, unit in zip(sheet.columns, UNITS, strict=True):
        file[f"a/b/c/{column.header}"] = column.numbers
        file[f"a/b/c/{column.header}"].attrs["unit"] = unit


LOGS: tuple[tuple[str, str, str], ...] = (
    ("candump with an interface", "", "({t:.6f}) slcan0 {id:03X}#{data}\n"),
    ("candump -x", "", " ({t:.6f})  can0  TX - -  {id:03X}   [8]  {bytes}\n"),
    ("python-can table", "timestamp,arbitration_id,extended,remote,error,dlc,data\n",
     "{t:.6f},0x{id:x},0,0,0,8,{base64}\n"),
    ("CANoe with events", "date Fri May 3 10:12:00.000 2024\nbase hex  timestamps relative\n"
     "internal events logged\n", "   0.010000 2  {id:X}x       Tx   d 8 {bytes}\n"),
    ("PCAN-View 2.0", ";$FILEVERSION=2.0\n;$STARTTIME=45415.425\n;$COLUMNS=N,O,T,I,d,l,D\n",
     "{i:7d} {t:13.3f} DT     {id:04X} Rx 8  {bytes}\n"),
    ("SavvyCAN", "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n",
     "{i}00000,{id:08X},true,Rx,1,8,{cells},\n"),
    ("CSS with semicolons", "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;"
     "DataBytes\n", "{t:.4f};2;{id:X};1;8;8;0;0;0;{data}\n"),
)  # fmt: skip


def frames() -> Iterator[Case]:
    """Make logs of buses that nobody has decoded."""
    import base64

    rng = np.random.default_rng(11)
    sheet = made(1340)
    for name, head, form in LOGS:
        lines = []
        for i in range(120):
            raw = rng.integers(0, 256, 8).astype("u1").tobytes()
            data = raw.hex(" ").upper()
            lines.append(form.format(
                i=i, t=1714731120.25 + 0.02 * i, id=0x1A0 + i % 4, data=data.replace(" ", ""),
                bytes=data, cells=data.replace(" ", ","), base64=base64.b64encode(raw).decode(),
            ))  # fmt: skip
        text = head + "".join(lines)
        yield sheet.case(FRAMES, name, Truth.REFUSE, text.encode(), channels={}, suffix=".log",
                         subject="raw bus frames")  # fmt: skip


SOURCES = (mat_files, hdf_files, frames)
