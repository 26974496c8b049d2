"""Parts of the live view that need no browser."""

import asyncio
import hashlib
import json
import os
import threading
import time
from dataclasses import replace
from html import escape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bokeh.document import Document
from panel.io.state import set_curdoc

from heatrun.errors import InputError
from heatrun.results import DiscoveryResult, FitResult, from_json
from heatrun.runs.run import open_run
from heatrun.runs.verdict import favoured, restrictions
from heatrun_view.background import in_background
from heatrun_view.look import LIGHT
from heatrun_view.running_jobs import JobQueue
from heatrun_view.runs import last_motor, run_name, run_view, runs_under
from heatrun_view.store import (
    BoundedDropper,
    Folder,
    RecordStore,
    Stamp,
    UploadRoom,
    keep_upload,
    safe_name,
)
from heatrun_view.tabs.fitting import FitFigure, error_of
from heatrun_view.trace import GAP, Trace
from heatrun_view.words import calibration_html, discovery_html, error_message, message, table

STORED = Path(__file__).parents[1] / "stored"


def test_a_window_keeps_the_extremes_of_a_long_signal():
    time_s = np.arange(1_000_000) * 0.1
    value = np.sin(time_s / 500.0)
    value[123_456], value[765_432] = 9.0, -9.0
    t, v = Trace.of("a", "winding_degC", time_s, value).window(0.0, 1e5, 2000)
    assert t.size < 5000
    assert v.max() == 9.0
    assert v.min() == -9.0
    assert t[np.argmax(v)] == time_s[123_456]


def test_a_narrow_window_holds_every_reading():
    time_s = np.arange(100_000) * 0.1
    t, v = Trace.of("a", "winding_degC", time_s, time_s * 2).window(50.0, 60.0, 2000)
    inside = (t >= 50.0) & (t <= 60.0)
    np.testing.assert_array_equal(t[inside], time_s[500:601])
    np.testing.assert_array_equal(v, 2 * t)


@pytest.mark.parametrize("num_points", [50, 5000])
def test_a_gap_breaks_the_line(num_points):
    time_s = np.concatenate([np.arange(1000.0), 3000.0 + np.arange(1000.0)])
    t, v = Trace.of("a", "winding_degC", time_s, np.ones(2000)).window(0.0, 4000.0, num_points)
    (broken,) = np.flatnonzero(np.isnan(v))
    assert t[broken - 1] <= 999.0
    assert t[broken + 1] >= 3000.0


def test_a_slow_sensor_on_a_fast_logger_is_one_line():
    time_s = np.arange(10_000) * 0.1
    value = np.full(10_000, np.nan)
    value[::10] = 20.0
    trace = Trace.of("a", "winding_degC", time_s, value)
    _, v = trace.window(0.0, 1000.0, 5000)
    assert trace.step_s == pytest.approx(1.0)
    assert GAP > 1.0
    assert not np.isnan(v).any()


def test_time_that_runs_backwards_is_shown_in_order():
    trace = Trace.of("a", "winding_degC", np.array([0.0, 2.0, 1.0]), np.array([0.0, 20.0, 10.0]))
    np.testing.assert_array_equal(trace.value, [0.0, 10.0, 20.0])


@pytest.mark.parametrize(
    "name", ["../secret.csv", "/etc/passwd", "a/../../secret.csv", "link.csv", "\0", "", "x" * 5000]
)
def test_nothing_outside_the_folder_is_read(tmp_path, name):
    shown = tmp_path / "shown"
    shown.mkdir()
    (tmp_path / "secret.csv").write_text("t,Is\n0,1\n")
    (shown / "link.csv").symlink_to(tmp_path / "secret.csv")
    with pytest.raises(InputError, match="in the folder"):
        Folder(shown).path(name)
    assert Folder(shown).list().tests == ()


def test_a_folder_lists_tests_and_motor_files(folder):
    (folder / "notes.toml").write_text("[other]\n")
    (folder / "broken.toml").write_bytes(b"\xff\xfe[motor")
    (folder / "readme.pdf").write_bytes(b"%PDF")
    (folder / "day2").mkdir()
    (folder / "day2" / "cold.CSV").write_text("t\n0\n")
    (folder / "virtual.csv").write_text("time_s,copper_loss_W,other_loss_W,flow_a_b_W\n0,1,2,3\n")
    listing = Folder(folder).list()
    assert listing.motors == ("motor.toml",)
    assert listing.simulated == ("virtual.csv",)
    assert listing.tests == ("duty_30min.csv.gz", "step_30min.csv.gz", "day2/cold.CSV")
    with pytest.raises(InputError, match="there is none"):
        Folder(folder / "nowhere")


@pytest.mark.parametrize(
    ("sent", "kept"),
    [
        ("../../a.csv", "a.csv"),
        ("C:\\bench\\a.csv", "a.csv"),
        ("<img src=x onerror=alert(1)>.csv", "_img_src_x_onerror_alert_1__.csv"),
        (".hidden.csv", "hidden.csv"),
        ("-rf.csv", "rf.csv"),
        ("con.csv", "_con.csv"),
        ("Prüfung 1.csv.gz", "Prüfung_1.csv.gz"),
        ("a\nb.csv", "a_b.csv"),
    ],
)
def test_names_of_uploads_are_names(sent, kept):
    assert safe_name(sent) == kept


@pytest.mark.parametrize("sent", ["", "...", "run.exe", "page.html", "a.py", "csv"])
def test_uploads_that_are_no_bench_files_are_refused(sent):
    with pytest.raises(InputError, match="Expected a bench file"):
        safe_name(sent)


def test_an_upload_never_replaces_another(tmp_path):
    first = keep_upload(tmp_path, "a.csv", b"one")
    again = keep_upload(tmp_path, "a.csv", b"one")
    other = keep_upload(tmp_path, "a.csv", "two")
    assert first == again
    assert first.read_bytes() == b"one"
    assert other.read_bytes() == b"two"
    assert len(safe_name("x" * 500 + ".csv")) <= 100


def test_uploads_end_at_the_limit_whatever_the_browser_sends(tmp_path):
    refused: list[InputError] = []
    room = UploadRoom(tmp_path, 1_000_000)
    dropper = BoundedDropper(room, refused.append)

    def send(name: str, data: bytes, chunk: int, total: int) -> None:
        event = SimpleNamespace(
            event_name="upload_event",
            data={"name": name, "data": data, "chunk": chunk, "total_chunks": total, "type": ""},
        )
        dropper._process_event(event)

    send("a.csv", b"x" * 600_000, 1, 1)
    assert dropper.value["a.csv"] == b"x" * 600_000
    send("b.csv", b"x" * 300_000, 1, 2)
    send("b.csv", b"x" * 300_000, 2, 2)
    assert "b.csv" not in dropper.value
    assert "exceed 1 MB" in refused[0].problem
    send("b.csv", b"late", 2, 2)
    assert "b.csv" not in dropper.value
    assert not room.take(400_000)
    assert dropper.arrived() == {"a.csv": b"x" * 600_000}
    keep_upload(tmp_path, "a.csv", b"x" * 600_000)
    assert not room.take(400_001)
    assert room.take(399_000)
    room.give_back(399_000)
    send("c.csv", b"x" * 300_000, 1, 2)
    assert not room.take(200_000)
    dropper.close()
    assert room.take(200_000)


def test_a_large_file_is_refused_before_it_is_read(folder):
    store = RecordStore(max_file_bytes=1000)
    with pytest.raises(InputError, match="opens files up to"):
        store.open(folder / "duty_30min.csv.gz", None)


def test_a_file_is_read_once_until_it_changes(folder):
    store, path = RecordStore(), folder / "duty_30min.csv.gz"
    first = store.open(path, None)
    assert store.open(path, None) is first
    path.write_bytes((folder / "step_30min.csv.gz").read_bytes())
    assert not first.is_current()
    assert store.open(path, None) is not first
    path.unlink()
    assert Stamp.of(path) == Stamp(-1, -1)


def test_what_comes_from_files_is_escaped():
    bad = "<script>alert(1)</script>"
    error = InputError(bad, where=bad, remedy=bad)
    for html in (message("error", bad), error_message(error), table((bad,), [(bad, 1.0)])):
        assert "<script>" not in html
        assert "&lt;script&gt;" in html
    stored = (STORED / "discovery-2.json").read_bytes()
    plain = from_json(stored, DiscoveryResult, "discovery.json", "")
    effect = replace(plain.effects[0], id=bad, equivalents=(bad,))
    span = replace(plain.where[0], test=bad, node=bad)
    html = discovery_html(replace(plain, effects=(effect,), where=(span,)))
    assert "<script>" not in html
    assert html.count("&lt;script&gt;") == 4
    fit = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "")
    name, model = next(iter(fit.models.items()))
    html = calibration_html(replace(fit, models={name: replace(model, title=bad)}))
    assert "&lt;script&gt;" in html.lower()
    assert "<script>" not in html.lower()
    assert run_name("../../etc/<b>", "x") == "_.._etc__b_"
    assert run_name("  ", "x") == "x"


def test_the_page_says_what_restricts_the_use_and_the_certified_network_first():
    fit = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "")
    html = calibration_html(fit)
    titles = [fit.models[name].title.capitalize() for name in fit.models]
    places = {title: html.index(f"<h3>{title}") for title in titles}
    assert (
        min(places, key=lambda each: places[each]) == fit.models[favoured(fit)].title.capitalize()
    )
    for sentence in restrictions(fit):
        assert html.index(escape(sentence)) < min(places.values())


def _stored_run(path: Path) -> Path:
    """Write a run folder with both results, whole by its manifest."""
    path.mkdir()
    for name in ("fit", "discovery"):
        (number,) = (file.read_bytes() for file in STORED.glob(f"{name}-*.json"))
        (path / f"{name}.json").write_bytes(number)
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in path.glob("*.json")}
    (path / "manifest.json").write_text(json.dumps({"files": files}))
    return path


def test_a_run_on_the_page_is_read_and_checked_as_everywhere(tmp_path: Path):
    path = _stored_run(tmp_path / "run")
    (shown,) = runs_under([(tmp_path, tmp_path)])
    opened = open_run(path)
    assert shown.calibration == opened.result
    assert shown.discovery == opened.discovery
    changed = json.loads((path / "discovery.json").read_text())
    (path / "discovery.json").write_text(json.dumps({**changed, "sentence": "another"}))
    os.utime(path / "manifest.json", ns=(1, 1))  # another state of the run
    (shown,) = runs_under([(tmp_path, tmp_path)])
    assert shown.calibration is not None
    assert shown.discovery is None, "not what the run wrote"
    (path / "fit.json").write_text("{}")
    os.utime(path / "manifest.json", ns=(2, 2))
    (shown,) = runs_under([(tmp_path, tmp_path)])
    assert shown.calibration is None


@pytest.mark.parametrize(
    ("given", "chosen"),
    [("day2/drive.toml", "day2/drive.toml"), ("drive.toml", "day2/drive.toml"),
     ("../bench/motor.toml", "motor.toml"), ("/elsewhere/motor.toml", None)],
)  # fmt: skip
def test_the_motor_file_that_was_used_last_is_found(tmp_path: Path, given, chosen):
    path = _stored_run(tmp_path / "run")
    said = json.loads((path / "fit.json").read_text())
    said["motor"]["path"] = given
    (path / "fit.json").write_text(json.dumps(said))
    digest = hashlib.sha256((path / "fit.json").read_bytes()).hexdigest()
    (path / "manifest.json").write_text(json.dumps({"files": {"fit.json": digest}}))
    motors = {n: Path("/tests/bench") / n for n in ("motor.toml", "day2/drive.toml")}
    assert last_motor(runs_under([(tmp_path, tmp_path)]), motors) == chosen


# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_the_figure_of_a_run_stands_below_its_verdict(tmp_path: Path):
    path = _stored_run(tmp_path / "run")
    head = "time_s,measured_degC,second_winding_degC,second_total_95_low_degC"
    rows = ("10,20,20.5,19,25,0", "30,,22,19,25,", "50,24,22.5,19,25,0")
    head += ",second_total_95_high_degC,second_residual_K"
    (path / "course_1.csv").write_text("\n".join((head, *rows)))
    (run,) = runs_under([(tmp_path, tmp_path)])
    band = run.band(1, "cold")
    assert error_of(band) == pytest.approx((np.sqrt(1.25), 1.5))
    figure = FitFigure(lambda: None)
    figure.offer(["cold"])
    figure.show(band)
    assert [trace.name for trace in figure._plots.traces] == ["measured", "model", "residual"]
    np.testing.assert_array_equal(figure._plots.traces[2].value, [-0.5, 1.5])
    area, line = (r.glyph for r in figure._plots._figures["degC"].renderers[:2])
    assert (area.fill_color, line.line_color) == (LIGHT.ink, LIGHT.ink)
    figure.move(replace(band, median=band.median + 1.0))
    np.testing.assert_array_equal(figure._plots.traces[2].value, [-1.5, 0.5])
    shown = run_view(run, lambda run: run.calibration, lambda _: "<b>", lambda _: "", "", "figure")
    assert shown[0].object == "<h3>&lt;b&gt;</h3>"


def _over(job, seconds: float = 180.0):
    end = time.monotonic() + seconds
    while not job.is_over and time.monotonic() < end:
        time.sleep(0.05)
    return job


def test_a_cancelled_command_ends_and_the_next_one_runs_once_for_two_tabs(folder: Path):
    queue = JobQueue()
    motor, duty = str(folder / "motor.toml"), str(folder / "duty_30min.csv.gz")
    words = ["calibrate", motor, duty, "--out", str(folder / "run")]
    slow = queue.submit(words)
    waiting = queue.submit([*words, "--quick"])
    while not slow.doing and not slow.is_over:
        time.sleep(0.05)
    queue.cancel(waiting)
    queue.cancel(slow)
    assert (slow.state, waiting.state) == ("cancelled", "cancelled")
    assert slow.process is not None
    assert slow.process.wait(60) != 0
    assert not (folder / "run").exists()

    first, same = queue.submit(["check", motor, duty]), queue.submit(["check", motor, duty])
    other = queue.submit(["check", motor, str(folder / "none.csv")])
    assert first is same
    assert queue.num_ahead(other) == 1
    assert _over(first).state == "done"
    assert first.output["findings"]
    assert _over(other).state == "failed"
    assert "cannot be opened" in other.output["error"]["problem"]


def test_a_thread_beside_the_page_does_not_touch_its_document(monkeypatch):
    """Bokeh's current document is one for all threads: that of another tab would change."""
    asked, shown, document = [], [], Document()

    def next_tick(_, act):
        asked.append(threading.current_thread())
        act()

    async def page():
        with set_curdoc(document):
            in_background(lambda: threading.current_thread().name, shown.append)
        for _ in range(500):
            if shown:
                return
            await asyncio.sleep(0.01)

    monkeypatch.setattr(Document, "add_next_tick_callback", next_tick)
    # A thread of its own: the browser of other tests keeps a loop running in this one.
    server = threading.Thread(target=lambda: asyncio.run(page()))
    server.start()
    server.join()
    assert shown == ["heatrun reader"]
    assert asked == [server]
