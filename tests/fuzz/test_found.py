"""Inputs and names that once ended in a traceback, a wrong number or without bound, kept."""

import gzip
import io
import json
import os
import re
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from heatrun.errors import InputError
from heatrun.io import open_file
from heatrun.model.network_text import network_named
from heatrun.motor.file import load_motor
from heatrun.posterior.ensemble import CONTENT, Checkpoint
from heatrun.readers import mat, mat5, stored
from heatrun.readers.read import read_raw, read_record
from heatrun.results import to_json
from heatrun.simulation import parameters_from

ROOT = Path(__file__).parents[2]
MAT_HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
GOOD = "Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n"


@pytest.mark.parametrize(
    "line",
    [
        f"phases = 1{'0' * 5000}",
        f"phases = 0x{'f' * 5000}",
        f"rated_speed_rpm = 0x{'f' * 5000}",
        f"rated_speed_rpm = {10**400}",
        "phases = 1000000000000",
        "rated_speed_rpm = -0x" + "f" * 400,
    ],
    ids=["digits", "hex", "hex_number", "too_large", "phases", "negative"],
)
def test_numbers_of_a_motor_file_beyond_any_machine(line, tmp_path):
    path = tmp_path / "motor.toml"
    path.write_text(f'[motor]\nname = "m"\n{line}\n')
    with pytest.raises(InputError):
        load_motor(path)


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("666.75", "-666.75"),
        GOOD.replace("0.14485", "0.0"),
        GOOD.replace("0.14485", "nan"),
        GOOD.replace("0.14485", "inf"),
        GOOD.replace("666.75", "9" * 400),
        f"parameters = 3\n{GOOD}",
        "a = " + "[" * 3000,
    ],
    ids=["negative", "zero", "nan", "inf", "digits", "section", "nested"],
)
def test_parameters_that_are_no_parameters(text, tmp_path):
    path = tmp_path / "parameters.toml"
    path.write_text(text)
    with pytest.raises(InputError):
        parameters_from(path, network_named("second"))


@pytest.mark.parametrize("times", [(-1.7e308, 1.7e308, 0.0), (0.0, 1.0, 1.7e308)])
def test_times_beyond_any_number_count_as_missing_and_are_named(times, tmp_path):
    path = tmp_path / "absurd.csv"
    path.write_text("t,Is\n" + "".join(f"{time!r},1\n" for time in times))
    record = read_record(path)
    assert not np.isinf(record.time_s).any()
    assert np.isnan(record.time_s).any() == (times[0] < 0.0)
    if times[0] < 0.0:
        assert any("too large for a number" in note for note in record.notes)


@pytest.mark.parametrize(
    "packed",
    [gzip.compress(b"1,2\n" * 2**20), gzip.compress(b"1,2\n" * 2**17) * 3],
    ids=["one member", "many small members"],
)
def test_a_gzip_bomb_is_refused_before_it_is_unpacked(packed, tmp_path, monkeypatch):
    monkeypatch.setattr(open_file, "LARGEST_BYTES", 2**20)
    path = tmp_path / "test.csv.gz"
    path.write_bytes(packed)
    with pytest.raises(InputError, match="more than 1 MB unpacked"):
        read_raw(path)


def test_a_file_of_two_gigabytes_is_refused_unread(tmp_path):
    path = tmp_path / "test.csv"
    with path.open("wb") as file:
        file.truncate(2**31)
    with pytest.raises(InputError, match=r"at most 1024 MB, got 2048 MB.*lower rate"):
        read_raw(path)


@pytest.mark.parametrize("start", [b"\xfd7zXZ\x00", b"BZh9", b"\x28\xb5\x2f\xfd", b"Rar!"])
def test_archives_are_named_and_left_packed(start, tmp_path):
    path = tmp_path / "test.csv"
    path.write_bytes(start + bytes(100))
    with pytest.raises(InputError, match=r"archive.*only gzip is unpacked"):
        read_raw(path)


def test_a_bomb_in_a_compressed_matlab_variable(tmp_path, monkeypatch):
    monkeypatch.setattr(mat5, "LARGEST_BYTES", 2**20)
    packed = zlib.compress(bytes(2**22))
    path = tmp_path / "test.mat"
    path.write_bytes(MAT_HEADER + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(InputError, match="more than 1 MB"):
        read_raw(path)


def _element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


@pytest.mark.parametrize("place", [0, 1, 2], ids=["flags", "shape", "name"])
def test_the_head_of_a_matlab_variable_in_floating_point(place, tmp_path):
    heads = [_element(6, bytes([6, 0, 0, 0] * 2)), _element(5, struct.pack("<2i", 3, 1)),
             _element(1, b"t")]  # fmt: skip
    values = _element(9, struct.pack("<3d", 0.0, 1.0, 2.0))
    path = tmp_path / "test.mat"
    path.write_bytes(MAT_HEADER + _element(14, b"".join([*heads, values])))
    assert mat5.read_variables(path.read_bytes())["t"].ravel().tolist() == [0.0, 1.0, 2.0]
    heads[place] = _element(9, struct.pack("<2d", np.nan, 1.0))
    path.write_bytes(MAT_HEADER + _element(14, b"".join([*heads, values])))
    with pytest.raises(InputError, match="stored as floating-point numbers"):
        read_raw(path)


def test_a_bomb_in_an_hdf5_file(tmp_path, monkeypatch):
    monkeypatch.setattr(mat, "LARGEST_NUMBERS", 10**6)
    path = tmp_path / "test.mat"
    with h5py.File(path, "w") as file:
        # a thousand gigabytes that take a kilobyte on disk: no chunk is ever written
        file.create_dataset("t", shape=(2**37,), dtype="f8", chunks=(2**20,), compression="gzip")
    with pytest.raises(InputError, match="137438953472 numbers"):
        read_raw(path)


def test_data_sets_that_lie_in_other_files_are_not_followed(tmp_path):
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["t"] = np.arange(5.0)
    raw = tmp_path / "raw.bin"
    raw.write_bytes(np.arange(5.0).tobytes())
    path = tmp_path / "test.mat"
    with h5py.File(path, "w") as file:
        file["own"] = np.arange(5.0)
        file["linked"] = h5py.ExternalLink(str(secret), "t")
        file.create_dataset("outside", shape=(5,), dtype="f8", external=[(str(raw), 0, 40)])
        layout = h5py.VirtualLayout(shape=(5,), dtype="f8")
        layout[:] = h5py.VirtualSource(str(secret), "t", shape=(5,))
        file.create_virtual_dataset("virtual", layout)
    table = read_raw(path)
    assert [column.name for column in table.columns] == ["own"]
    assert "linked (link to another file)" in table.findings[0].message


def test_a_bomb_in_a_parquet_table(tmp_path, monkeypatch):
    monkeypatch.setattr(stored, "LARGEST_NUMBERS", 10**6)
    path = tmp_path / "test.parquet"
    pyarrow.parquet.write_table(pyarrow.table({"t": np.zeros(2 * 10**6)}), path)
    with pytest.raises(InputError, match="2000000 numbers"):
        read_raw(path)


def test_a_row_group_that_claims_more_rows_than_the_table(tmp_path, targets):
    whole = b"PAR1" + targets["parquet"].seeds[0]
    claims = []
    for place in range(len(whole) - 8):  # the count in the footer, as a number of seven bits each
        changed = whole[:place] + bytes((240, 217, 247, 238)) + whole[place + 4 :]
        try:
            about = pyarrow.parquet.read_metadata(io.BytesIO(changed))
        except Exception:
            continue
        if about.num_rows == 8 and about.row_group(0).num_rows > 1e9:
            claims.append(changed)
    assert claims
    path = tmp_path / "claims.parquet"
    for changed in claims:
        path.write_bytes(changed)
        with pytest.raises(InputError, match="rows in its groups, 8 in all"):
            read_raw(path)


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "test.csv"
    path.write_text("time_s,winding_degC\n0,1\n1,2\n")
    fstat = open_file.os.fstat

    def growing(number):
        found = fstat(number)
        with path.open("a") as file:
            file.write("2,3\n")
        return found

    monkeypatch.setattr(open_file.os, "fstat", growing)
    with pytest.raises(InputError, match="changed while it was read"):
        read_record(path)


def test_a_checkpoint_of_a_zip_that_is_no_zip(tmp_path):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("key.npy", b"no array")
    content = bytearray(buffer.getvalue())
    # "version needed to extract" of the central directory: 101, which zipfile does not implement
    content[content.index(b"PK\x01\x02") + 6] = 101
    (tmp_path / "chunk_00000.npz").write_bytes(content)
    assert Checkpoint(tmp_path, "key").load() == []


@pytest.mark.parametrize("name", CONTENT)
def test_a_member_of_a_checkpoint_that_is_no_array(name, tmp_path, targets):
    whole = targets["checkpoint"].seeds[1]
    path = tmp_path / "chunk_00000.npz"
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(path, "w") as new:
        for member in old.namelist():
            content = old.read(member)
            new.writestr(member, b"no" + content if member == f"{name}.npy" else content)
    assert Checkpoint(tmp_path, "key").load() == []


def test_a_pickle_in_a_checkpoint_is_not_run(tmp_path):
    class Evil:
        def __reduce__(self):
            return (tmp_path.joinpath("ran").touch, ())

    names = ("key", "chain", "log_density", "coords", "coords_density", "random_keys",
             "random_rest")  # fmt: skip
    evil = np.empty(1, dtype=object)
    evil[0] = Evil()
    np.savez(tmp_path / "chunk_00000.npz", allow_pickle=True, **dict.fromkeys(names, evil))
    assert Checkpoint(tmp_path, "key").load() == []
    assert not (tmp_path / "ran").exists()


FORBIDDEN = re.compile(
    r"\bpickle\b\s*[.(]|\bimport pickle\b|\beval\(|(?<![.\w])exec\(|allow_pickle=True"
    r"|\bos\.system\b|shell=True|yaml\.load\(|read_pickle|\bmarshal\b|\bshelve\b|__import__\("
)


PROGRAMS = "identify/heatrun/io/programs.py"
"""Keeps compiled programs, which are code: SECURITY.md says which files it takes."""


def test_no_file_of_the_packages_runs_what_it_reads():
    found = []
    for package in ("identify", "models"):
        for path in (ROOT / package).rglob("*.py"):
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                if FORBIDDEN.search(line) and path != ROOT / PROGRAMS:
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
                if "np.load(" in line and "allow_pickle=False" not in line:
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    assert found == []


TABLE = "time_s,phase_current_A,losses_W,ambient_degC,winding_degC\n" + "".join(
    f"{t},10,300,20,{20 + 0.001 * t:.3f}\n" for t in range(600)
)


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_name_that_is_no_text_is_escaped(options, tmp_path):
    (tmp_path / "motor.toml").write_text('[motor]\nname = "\\u001b]0;x\\u0007"\n')
    names = (b"duty\xff\x1b[31m.csv", "=cmd()|'\u202e.csv".encode())
    paths = [os.path.join(os.fsencode(tmp_path), name) for name in names]
    for path in paths:
        with open(path, "w") as file:
            file.write(TABLE)
    done = subprocess.run(
        [sys.executable, "-m", "heatrun.cli", "check", str(tmp_path / "motor.toml"),
         *map(os.fsdecode, paths), *options],
        capture_output=True, check=False, env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert done.returncode in (0, 1)
    assert b"Traceback" not in done.stderr
    for stream in (done.stdout, done.stderr):
        assert b"\x1b" not in stream
        assert b"\xff" not in stream
    if options:
        said = json.loads(done.stdout)
        assert said["findings"]
        assert len(said["tests"]) == len(names)


def test_a_test_is_named_after_what_can_be_printed(tmp_path):
    path = os.path.join(os.fsencode(tmp_path), b"duty\xff\x1b.csv")
    with open(path, "w") as file:
        file.write(TABLE)
    record = read_record(os.fsdecode(path))
    assert record.name == "duty??"
    assert json.loads(to_json({"path": record.sources[0].path}))["path"].endswith(
        r"duty\udcff" + "\x1b.csv"
    )
