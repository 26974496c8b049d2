"""What cannot be exported is refused with the reason, and nothing is half-written."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest
from run_files import edit

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import export_mat, read_run_test
from heatrun.io.whole_files import write_whole


def test_a_changed_record_is_refused(day):
    with Path("duty.csv").open("a") as file:
        file.write("\n")
    with pytest.raises(InputError, match=r"duty\.csv has changed since the run: SHA-256"):
        export_mat(Path("run"), folder=Path("out"))
    assert not Path("out").exists()


def test_a_missing_record_is_refused(day, capsys):
    Path("duty.csv").unlink()
    assert cli.main(["export", "run", "--to", "mat"]) == 1
    said = capsys.readouterr().err
    assert "duty.csv of this run cannot be read (No such file" in said
    assert "in the folder that the run was started in" in said


def test_what_the_run_has_not_is_refused(day):
    with pytest.raises(InputError, match="with one of: duty, step"):
        export_mat(Path("run"), test="other")
    with pytest.raises(InputError, match="holds no third network, only first, second"):
        export_mat(Path("run"), network="third")


def test_an_effect_from_a_file_of_the_user_is_refused_by_name(day):
    path = Path("run/model_second.toml")
    path.write_text(path.read_text().replace("effects = []", 'effects = ["shaft_fan"]', 1))
    listing = json.loads(Path("run/manifest.json").read_text())
    listing["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    Path("run/manifest.json").write_text(json.dumps(listing))
    with pytest.raises(InputError, match="not that of shaft_fan"):
        export_mat(Path("run"), folder=Path("out"))
    assert not Path("out").exists()


@pytest.mark.parametrize("key", ["motor", "tests", "models"])
def test_a_run_that_lacks_a_part_is_refused(day, key):
    edit(Path("run/fit.json"), lambda result: result.pop(key))
    with pytest.raises(InputError, match=r"fit\.json of the run cannot be read"):
        export_mat(Path("run"))


@pytest.mark.parametrize(("value", "said"), [("x", "cannot be read"), (None, "cannot be read"),
                                             (-1.0, "expected Ceq_w above 0, got -1")])  # fmt: skip
def test_a_capacity_that_is_none_is_refused(day, value, said):
    def spoil(result):
        result["models"]["second"]["parameters"]["Ceq_w"]["value"] = value

    edit(Path("run/fit.json"), spoil)
    with pytest.raises(InputError, match=said):
        export_mat(Path("run"))


def test_a_run_without_a_calibrated_test_is_refused(day):
    edit(Path("run/fit.json"), lambda result: result["tests"].pop(0))
    with pytest.raises(InputError, match="no test that was calibrated on"):
        export_mat(Path("run"))


def test_a_torque_offset_needs_the_speed(day, monkeypatch):
    found = read_run_test(Path("run"))
    offset = replace(found, values={**found.values, "torque_offset": 0.5})
    monkeypatch.setattr("heatrun.export.mat.read_run_test", lambda *_, **__: offset)
    assert export_mat(Path("run"), folder=Path("out"))["corrections_K"] > 1.0
    silent = {n: v for n, v in found.record.channels.items() if n != "speed_rpm"}
    offset = replace(offset, record=replace(found.record, channels=silent))
    with pytest.raises(InputError, match="corrects the torque, and this test has no speed_rpm"):
        export_mat(Path("run"), folder=Path("out"))


@pytest.mark.parametrize("text", ["", "[]", '{"inputs": [{"path": 3}]}', '{"inputs": []}'])
def test_a_damaged_manifest_is_refused(day, text):
    Path("run/manifest.json").write_text(text)
    with pytest.raises(InputError, match=r"manifest\.json"):
        export_mat(Path("run"))


def test_a_file_of_someone_else_is_left_alone(day):
    out = Path("out")
    out.mkdir()
    (out / "prova.mat").write_bytes(b"MATLAB 5.0 MAT-file, Platform: PCWIN64")
    with pytest.raises(InputError, match="not as heatrun writes it; it is left as it is"):
        export_mat(Path("run"), folder=out)
    assert (out / "prova.mat").read_bytes() == b"MATLAB 5.0 MAT-file, Platform: PCWIN64"
    assert not (out / "run_prova.m").exists()


def test_an_edited_script_is_left_alone(day):
    script = Path(export_mat(Path("run"))["files"][1])
    script.write_text("% mine")
    with pytest.raises(InputError, match=r"run_prova\.m exists"):
        export_mat(Path("run"))
    assert script.read_text() == "% mine"


def test_a_place_that_cannot_be_written_to_is_refused(day):
    with pytest.raises(InputError, match="cannot be written"):
        export_mat(Path("run"), folder=Path("motor.toml"))


def test_the_script_is_not_there_without_the_variables(day, monkeypatch):
    def cut(path, content):
        write_whole(path, content)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("heatrun.export.contents.write_whole", cut)
    with pytest.raises(InputError, match="No space left"):
        export_mat(Path("run"), folder=Path("out"))
    assert not list(Path("out").iterdir())
