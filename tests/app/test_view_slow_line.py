"""A browser behind a slow line is waited for as long as it takes what it is sent; none for ever."""

import socket
import time

import pytest

LOOK_S = 1.25
NUM_PULLS = 40
BUFFER_BYTES = 1 << 16
PAUSE_S = 0.15
"""Between two copies of the page: all of them take several looks."""


@pytest.fixture
def looked_after(serve, open_tab):
    """Open a tab of a server that looks after its browsers this often [s]."""
    return lambda look_s: open_tab(serve(constants={"heatrun_view.handlers:LOOK_S": look_s}).url)


def test_a_browser_that_reads_slowly_keeps_its_page(looked_after):
    tab = looked_after(LOOK_S)
    tab.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    for _ in range(NUM_PULLS):
        tab.send("PULL-DOC-REQ", {})
    started, num_copies = time.monotonic(), 0
    while num_copies < NUM_PULLS:
        num_copies += tab.message()["header"]["msgtype"] == "PULL-DOC-REPLY"
        time.sleep(PAUSE_S)
    assert time.monotonic() - started > 4 * LOOK_S
    assert "duty_30min.csv.gz" in tab.document()


def test_a_browser_that_answers_nothing_is_let_go(looked_after):
    tab = looked_after(LOOK_S / 10)
    tab.socket.settimeout(60)
    while tab.socket.recv(1 << 16):
        pass
