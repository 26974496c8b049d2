"""What is fed with hostile bytes: each target takes bytes and lets our own errors alone come out.

`TARGETS` holds for each a function and seeds: whole files from which mutation starts. Used by
the property-based tests and by the coverage-guided campaign.
"""

import hashlib
import io
import json
import struct
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import scipy.io

import heatrun.model
from heatrun.errors import InputError
from heatrun.model.network_text import network_named, network_of, network_text
from heatrun.motor.file import load_motor
from heatrun.posterior.ensemble import Checkpoint
from heatrun.readers.read import read_record
from heatrun.reports.of_run import rewrite_sheet
from heatrun.runs.run import open_run
from heatrun.simulation import parameters_from

sys.path.insert(0, str(Path(__file__).parents[1] / "readings"))

from reading_corpus.grammar import stated
from reading_corpus.oracle import MISREAD, TRACEBACK, judge

FOLDER = Path(tempfile.mkdtemp(prefix="heatrun-fuzz-"))
NETWORKS = Path(heatrun.model.__file__).parent / "networks"
REFERENCE = Path(__file__).parents[2] / "data" / "synthetic"
TABLE = "t,Is,Pd,Te,Tw_m\n0.0,10.5,300.0,21.5,22\n0.5,11.0,310.0,21.5,23\n1.0,-1e1,305.5,21.5,23\n"
GERMAN = '"Gerät: 1"\nZeit [s];Strom [A];"T Wicklung [°C]"\n0,0;1,5;22,1\n0,5;1,75;22,2\n'
CLOCK = "time;I;T [degC]\n2024-05-01 10:00:00,5;1;22\n2024-05-01 10:00:01,0;2;23\n"
ODD = ('"', "a,b\n1e999,2\n", "a,b\n１,２\n", "d,b\n00/00/2020 00:00,1\n99/99/2020 24:00,1\n")
MAT_HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


@dataclass(frozen=True)
class Target:
    """Something that reads bytes."""

    run: Callable[[bytes], None]  # Takes the bytes; anything but a quiet end is a fault.
    seeds: tuple[bytes, ...]  # Whole files.


def record(suffix: str, *, start: bytes = b"") -> Callable[[bytes], None]:
    """Return a function that reads bytes as a bench file."""
    path = FOLDER / f"input.{suffix}"

    def run(data: bytes) -> None:
        path.write_bytes(start + data)
        with suppress(InputError):
            found = read_record(path)
            for name, values in found.channels.items():
                assert values.dtype == np.float64, name
                assert values.shape == found.time_s.shape, name
                assert not np.isinf(values).any(), name

    return run


def packed_mat(data: bytes) -> None:
    """Read bytes as the content of a compressed variable of a MATLAB 5 file."""
    packed = zlib.compress(data, 1)
    record("mat")(MAT_HEADER + struct.pack("<II", 15, len(packed)) + packed)


def motor(data: bytes) -> None:
    path = FOLDER / "motor.toml"
    path.write_bytes(data)
    with suppress(InputError):
        load_motor(path)


def channel_map(data: bytes) -> None:
    """Read bytes as the `[columns]` of a motor file, and a table with it."""
    path, table = FOLDER / "map.toml", FOLDER / "mapped.csv"
    path.write_bytes(b'[motor]\nname = "m"\n[columns]\n' + data)
    table.write_text(GERMAN, encoding="utf-8")
    with suppress(InputError):
        read_record(table, load_motor(path))


def result(data: bytes) -> None:
    """Read bytes as the fit.json of a run whose manifest lists it rightly."""
    run = FOLDER / "run"
    run.mkdir(exist_ok=True)
    (run / "fit.json").write_bytes(data)
    listing = {"files": {"fit.json": hashlib.sha256(data).hexdigest()}}
    (run / "manifest.json").write_text(json.dumps(listing))
    with suppress(InputError):
        rewrite_sheet(run, FOLDER / "again")
    with suppress(InputError):
        open_run(run).draws()


def manifest(data: bytes) -> None:
    run = FOLDER / "listed"
    run.mkdir(exist_ok=True)
    (run / "fit.json").write_bytes(b"{}")
    (run / "manifest.json").write_bytes(data)
    with suppress(InputError):
        open_run(run)


def parameters(data: bytes) -> None:
    """Read bytes as a TOML file of parameters."""
    path = FOLDER / "parameters.toml"
    path.write_bytes(data)
    with suppress(InputError):
        values = parameters_from(path, network_named("second"))
        assert all(np.isfinite(value) for value in values.values()), values
        assert all(values[name] > 0 for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")), values


def network(data: bytes) -> None:
    """Read bytes as the TOML file of a network, and as the model of a run."""
    path = FOLDER / "network.toml"
    path.write_bytes(data)
    with suppress(InputError):
        form = network_named(str(path))
        assert form.body[0] in form.names
        assert asdict(network_of(network_text(form), "again")) == asdict(form)
    run = FOLDER / "modelled"
    run.mkdir(exist_ok=True)
    files = {"fit.json": FIT, "model_second.toml": data}
    for name, content in files.items():
        (run / name).write_bytes(content)
    listing = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    (run / "manifest.json").write_text(json.dumps({"files": listing}))
    with suppress(InputError):
        open_run(run).model()


def checkpoint(data: bytes) -> None:
    """Read bytes as the first chunk of a chain; what is taken up must be whole."""
    folder = FOLDER / "chunks"
    folder.mkdir(exist_ok=True)
    (folder / "chunk_00000.npz").write_bytes(data)
    for chunk in Checkpoint(folder, "key").load():
        assert np.isfinite(chunk["chain"]).all()
        assert chunk["coords"].shape == chunk["chain"].shape[1:]


def statement(data: bytes) -> None:
    """Read the file that bytes choose from the grammar; it says what its values are."""
    outcome = judge(stated(data), FOLDER, physics=False)
    if outcome.verdict in (MISREAD, TRACEBACK):
        raise AssertionError(f"{outcome.verdict}: {outcome.case.name}: {outcome.said}")


def mat5() -> bytes:
    """Return a MATLAB 5 file with vectors, one of them stored in fewer bytes, and a struct."""
    buffer = io.BytesIO()
    time = np.arange(8.0)
    signal = {"values": time[:, None], "label": "T_w", "dimensions": 1.0}
    scope = {"time": time[:, None], "signals": signal}
    columns = {"t": time, "Is": time * 2, "note": "text", "Te": 21.0}
    scipy.io.savemat(buffer, {**columns, "simout": scope})
    return buffer.getvalue()


def netcdf() -> bytes:
    """Return a classic netCDF file with two vectors that state their units."""
    buffer = io.BytesIO()
    file = scipy.io.netcdf_file(buffer, "w")
    file.createDimension("time", 8)
    for name, unit in (("time", "h"), ("T_winding", "K")):
        item = file.createVariable(name, "f4", ("time",))
        item[:] = np.arange(300.0, 308.0)
        item.units = unit
    file.flush()
    return buffer.getvalue()


def workbook() -> bytes:
    """Return an Excel workbook whose parts are stored unpacked, where mutation reaches them."""
    buffer = io.BytesIO()
    columns = {"time_s": np.arange(8.0), "winding_degC": 20.0 + np.arange(8.0)}
    pd.DataFrame(columns).to_excel(buffer, index=False, engine="openpyxl")
    return stored(buffer.getvalue())


def hdf5() -> bytes:
    """Return an HDF5 file with two vectors, one of them packed."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["t"] = np.arange(8.0)
        file.create_dataset("Is", data=np.ones(8), chunks=(4,), compression="gzip")
    return buffer.getvalue()


def parquet() -> bytes:
    """Return a small Parquet table."""
    buffer = io.BytesIO()
    columns = {"t": np.arange(8.0), "Is": np.ones(8), "name": ["a"] * 8}
    pyarrow.parquet.write_table(pyarrow.table(columns), buffer)
    return buffer.getvalue()


def mdf(compression: int = 0, version: str = "4.10") -> bytes:
    """Return an MDF 4 file with two rates, a conversion, a text and invalid samples."""
    import asammdf

    fast, slow = np.arange(0.0, 2.0, 0.1), np.arange(4.0)
    file = asammdf.MDF(version=version)
    file.append([
        asammdf.Signal(np.sin(fast), fast, name="phase_current_A", unit="A"),
        asammdf.Signal((100 * fast).astype("u2"), fast, name="losses_W", unit="W",
                       invalidation_bits=fast >= 1.5),
    ])  # fmt: skip
    conversion = {"a": 2.0, "b": 293.15}
    file.append([
        asammdf.Signal(slow, slow, name="winding", unit="K", conversion=conversion),
        asammdf.Signal(np.full(4, b"abc"), slow, name="note", encoding="utf-8"),
    ])  # fmt: skip
    path = FOLDER / "made.mf4"
    file.save(path, overwrite=True, compression=compression)
    file.close()
    return path.read_bytes()


def tdms() -> bytes:
    """Return a TDMS file with two groups, a waveform, a text and two segments."""
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    properties = {"unit_string": "A", "wf_increment": 0.5, "wf_start_offset": 0.0}
    with TdmsWriter(buffer) as writer:
        for first in (0.0, 4.0):
            writer.write_segment(
                [
                    ChannelObject("Drive", "phase_current_A", first + np.arange(4.0), properties),
                    ChannelObject("Rig", "Time", first + np.arange(4.0)),
                    ChannelObject("Rig", "winding_degC", np.arange(4, dtype=np.int16)),
                    ChannelObject("Rig", "note", ["a", "b", "c", "d"]),
                ]
            )
    return buffer.getvalue()


def chunk() -> bytes:
    """Return a whole chunk of a chain."""
    folder = FOLDER / "made"
    rng = np.random.RandomState(1)
    chain = rng.standard_normal((3, 4, 2))

    class State:
        coords = chain[-1]
        log_prob = np.zeros(4)
        random_state = rng.get_state()

    Checkpoint(folder, "key").save(0, chain, np.zeros((3, 4)), State())  # type: ignore[arg-type]
    return (folder / "chunk_00000.npz").read_bytes()


def stored(data: bytes) -> bytes:
    """Return a zip archive with its members stored unpacked, where mutation reaches them."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(buffer, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return buffer.getvalue()


FIT = (Path(__file__).parents[1] / "stored" / "fit-1.json").read_bytes()

FOUR = """format = "heatrun-model/1"
effects = []
[network]
name = "four"
nodes = ["winding", "tooth", "yoke", "rotor"]
sinks = ["coolant"]
links = [["winding", "tooth"], ["tooth", "yoke"], ["tooth", "rotor"], ["yoke", "coolant"]]
losses = { copper = "winding", iron = ["tooth", "yoke"], mechanical = "rotor" }
sensors = { winding_degC = "winding", stator_degC = "yoke" }
[parameters.Ceq_w]
capacitance = "winding"
value = 600.0
[losses]
kind = "balance"
phases = 3
reference_temperature_degC = 25.0
coefficient_degC = 234.5
[fitted]
tests = [{ name = "a", parameters = [0] }]
[[fitted.parameters]]
name = "Ceq_w"
unit = "J/K"
meaning = ""
role = "network"
transform = "log"
centre = 1.0
sd = 1.0
basis = ""
per_test = false
"""

TARGETS: dict[str, Target] = {
    "statement": Target(statement, (b"", bytes(40), bytes(range(40)), bytes(range(0, 240, 6)))),
    "text": Target(record("csv"), tuple(text.encode() for text in (TABLE, GERMAN, CLOCK, *ODD))),
    "gzip": Target(
        record("csv.gz", start=b"\x1f\x8b"), (zlib.compress(TABLE.encode(), wbits=31)[2:],)
    ),
    "mat5": Target(record("mat"), (mat5(),)),
    "mat5 packed": Target(packed_mat, (mat5()[128:],)),
    "hdf5": Target(record("mat", start=b"\x89HDF\r\n\x1a\n"), (hdf5()[8:],)),
    "parquet": Target(record("parquet", start=b"PAR1"), (parquet()[4:],)),
    "netcdf": Target(record("nc", start=b"CDF"), (netcdf()[3:],)),
    "excel": Target(record("xlsx", start=b"PK"), (workbook()[2:],)),
    "motor file": Target(motor, ((REFERENCE / "motor.toml").read_bytes(),)),
    "channel map": Target(
        channel_map, (b'winding_degC = "T Wicklung [degC]"\ntime_s = "rate 10 Hz"\n',)
    ),
    "fit.json": Target(result, (FIT,)),
    "manifest.json": Target(manifest, (b'{"files": {"fit.json": "00"}}',)),
    "parameters": Target(
        parameters, (b"Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n",)
    ),
    "network": Target(network, (FOUR.encode(), (NETWORKS / "second.toml").read_bytes())),
    "checkpoint": Target(checkpoint, (chunk(), stored(chunk()))),
}  # fmt: skip
if find_spec("asammdf"):
    files = mdf(), mdf(2), mdf(version="4.20")
    TARGETS["mdf"] = Target(record("mf4", start=b"MDF     "), tuple(file[8:] for file in files))
if find_spec("nptdms"):
    TARGETS["tdms"] = Target(record("tdms", start=b"TDSm"), (tdms()[4:],))
