"""A client of the live view that speaks HTTP and websocket by itself, with whatever it likes."""

import base64
import http.client
import json
import os
import re
import socket
import struct
import time
from contextlib import closing
from typing import Any
from urllib.parse import urlsplit

WAIT_S = 120.0


def ask(
    url: str, path: str = "/", headers: dict[str, str] | None = None, *, method: str = "GET"
) -> tuple[int, dict[str, str], bytes]:
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=WAIT_S)
    try:
        connection.request(method, path, headers=headers or {})
        answer = connection.getresponse()
        found = {name.lower(): value for name, value in answer.getheaders()}
        return answer.status, found, answer.read()
    finally:
        connection.close()


def token_of(page: bytes) -> str:
    return re.search(rb'"token":"([^"]+)"', page).group(1).decode()


class Tab:
    """A page as a browser has it open: its session, its websocket.

    The browser tells that it has built the page; not so where `is_built` is False.
    """

    def __init__(self, url: str, query: str = "", *, is_built: bool = True, **headers: str) -> None:
        self.url = url
        status, _, page = ask(url, "/" + query, headers)
        assert status == 200, (status, page[:200])
        self.socket, self.handshake = upgrade(url, token_of(page), headers)
        assert " 101 " in self.handshake.split("\r\n")[0], self.handshake
        assert self.message()["header"]["msgtype"] == "ACK"
        if is_built:
            self.tell_built()

    def send(self, kind: str, content: dict[str, Any], **header: Any) -> None:
        for part in ({"msgid": "1", "msgtype": kind, **header}, {}, content):
            self.frame(json.dumps(part).encode())

    def frame(self, data: bytes, opcode: int = 1) -> None:
        size = len(data)
        length = bytes([0x80 | size]) if size < 126 else (
            bytes([0x80 | 126]) + struct.pack(">H", size) if size < 65536
            else bytes([0x80 | 127]) + struct.pack(">Q", size)
        )  # fmt: skip
        self.socket.sendall(bytes([0x80 | opcode]) + length + b"\0\0\0\0" + data)

    def message(self) -> dict[str, Any]:
        """Return the next message, its buffers left out.

        Raises:
            ConnectionError: If the server has closed the websocket.
        """
        header, _, content = (json.loads(self._text()) for _ in range(3))
        for _ in range(2 * header.get("num_buffers", 0)):
            self._text()
        return {"header": header, "content": content}

    def document(self) -> str:
        self.send("PULL-DOC-REQ", {})
        while (found := self.message())["header"]["msgtype"] != "PULL-DOC-REPLY":
            pass
        return json.dumps(found["content"])

    def models(self, name: str) -> list[dict[str, Any]]:
        waiting, found = [json.loads(self.document())], []
        while waiting:
            each = waiting.pop()
            if isinstance(each, dict):
                found += [each] if each.get("name") == name and "id" in each else []
                waiting += each.values()
            elif isinstance(each, list):
                waiting += each
        return found

    def change(self, model: str, attribute: str, value: Any) -> None:
        event = {"kind": "ModelChanged", "model": {"id": model}, "attr": attribute, "new": value}
        self.send("PATCH-DOC", {"events": [event]})

    def show(self, *titles: str) -> None:
        """Show tabs one after the other, without titles all of them, until each is rendered."""
        (tabs,) = self.models("panel.models.tabs.Tabs")
        for number, each in enumerate(tabs["attributes"]["tabs"]):
            is_asked = not titles or each["attributes"]["title"] in titles
            place = each["attributes"]["child"]
            if is_asked and not place["attributes"].get("children"):
                self.change(tabs["id"], "active", number)
                while not self._is_filled(place["id"]):
                    pass

    def _is_filled(self, place: str) -> bool:
        return any(
            event.get("attr") == "children" and event["model"]["id"] == place
            for event in self.message()["content"].get("events", ())
        )

    def upload(self, dropper: str, name: str, data: bytes, chunk: int = 1, total: int = 1) -> None:
        """Send a piece of a file, as the drop zone does."""
        packed = base64.b64encode(_gzip(data)).decode()
        piece = {"name": name, "chunk": chunk, "total_chunks": total, "type": "",
                 "data": {"type": "bytes", "data": packed}}  # fmt: skip
        values = {"type": "map", "entries": [
            ["model", {"id": dropper}],
            ["data", {"type": "map", "entries": [[key, piece[key]] for key in piece]}],
        ]}  # fmt: skip
        self._tell("upload_event", values)

    def tell_built(self) -> None:
        self._tell("document_ready", {"type": "map", "entries": []})

    def _tell(self, name: str, values: dict[str, Any]) -> None:
        told = {"type": "event", "name": name, "values": values}
        event = {"kind": "MessageSent", "msg_type": "bokeh_event", "msg_data": told}
        self.send("PATCH-DOC", {"events": [event]})

    def is_closed(self) -> bool:
        """Return whether the server closes the websocket; waits for it."""
        try:
            while True:
                self.message()
        except ConnectionError:
            return True
        except TimeoutError:
            return False

    def close(self) -> None:
        self.socket.close()

    def _text(self) -> bytes:
        while True:
            opcode, data = self._frame()
            if opcode == 9:
                self.frame(data, 10)
            elif opcode == 8:
                raise ConnectionError("closed by the server")
            elif opcode != 10:
                return data

    def _frame(self) -> tuple[int, bytes]:
        first, second = self._bytes(2)
        size = second & 127
        if size >= 126:
            size = int.from_bytes(self._bytes(2 if size == 126 else 8), "big")
        return first & 15, self._bytes(size)

    def _bytes(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            more = self.socket.recv(min(size - len(data), 1 << 20))
            if not more:
                raise ConnectionError("closed by the server")
            data += more
        return data


def opens(url: str) -> None:
    with closing(Tab(url)) as tab:
        assert "duty_30min.csv.gz" in tab.document()


def is_forbidden(url: str, token: str, headers: dict[str, str]) -> bool:
    """Return whether a websocket is refused."""
    connection, head = upgrade(url, token, headers)
    connection.close()
    return " 403 " in head.split("\r\n")[0]


def upgrade(url: str, token: str, headers: dict[str, str]) -> tuple[socket.socket, str]:
    parts = urlsplit(url)
    connection = socket.create_connection((parts.hostname, parts.port), timeout=WAIT_S)
    lines = {
        "Host": parts.netloc, "Upgrade": "websocket", "Connection": "Upgrade",
        "Origin": f"http://{parts.netloc}", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(),
        "Sec-WebSocket-Protocol": f"bokeh, {token}",
        "Sec-WebSocket-Extensions": "permessage-deflate", **headers,
    }  # fmt: skip
    text = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
    connection.sendall(f"GET /ws HTTP/1.1\r\n{text}\r\n".encode())
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        more = connection.recv(1)
        if not more:
            break
        head += more
    return connection, head.decode("latin-1")


def _gzip(data: bytes) -> bytes:
    import gzip

    return gzip.compress(data)


def until(is_so, seconds: float = 180.0) -> None:
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.2)
