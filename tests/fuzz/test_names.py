"""File names that hold control characters, or bytes that are no text, steer and break nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from heatrun.readers.read import read_record
from heatrun.results import to_json

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
