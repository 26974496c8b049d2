"""The server of the live view: an allow-list of answers behind the gate, and limits on clients."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from pathlib import Path
from socket import socket as Socket
from typing import Any
from urllib.parse import unquote

import panel as pn
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from panel.io.application import build_applications
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop

from .gate import Gate
from .handlers import (
    MAX_MESSAGE_BYTES,
    STATIC,
    IconHandler,
    PageHandler,
    Refused,
    SocketHandler,
    StaticHandler,
    TokenExchange,
)

MAX_CONNECTIONS = 200
"""Connections at a time; a tab keeps up to seven."""

HEADER_S = 15.0
"""Wait for the next request on a connection, and for all of its header [s]."""

BODY_S = 10.0
"""Wait for the body of a request [s]; the page sends none."""

MAX_BODY_BYTES = 10_000


class ViewApplication(BokehTornado):
    """Bokeh's application, of which only what stands in `find_handler` can be reached."""

    def __init__(self, apps: Any, gate: Gate) -> None:
        self._gate = gate
        super().__init__(
            apps,
            use_index=False,
            ico_path=str(Path(pn.__file__).parent / "dist" / "images" / "favicon.ico"),
            # a session is opened by a page that this server has sent, and by nothing else
            sign_sessions=True,
            secret_key=secrets.token_bytes(32),
            # what is kept of a request stands in the page: no cookies
            include_headers=["User-Agent"],
            include_cookies=[],
            check_unused_sessions_milliseconds=5_000,
            unused_session_lifetime_milliseconds=15_000,
            websocket_max_message_size_bytes=MAX_MESSAGE_BYTES,
            # the websocket looks by itself whether its browser is there
            keep_alive_milliseconds=0,
        )

    def find_handler(self, request: Any, **keywords: Any) -> Any:
        """Judge a request and name what answers it; every request comes this way."""
        refusal = self._gate.refusal(request)
        if refusal is not None:
            arguments = {"status": refusal.status, "words": refusal.words}
            return self.get_handler_delegate(request, Refused, arguments)
        if request.host.startswith("["):
            # Panel takes the host apart at its colons; the page knows its address by itself
            request.host = f"localhost:{self._gate.port}"
        handler, arguments, found = self._answer(request)
        return self.get_handler_delegate(request, handler, arguments, found)

    def _answer(self, request: Any) -> tuple[Any, dict[str, Any], list[bytes]]:
        session = {"application_context": self._applications["/"], "bokeh_websocket_path": "/ws"}
        ticket = self._gate.ticket
        if request.path == "/" and ticket is not None and self._gate.takes_token(request):
            cookie = {"name": self._gate.cookie_name, "cookie": ticket.cookie}
            return TokenExchange, cookie, []
        if request.path == "/":
            return PageHandler, session, []
        if request.path == "/ws":
            return SocketHandler, session, []
        if request.path == "/favicon.ico":
            return IconHandler, {}, []
        path = unquote(request.path)
        for pattern, package in STATIC:
            found = pattern.fullmatch(path)
            if found and ".." not in path:
                return StaticHandler, {"package": package}, [found.group(1).encode()]
        return Refused, {"status": 404, "words": "There is nothing here."}, []


class BoundedServer(HTTPServer):
    """A server that keeps a limited number of connections: a new one ends the oldest idle one."""

    def initialize(self, *positional: Any, **keywords: Any) -> None:
        """As `HTTPServer`."""
        super().initialize(*positional, **keywords)
        self._streams: list[Any] = []

    def handle_stream(self, stream: Any, address: Any) -> None:
        """Take a connection, or close it where there are too many."""
        self._streams = [each for each in self._streams if not each.closed()]
        if len(self._streams) >= MAX_CONNECTIONS:
            waiting = {connection.stream for connection in self._connections}
            oldest = next((each for each in self._streams if each in waiting), stream)
            oldest.close()
            if oldest is stream:
                return
        self._streams.append(stream)
        super().handle_stream(stream, address)


def serve(page: Callable[[], Any], sockets: Sequence[Socket], gate: Gate) -> BaseServer:
    """Return the server of a page, not started yet.

    Args:
        page: Makes the page of a tab.
        sockets: Bound and listening.
        gate: Judges requests.
    """
    silence(EMPTY_LAYOUT, True)
    application = ViewApplication(build_applications({"/": page}, title="heatrun"), gate)
    http = BoundedServer(
        application,
        idle_connection_timeout=HEADER_S,
        body_timeout=BODY_S,
        max_body_size=MAX_BODY_BYTES,
        max_buffer_size=2 * MAX_MESSAGE_BYTES,
    )
    http.add_sockets(sockets)
    return BaseServer(IOLoop.current(), application, http)
