"""Whatever a table is written like, the same numbers come back; pipes, devices and broken files."""

import contextlib
import gzip
import os
import socket
import subprocess
import sys
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatrun.errors import InputError
from heatrun.io import open_file
from heatrun.readers.joined import read_test
from heatrun.readers.read import read_raw, read_record
from heatrun.readers.text.reader import read_text
from heatrun.record.motor import Motor

NAMES = ("T_winding", "Stator Body", "torque", "P")
UNITS = ("°C", "degC", "Nm", "kW")


@st.composite
def numbers(draw):
    width = draw(st.integers(2, 4))
    value = st.floats(-1e6, 1e6).map(lambda x: round(x, 4))
    row = st.lists(value, min_size=width, max_size=width)
    return draw(st.lists(row, min_size=3, max_size=12))


@st.composite
def styles(draw):
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", " "]))
    decimal = draw(st.sampled_from([".", ","]))
    return {
        "delimiter": delimiter,
        "decimal": decimal,
        # Without quotes, a comma cannot separate cells and decimals at once.
        "quoted": (delimiter == "," and decimal == ",") or draw(st.booleans()),
        "codec": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"])),
        "end": draw(st.sampled_from(["\n", "\r\n"])),
        "unit": draw(st.sampled_from(["none", "[]", "()", " / ", "row"])),
        "preamble": draw(st.integers(0, 3)),
        "trailing": delimiter != " " and draw(st.booleans()),
    }


def written(values, style):
    """Return a table in a style as bytes."""
    width = len(values[0])
    names = [name.replace(" ", "_") for name in NAMES[:width]]
    units = UNITS[:width]
    pattern = {"[]": "{0}[{1}]", "()": "{0}({1})", " / ": "{0}/{1}"}.get(style["unit"], "{0}")
    rows = [[pattern.format(name, unit) for name, unit in zip(names, units, strict=True)]]
    if style["unit"] == "row":
        rows.append(list(units))
    rows += [[repr(value).replace(".", style["decimal"]) for value in row] for row in values]
    if style["quoted"]:
        rows = [[f'"{cell}"' for cell in row] for row in rows]
    tail = style["delimiter"] if style["trailing"] else ""
    lines = [style["delimiter"].join(row) + tail for row in rows]
    lead = ['"Device: USB-2408"', '"Sample Count: 191"', "Operator: nobody"][: style["preamble"]]
    return style["end"].join([*lead, *lines, ""]).encode(style["codec"])


@given(numbers(), styles())
def test_the_numbers_come_back_exactly(values, style):
    table = read_text(written(values, style), "test.csv")
    found = np.column_stack([column.values for column in table.columns])
    assert np.array_equal(found, np.array(values))
    assert [column.label for column in table.columns] == [
        name.replace(" ", "_") for name in NAMES[: len(values[0])]
    ]
    if style["unit"] != "none":
        assert [column.unit for column in table.columns] == list(UNITS[: len(values[0])])
    assert table.findings == ()


def test_a_cut_gzip_never_gives_a_shorter_record(tmp_path):
    packed = gzip.compress(b"time_s,winding_degC\n" + b"0,1\n" * 500)
    path = tmp_path / "run.csv.gz"
    outcomes = set()
    for length in range(2, len(packed)):
        path.write_bytes(packed[:length])
        try:
            outcomes.add(read_record(path).name)
        except InputError:
            outcomes.add("refused")
    assert outcomes == {"refused"}


N = 20_000  # lines, many times what a pipe holds at once
TABLE = "time_s,winding_degC\n" + "".join(f"{t},{20 + 0.25 * (t % 7)}\n" for t in range(N))


@contextlib.contextmanager
def fed(content: bytes):
    """Give the path of a pipe, as a shell makes them, that another thread writes."""
    out, into = os.pipe()

    def write():
        with contextlib.suppress(BrokenPipeError), os.fdopen(into, "wb") as file:
            file.write(content)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield f"/dev/fd/{out}"
    finally:
        os.close(out)
        thread.join()


def test_a_pipe_is_read_whole(tmp_path):
    file = tmp_path / "test.csv"
    file.write_text(TABLE)
    with fed(TABLE.encode()) as path:
        record = read_record(path)
    assert record["winding_degC"].size == N
    assert np.array_equal(record["winding_degC"], read_record(file)["winding_degC"])
    assert record.sources[0].sha256 == read_record(file).sources[0].sha256


def test_a_pipe_of_many_channels_is_read_whole(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "test.mf4"
    with asammdf.MDF(version="4.10") as file:
        time_s = np.arange(50_000) * 0.1
        signal = asammdf.Signal(20 + 0.0 * time_s, time_s, unit="degC", name="winding_degC")
        file.append([signal])
        file.save(path)
    with fed(path.read_bytes()) as pipe:
        assert read_record(pipe)["winding_degC"].size == 50_000


def test_a_pipe_is_read_no_further_than_the_limit(monkeypatch):
    monkeypatch.setattr(open_file, "LARGEST_BYTES", 2**17)
    with fed(TABLE.encode()) as path, pytest.raises(InputError, match="more than 0 MB"):
        read_raw(path)


def test_an_empty_pipe_is_an_empty_file():
    with fed(b"") as path, pytest.raises(InputError, match="empty file"):
        read_raw(path)


def test_a_named_pipe_is_refused_whether_anybody_writes_it_or_not(tmp_path):
    path = tmp_path / "test.csv"
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"named pipe.*/dev/stdin"):
        read_raw(path)
    held = os.open(path, os.O_RDWR)  # a writer that never writes
    with pytest.raises(InputError, match="named pipe"):
        read_raw(path)
    os.close(held)


def test_devices_and_sockets_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ("/dev/zero", "/dev/null", "/dev/tty"):
        if os.path.exists(path):
            with pytest.raises(InputError, match="got a device"):
                read_raw(path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("test.csv")
        with pytest.raises(InputError, match="got a socket"):
            read_raw("test.csv")


def test_the_command_line_reads_what_comes_through_its_input(tmp_path):
    motor = tmp_path / "motor.toml"
    motor.write_text('[motor]\nname = "M"\n')
    table = "time_s,phase_current_A,losses_W,ambient_degC,winding_degC\n" + "".join(
        f"{t},{10 + t % 900 // 300},300,20,{20 + 0.001 * t:.4f}\n" for t in range(5000)
    )
    words = [sys.executable, "-m", "heatrun.cli", "check", "-v", str(motor), "/dev/stdin"]
    done = subprocess.run(words, input=table.encode(), capture_output=True, check=False)
    assert done.returncode == 0
    assert b"5000 samples" in done.stderr


@pytest.mark.parametrize(
    "name", ["x.csv@1.2.3Hz", "@.Hz", "x.csv@.Hz", "x.csv@Hz", "@10Hz", "x.csv@1_0Hz",
             "x.csv@0,5Hz", "x.csv@nanHz", "x.csv@1e3Hz"],
)  # fmt: skip
def test_a_rate_that_is_none_is_shown(name):
    with pytest.raises(InputError, match=r"as in drive\.csv@10Hz.*number with a point"):
        read_test(name, Motor("M"))


@pytest.mark.parametrize("name", ["x" * 5000, "x\0y.csv", "x" * 5000 + "@10Hz", "\0+\0", "@@Hz@"])
def test_a_name_that_no_file_can_have_cannot_be_opened(name):
    with pytest.raises(InputError, match="cannot be opened"):
        read_test(name, Motor("M"))


def test_a_rate_of_zero_is_refused(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("P;T\n1,5;2,5\n1,5;2,5\n")
    with pytest.raises(InputError, match="above 0 Hz"):
        read_test(f"{path}@0Hz", Motor("M"))
    assert read_test(f"{path}@.5Hz", Motor("M")).time_s.tolist() == [0.0, 2.0]
