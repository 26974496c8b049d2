"""Links, pipes and hostile files in the folder of a running server: nothing outside is shown."""

import base64
import hashlib
import json
import os
import shutil
import threading
from pathlib import Path

import pytest
from wire import until

from heatrun.errors import InputError
from heatrun.io.whole_files import opening_by
from heatrun_view.gate import open_inside, read_inside
from heatrun_view.store import Folder

SECRET = "root:x:0:0:secret of the system"
NUM_SWAPS = 400


def _run(where: Path, **files: bytes) -> Path:
    """Write a run folder that is whole by its manifest."""
    where.mkdir(parents=True)
    fit = (Path(__file__).parents[1] / "stored" / "fit-1.json").read_bytes()
    (where / "fit.json").write_bytes(fit)
    listed = {"fit.json": hashlib.sha256(fit).hexdigest()}
    (where / "manifest.json").write_text(json.dumps({"files": listed}))
    for name, content in files.items():
        (where / name.replace("_", ".")).write_bytes(content)
    return where


def _linked(folder: Path) -> None:
    """Fill a folder with links that lead out of it, and some that stay inside."""
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "secret.csv").write_text(f"time_s,winding_degC,{SECRET}\n0,20,1\n1,21,1\n")
    (elsewhere / "secret.toml").write_text(f'[motor]\nname = "{SECRET}"\n')
    (elsewhere / "secret.png").write_bytes(b"\x89PNG\r\n\x1a\n" + SECRET.encode())
    run = _run(folder / "run1", sheet_json=b"{}")
    (run / "sheet.xlsx").symlink_to(elsewhere / "secret.csv")
    (run / "course_9.csv").symlink_to(elsewhere / "secret.csv")
    (run / "discovery.json").symlink_to(elsewhere / "secret.csv")
    (run / "figures").mkdir()
    (run / "figures" / "fit.png").symlink_to(elsewhere / "secret.png")
    (run / "discovery").symlink_to(elsewhere)
    _run(elsewhere / "runs" / "foreign_run")
    (folder / "linked_run").symlink_to(elsewhere / "runs" / "foreign_run")
    (folder / "runs").symlink_to(elsewhere / "runs")
    (folder / "linked_test.csv").symlink_to(elsewhere / "secret.csv")
    (folder / "linked_motor.toml").symlink_to(elsewhere / "secret.toml")
    (folder / "linked_folder").symlink_to(elsewhere)
    (folder / "circle.csv").symlink_to(folder / "circle.csv")
    (folder / "inner.csv.gz").symlink_to("duty_30min.csv.gz")


def test_links_lead_to_nothing_outside_the_folder(serve, open_tab):
    server = serve(fill=_linked)
    tab = open_tab(server.url, "?run=run1&test=inner.csv.gz")
    tab.show()
    shown = tab.document()
    assert "run1" in shown
    assert "inner.csv.gz" in shown
    assert "sheet.json" in shown
    for name in (
        "secret",
        "foreign_run",
        "linked_",
        "circle.csv",
        "sheet.xlsx",
        "course_9",
        "fit.png",
    ):
        assert name not in shown.replace(str(server.folder), ""), name
    asked = "?test=linked_test.csv&test=linked_folder/secret.csv&motor=linked_motor.toml"
    other = open_tab(server.url, f"{asked}&run=linked_run&test=circle.csv")
    other.show()
    assert "secret of the system" not in other.document()


def test_a_download_is_judged_when_it_is_asked_for(serve, open_tab):
    """The file of a button becomes a link after the list was made."""
    server = serve(fill=lambda folder: _run(folder / "run1", sheet_json=b'{"mine": 1}'))
    (server.folder.parent / "secret").write_text(SECRET)
    tab = open_tab(server.url, "?run=run1")
    tab.show("Calibration")
    buttons = {model["attributes"].get("label"): model["id"]
               for model in tab.models("panel.models.widgets.FileDownload")
               + tab.models("FileDownload")}  # fmt: skip
    sheet = server.folder / "run1" / "sheet.json"

    def download() -> str:
        tab.change(buttons["sheet.json"], "clicks", 1 + len(list(server.folder.iterdir())))
        while "data:" not in (said := json.dumps(tab.message())):
            pass
        return said

    assert base64.b64encode(b'{"mine": 1}').decode() in download()
    sheet.unlink()
    sheet.symlink_to(server.folder.parent / "secret")
    (server.folder / "another").touch()
    assert base64.b64encode(SECRET.encode()).decode()[:20] not in download()
    assert "sheet.json" in tab.document()


@pytest.mark.parametrize("what", ["file", "folder"])
def test_no_link_slips_in_between_look_and_open(tmp_path, what):
    root, other = tmp_path / "root", tmp_path / "other"
    for each, text in ((root / "inner", "mine"), (other, SECRET)):
        each.mkdir(parents=True)
        (each / "a.csv").write_text(text)
    (tmp_path / "kept").mkdir()
    victim = root / "inner" if what == "folder" else root / "inner" / "a.csv"
    aim = other if what == "folder" else other / "a.csv"
    is_over = threading.Event()

    def swap() -> None:
        while not is_over.is_set():
            victim.rename(tmp_path / "kept" / victim.name)
            victim.symlink_to(aim)
            victim.unlink()
            (tmp_path / "kept" / victim.name).rename(victim)

    swapper = threading.Thread(target=swap)
    swapper.start()
    found, refused = set(), 0
    folder = Folder(root)
    try:
        while refused < NUM_SWAPS:
            try:
                with folder.open(root / "inner" / "a.csv") as file:
                    found.add(file.read())
            except InputError:
                refused += 1
    finally:
        is_over.set()
        swapper.join()
    assert found <= {b"mine"}


def test_readers_open_through_the_folder(folder, tmp_path):
    """Whatever a reader is asked to open, it is the folder that opens it."""
    from heatrun.motor.file import load_motor
    from heatrun.readers.read import read_record

    for name in ("step_30min.csv.gz", "motor.toml"):
        shutil.copy(folder / name, tmp_path / name)
    shown = Folder(folder)
    with opening_by(shown.open):
        assert load_motor(folder / "motor.toml").name
        assert read_record(folder / "step_30min.csv.gz").channels
        for read, name in ((load_motor, "motor.toml"), (read_record, "step_30min.csv.gz")):
            with pytest.raises(InputError, match="in the folder"):
                read(tmp_path / name)
    assert read_record(tmp_path / "step_30min.csv.gz").channels


def test_pipes_and_devices_are_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    for name in ("pipe.csv", "folder.csv"):
        with pytest.raises(InputError, match="pipe, a device or a folder"):
            open_inside(tmp_path, tmp_path / name)
    with pytest.raises(InputError, match="pipe, a device or a folder"):
        open_inside(Path("/dev"), Path("/dev/zero"))
    (tmp_path / "large.csv").write_bytes(b"x" * 101)
    with pytest.raises(InputError, match="larger one"):
        read_inside(tmp_path, tmp_path / "large.csv", 100)


def _hostile(folder: Path) -> None:
    for name in ("pipe.csv", "pipe.toml", "pipe.parquet"):
        os.mkfifo(folder / name)
    (folder / "run_pipe").mkdir()
    os.mkfifo(folder / "run_pipe" / "manifest.json")
    deep = "a = " + "[" * 20_000 + "]" * 20_000
    (folder / "deep.toml").write_text(f"[motor]\n{deep}\n")
    (folder / "deep_other.toml").write_text(f"{deep}\n")
    dots = ".".join(["a"] * 50_000)
    (folder / "dots.toml").write_text(f"{dots} = 1\n[motor]\n")
    (folder / "no_text.toml").write_bytes(b"[motor]\n\xff\xfe\n")
    run = _run(folder / "deep_run")
    (run / "discovery.json").write_text("[" * 100_000)
    _run(folder / "odd_run")


def test_hostile_files_are_errors_of_their_own(serve, open_tab):
    server = serve(fill=_hostile)
    before = server.most_MB
    tab = open_tab(server.url, "?test=duty_30min.csv.gz&motor=motor.toml&run=odd_run")
    tab.show()
    shown = tab.document()
    assert "motor.toml" in shown
    assert "step_30min.csv.gz" in shown
    assert "pipe." not in shown
    for name in ("deep.toml", "no_text.toml"):
        bad = open_tab(server.url, f"?test=duty_30min.csv.gz&motor={name}")
        bad.show("Checks")
        until(lambda bad=bad: "The motor file is at fault" in bad.document())
    until(lambda: "winding_degC" in tab.document())
    assert server.most_MB - before < 500.0


def test_a_file_that_is_read_for_long_keeps_no_other_page_waiting(serve, open_tab, monkeypatch):
    """A header of parentheses occupies its reader; the page of another tab opens and reads on."""

    def fill(folder: Path) -> None:
        name = "(" * 20_000
        (folder / "slow.csv").write_text(f"time_s,{name}\n" + "0,1\n1,2\n" * 50)

    server = serve(fill=fill)
    slow = open_tab(server.url, "?test=slow.csv&motor=motor.toml")
    other = open_tab(server.url, "?test=step_30min.csv.gz&motor=motor.toml")
    other.show("Checks")
    until(lambda: "How the files were read" in other.document())
    assert "slow.csv" in slow.document()
