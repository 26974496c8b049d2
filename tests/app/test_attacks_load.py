"""Clients that send too much, too slowly, or too often, and the end of the server."""

import base64
import gzip
import json
import os
import shutil
import signal
import socket
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from wire import until

pytestmark = pytest.mark.usefixtures("lives")
BOMB_MB = 300
CUT_S = 120


def _is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_a_packed_message_is_measured_before_it_is_unpacked(served, open_tab):
    packed = base64.b64encode(gzip.compress(bytes(BOMB_MB * 10**6))).decode()
    part = {"type": "bytes", "data": packed}
    before = served.most_MB
    for data in (part, [part] * 3, {"type": "map", "entries": [["a", part]]}):
        tab = open_tab(served.url)
        event = {"kind": "MessageSent", "msg_type": "x", "msg_data": data}
        tab.send("PATCH-DOC", {"events": [event]})
        assert tab.is_closed()
    assert served.most_MB - before < 0.5 * BOMB_MB


def test_many_small_packed_parts_are_measured_together(served, open_tab):
    packed = base64.b64encode(gzip.compress(bytes(10**6))).decode()
    tab = open_tab(served.url)
    before = served.most_MB
    data = [{"type": "bytes", "data": packed}] * BOMB_MB
    tab.send("PATCH-DOC", {"events": [{"kind": "MessageSent", "msg_type": "x", "msg_data": data}]})
    assert tab.is_closed()
    assert served.most_MB - before < 0.5 * BOMB_MB


def test_frames_are_not_packed_and_messages_end_at_a_size(served, open_tab):
    tab = open_tab(served.url)
    assert "permessage-deflate" not in tab.handshake
    header = {"msgid": "1", "msgtype": "PATCH-DOC", "num_buffers": 1000}
    before = served.most_MB
    try:
        for part in (header, {}, {"events": []}):
            tab.frame(json.dumps(part).encode())
        for number in range(100):
            tab.frame(json.dumps({"id": str(number)}).encode())
            tab.frame(bytes(3_000_000), 2)
        assert tab.is_closed()
    except (BrokenPipeError, ConnectionResetError):
        pass  # it did not even hear us out
    assert served.most_MB - before < 150


def test_uploads_of_all_pages_share_one_limit(serve, open_tab):
    server = serve("--max-upload-MB", "1")
    first, second = open_tab(server.url), open_tab(server.url)

    def dropper(tab) -> str:
        (found,) = tab.models("panel.models.file_dropper.FileDropper")
        return found["id"]

    first.upload(dropper(first), "a.csv", b"time_s,winding_degC\n" + b"0,20\n" * 120_000)
    until(lambda: "uploaded/a.csv" in first.document())
    second.upload(dropper(second), "b.csv", b"time_s,winding_degC\n" + b"0,20\n" * 120_000)
    until(lambda: "exceed 1 MB" in second.document())
    # a file that was begun takes room too, and gives it back when its page goes
    third = open_tab(server.url)
    assert "uploaded/a.csv" in third.document()
    assert "uploaded/b.csv" not in third.document()
    third.upload(dropper(third), "c.csv", b"t\n" * 150_000, 1, 2)
    second.upload(dropper(second), "d.csv", b"time_s,winding_degC\n" + b"0,20\n" * 30_000)
    until(lambda: "exceed 1 MB" in second.document())


def test_connections_that_say_nothing_are_cut(serve):
    waits = {f"heatrun_view.handlers:{name}": 2.0 for name in ("HEADER_S", "BODY_S")}
    parts = urlsplit(serve(constants=waits).url)
    address = (parts.hostname, parts.port)
    silent = socket.create_connection(address, timeout=CUT_S)
    half = socket.create_connection(address, timeout=CUT_S)
    half.sendall(b"GET / HTTP/1.1\r\nHost: ")
    body = socket.create_connection(address, timeout=CUT_S)
    body.sendall(f"GET / HTTP/1.1\r\nHost: {parts.netloc}\r\nContent-Length: 9\r\n\r\nx".encode())
    large = socket.create_connection(address, timeout=CUT_S)
    large.sendall(
        f"GET / HTTP/1.1\r\nHost: {parts.netloc}\r\nContent-Length: 99999999\r\n\r\n".encode()
    )
    for each in (silent, half, body, large):
        while each.recv(65536):
            pass
        each.close()


def test_a_flood_of_connections_leaves_the_page_alive(served, wire, open_tab):
    tab = open_tab(served.url)
    parts = urlsplit(served.url)
    address = (parts.hostname, parts.port)
    flood = [socket.create_connection(address, timeout=CUT_S) for _ in range(400)]
    try:
        wire.opens(served.url)
        assert "duty_30min.csv.gz" in tab.document()
        open_files = len(list(Path(f"/proc/{served.process.pid}/fd").iterdir()))
        assert open_files < 300
    finally:
        for each in flood:
            each.close()


FEW_PAGES = 4
"""A bound that is reached in seconds, before the server forgets the first pages."""


@pytest.mark.slow
def test_a_flood_of_pages_ends_at_a_number(serve, wire, open_tab):
    server = serve(constants={"heatrun_view.handlers:PageHandler.MAX_SESSIONS": FEW_PAGES})
    tabs = [open_tab(server.url) for _ in range(2)]
    answers = []
    for _ in range(5):
        answers += [wire.ask(server.url)[0] for _ in range(6)]
        assert "duty_30min.csv.gz" in tabs[0].document()  # a user's page goes on all the while
    assert answers[0] == 200
    assert set(answers) == {200, 503}


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        pytest.param(signal.SIGHUP, marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, marks=pytest.mark.slow),
    ],
)
def test_nothing_is_left_when_the_server_ends(serve, open_tab, tmp_path, monkeypatch, number):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    # these tests may run under nohup, whose children do not hear of a hang-up
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        server = serve(is_cold=True)
    finally:
        signal.signal(signal.SIGHUP, before)
    tab = open_tab(server.url, "?test=duty_30min.csv.gz&motor=motor.toml")
    assert [each for each in temporary.iterdir() if each.name.startswith("heatrun-uploads-")]
    tab.show("Calibration")
    (button,) = [
        model["id"] for model in tab.models("panel.models.widgets.Button") + tab.models("Button")
        if model["attributes"].get("label") == "Calibrate"
    ]  # fmt: skip
    event = {"type": "event", "name": "button_click",
             "values": {"type": "map", "entries": [["model", {"id": button}]]}}  # fmt: skip
    told = {"kind": "MessageSent", "msg_type": "bokeh_event", "msg_data": event}
    tab.send("PATCH-DOC", {"events": [told]})
    until(lambda: server.children())
    jobs = server.children()
    server.process.send_signal(number)
    server.process.wait(CUT_S)
    until(lambda: not any(map(_is_running, jobs)), CUT_S)
    if number != signal.SIGKILL:
        assert server.process.returncode == 0
        assert not [each for each in temporary.iterdir() if each.name.startswith("heatrun-uploads")]
    assert "Traceback" not in server.log.read_text()


@pytest.mark.slow
def test_a_server_under_nohup_outlives_its_terminal(serve, wire):
    if shutil.which("nohup") is None:
        pytest.skip("no nohup here")
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        server = serve(is_cold=True)
    finally:
        signal.signal(signal.SIGHUP, before)
    os.kill(server.process.pid, signal.SIGHUP)
    wire.opens(server.url)
