"""A browser that is slow to read: what it is told stays in order, and names only what it knows."""

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HEAD = "time_s,phase_current_A,losses_W,ambient_degC,winding_degC\n"
NUM_PULLS = 80
"""Copies of the page, more than the connection's buffers hold."""
LOOKS_S = 2.5
"""The page looks at its files once a second: some looks [s]."""
BUFFER_BYTES = 1 << 16
"""What the browser's end holds; from a smaller one the kernels' waits grow to half a minute."""


def _append(path: Path, first: int, last: int) -> None:
    with path.open("a") as file:
        file.write("".join(f"{k},1,2,20,{20 + k}\n" for k in range(first, last)))


def _parts(each: Any) -> Iterator[dict[str, Any]]:
    if isinstance(each, dict):
        yield each
    for part in each.values() if isinstance(each, dict) else each if isinstance(each, list) else ():
        yield from _parts(part)


def _models(content: Any) -> dict[str, Any]:
    return {each["id"]: each for each in _parts(content) if each.get("type") == "object"}


def test_growth_never_overtakes_the_plots_that_it_belongs_to(served, open_tab):
    path = served.folder / "grows.csv"
    path.write_text(HEAD)
    _append(path, 0, 5)
    tab = open_tab(served.url, "?type=general&follow=1")
    known = _models(json.loads(tab.document()))
    (tests, *_) = (
        number
        for number, model in sorted(known.items(), key=lambda item: int(item[0][1:]))
        if model["name"] == "CheckboxGroup" and "grows.csv" in model["attributes"].get("labels", ())
    )
    labels = known[tests]["attributes"]["labels"]
    tab.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    tab.change(tests, "active", [labels.index("grows.csv")])
    for _ in range(NUM_PULLS):
        tab.send("PULL-DOC-REQ", {})
    end, rows = time.monotonic() + LOOKS_S, 5
    while time.monotonic() < end:
        time.sleep(0.2)
        _append(path, rows, rows + 1)
        rows += 1
    is_whole = False
    while not is_whole:
        message = tab.message()
        for event in message["content"].get("events", ()):
            known |= _models(event)
            if "model" in event:
                assert event["model"]["id"] in known, event
                is_whole |= event.get("attr") == "end" and event.get("new") == rows - 1
