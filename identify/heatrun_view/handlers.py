"""The server of the live view: the page, its websocket, its scripts, and nothing else.

Panel and Bokeh bring more: `/components/…` imports any module that is installed, `/autoload.js`
gives a session to any origin. A handler that `ViewApplication` does not name is not there, and
clients are limited in number, in time and in size.
"""

import base64
import binascii
import re
import secrets
import zlib
from collections.abc import Callable, Sequence
from functools import cached_property
from html import escape
from pathlib import Path
from socket import socket as Socket
from typing import Any
from urllib.parse import unquote, urlencode

import panel as pn
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.protocol.exceptions import ProtocolError
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.settings import settings
from panel.io.application import build_applications
from panel.io.server import DocHandler, WSHandler
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop, PeriodicCallback
from tornado.web import HTTPError, RequestHandler, StaticFileHandler

from .gate import Gate

MAX_MESSAGE_BYTES = 8_000_000
"""Largest message as it travels; the page sends files in pieces of 2 MB."""

MAX_UNPACKED_BYTES = 16_000_000
"""Most that the packed parts of a message may hold; BokehJS packs each file's piece by gzip."""

GZIP_FLAG = 16 + zlib.MAX_WBITS
STEP_BYTES = 1 << 20


def unpacked_bytes(content: Any) -> int:
    """Return how many bytes the packed parts of a message's content as JSON hold.

    Bokeh unpacks them without a limit: 1.3 MB of text may become 1 GB, and a list may name
    thousands of them.

    Raises:
        ProtocolError: If there are more than `MAX_UNPACKED_BYTES`, or a part is damaged.
    """
    total = 0
    waiting = [content]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            packed = each.get("data")
            if each.get("type") == "bytes" and isinstance(packed, str):
                total += _unpacked(packed, MAX_UNPACKED_BYTES - total)
            waiting.extend(each.values())
        elif isinstance(each, list):
            waiting.extend(each)
    return total


def _unpacked(packed: str, room: int) -> int:
    """Return how many bytes a part holds, at most `room`; no more than a piece is kept."""
    try:
        rest = base64.b64decode(packed)
    except (binascii.Error, ValueError) as error:
        raise ProtocolError("a part of the message is damaged") from error
    total = 0
    while rest:
        machine = zlib.decompressobj(GZIP_FLAG)
        while rest and not machine.eof:
            try:
                total += len(machine.decompress(rest, STEP_BYTES))
            except zlib.error as error:
                raise ProtocolError("a part of the message is damaged") from error
            rest = machine.unconsumed_tail
            if total > room:
                raise ProtocolError("the message unpacks to too much")
        rest = machine.unused_data.lstrip(b"\0")
    return total


HEADERS = {
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

SHUT = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
"""What no answer may do."""

STATIC = (
    (re.compile(r"/static/js/(bokeh(?:-[a-z]+)?\.min\.js)"), "bokeh"),
    (
        re.compile(
            r"/static/extensions/panel/"
            r"(panel\.min\.js|assets/[a-z]+_spinner\.svg|css/[a-z_]+\.css|bundled/(?:filedropper|reactiveesm|theme|"
            r"vanillatemplate)/[\w@^.%/-]+\.(?:js|css))"
        ),
        "panel",
    ),
)
"""Scripts and styles of the page, and the package that each lies in."""

LOOK_S = 20.0
"""How often the server looks whether a browser is still there [s]."""

MAX_SILENT_LOOKS = 3
"""Looks in a row at which a browser has neither said nor taken anything: then it is let go."""

SIDEBAR = 'document.getElementById("sidebar-button").onclick = closeNav;'


class Guarded(RequestHandler):
    """What all answers have in common."""

    def set_default_headers(self) -> None:
        """Forbid the browser what the page does not need."""
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.set_header("Content-Security-Policy", SHUT)
        self.clear_header("Server")

    def write_error(self, status_code: int, **keywords: Any) -> None:
        """Say what is refused, in plain text; what was asked for is not repeated."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")


class Refused(Guarded):
    """A request that is not let in, whatever it asks for."""

    def initialize(self, status: int, words: str) -> None:
        """Take the answer."""
        self._status, self._words = status, words

    def prepare(self) -> None:
        """Answer."""
        self.set_status(self._status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{self._status}: {self._words}\n")


class TokenExchange(Guarded):
    """Gives the cookie for the token and opens the page without the token in its address.

    It opens it by a page of its own and not by a redirect: a browser that came from elsewhere
    would not send the cookie along a redirect.
    """

    def initialize(self, name: str, cookie: str) -> None:
        """Take the cookie."""
        self._name, self._value = name, cookie

    def get(self) -> None:
        """Set the cookie and go on."""
        self.set_cookie(self._name, self._value, httponly=True, samesite="Strict", path="/")
        self.set_header("Cache-Control", "no-store")
        pairs = [
            (name, value.decode("utf-8", "replace"))
            for name, values in self.request.query_arguments.items()
            if name != "token"
            for value in values
        ]
        url = escape("/?" + urlencode(pairs) if pairs else "/")
        self.finish(
            f'<!doctype html><meta http-equiv="refresh" content="0;url={url}">'
            f'<title>heatrun</title><a href="{url}">heatrun</a>'
        )


class PageHandler(Guarded, DocHandler):
    """The page."""

    MAX_SESSIONS = 60
    """Tabs at a time, those that were just closed included."""

    @cached_property
    def _nonce(self) -> str:
        """The mark of the page's own scripts; a refusal is written without one having been sent."""
        return secrets.token_urlsafe(16)

    async def get(self) -> None:
        """Send the page, whose own scripts alone may run."""
        if len(self.application_context._sessions) >= self.MAX_SESSIONS:
            self.set_header("Retry-After", "20")
            raise HTTPError(503, reason="Too many tabs are open; close some and try again soon")
        # A script in the page must bear this mark. 'unsafe-eval' is for BokehJS, which makes
        # functions of the texts of CustomJS; inline styles are how Bokeh places everything.
        host = self.request.headers["Host"]
        self.set_header(
            "Content-Security-Policy",
            f"{SHUT}; script-src 'self' 'nonce-{self._nonce}' 'unsafe-eval'; "
            "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
            f"connect-src 'self' ws://{host}",
        )
        await super().get()  # pyright: ignore[reportGeneralTypeIssues]

    def write(self, chunk: Any) -> None:
        """Mark the scripts of the page; there is nothing in it yet that comes from files."""
        if isinstance(chunk, str):
            # the template's button says its script in an attribute, which cannot be marked
            chunk = chunk.replace(' onclick="closeNav()"', "")
            chunk = chunk.replace("</body>", f"<script>{SIDEBAR}</script></body>")
            chunk = re.sub(r"<script(?=[\s>])", f'<script nonce="{self._nonce}"', chunk)
        super().write(chunk)


class SocketHandler(Guarded, WSHandler):
    """The websocket of the page, whose messages are of limited size however they are packed.

    A browser behind a slow line answers a ping only when it has read all that was sent before:
    what it takes meanwhile counts as a sign of life too.
    """

    _num_pending = 0
    _is_heard = True
    _num_silent = 0
    _looks: PeriodicCallback | None = None

    def open(self, *positional: Any, **keywords: Any) -> Any:
        """Begin to look whether the browser is still there."""
        self._looks = PeriodicCallback(self._look, 1e3 * LOOK_S)
        self._looks.start()
        return super().open(*positional, **keywords)

    def on_close(self) -> None:
        """Look no longer."""
        if self._looks is not None:
            self._looks.stop()
        super().on_close()

    def on_pong(self, data: bytes) -> None:
        """Take a sign of life."""
        self._is_heard = True
        super().on_pong(data)

    async def on_message(self, fragment: str | bytes) -> Any:
        """Take a sign of life and the message."""
        self._is_heard = True
        return await super().on_message(fragment)

    async def write_message(self, *positional: Any, **keywords: Any) -> None:
        """Send; that there was room for all of it is a sign of life."""
        await super().write_message(*positional, **keywords)
        self._is_heard = True

    def _look(self) -> None:
        self._num_silent = 0 if self._is_heard else self._num_silent + 1
        self._is_heard = False
        if self._num_silent < MAX_SILENT_LOOKS:
            self.ping(b"0")
        else:
            self.close(reason="nothing was heard of the browser")

    def check_origin(self, origin: str) -> bool:
        """Return True: the gate has let the request in, which knows the names better."""
        return True

    def get_compression_options(self) -> None:
        """Take no packed frames: a few bytes may hold anything."""

    async def _receive(self, fragment: str | bytes) -> Any:
        self._num_pending += len(fragment)
        if self._num_pending > MAX_MESSAGE_BYTES:
            self._protocol_error("the message is too large")
            return None
        message = await super()._receive(fragment)
        if message is None:
            return None
        self._num_pending = 0
        try:
            unpacked_bytes(message.content)
        except ProtocolError as error:
            self._protocol_error(str(error))
            return None
        return message


class StaticHandler(Guarded, StaticFileHandler):
    """Scripts and styles of Bokeh and Panel."""

    def initialize(self, package: str) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Take the package that the file belongs to."""
        of_panel = Path(pn.__file__).parent / "dist"
        folder = Path(settings.bokehjs_path()) / "js" if package == "bokeh" else of_panel
        super().initialize(path=str(folder))


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
        if refusal:
            arguments = {"status": 403, "words": refusal}
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
            return StaticHandler, {"package": "panel"}, [b"images/favicon.ico"]
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
    """Return the server of a page, not started yet."""
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
