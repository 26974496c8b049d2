"""The server of the live view: its address, bound once, its folder, its jobs, and its end."""

import ipaddress
import socket
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import panel as pn
from tornado.netutil import bind_sockets

from heatrun.errors import InputError

from .gate import Gate, Ticket
from .handlers import serve
from .look import PART_CSS
from .running_jobs import JobQueue
from .store import Folder, RecordStore, UploadRoom
from .tabs.page import Page
from .words import problem

LARGEST_PORT = 65535


@dataclass(frozen=True)
class Binding:
    """Where the server listens."""

    sockets: Sequence[socket.socket]  # Bound and listening, all on one port.
    port: int  # TCP port.
    # Host names that are served, in lower case; numeric addresses go without saying.
    names: frozenset[str]
    url: str  # The page's address, without a token.
    is_loopback: bool  # Whether it is reachable from this machine alone.


def bind(address: str, port: int) -> Binding:
    """Listen on a host name of this machine or an IPv4 or IPv6 address, at a port; 0 is a free one.

    `0.0.0.0` and `::` are all of its addresses.

    Raises:
        InputError: If the address is none of this machine, or the port is taken or forbidden.
    """
    if not 0 <= port <= LARGEST_PORT:
        raise InputError(
            f"Expected a port from 0 to {LARGEST_PORT}, got {port}.",
            remedy="Choose another one with --port; 0 takes a free one.",
        )
    asked = address.strip().removeprefix("[").removesuffix("]")
    found = _resolved(asked)
    try:
        sockets = bind_sockets(port, asked)
    except (OSError, OverflowError) as error:
        raise InputError(
            f"Port {port} of {address} cannot be used: {getattr(error, 'strerror', error)}.",
            remedy="Choose another one with --port, or another address of this machine with "
            "--address.",
        ) from error
    is_loopback = all(each.is_loopback for each in found)
    is_every = any(each.is_unspecified for each in found)
    host = f"[{found[0]}]" if found[0].version == 6 else str(found[0])
    names: set[str] = set()
    if not _is_number(asked):
        host = asked.lower()
        names.add(host)
    if is_loopback or is_every:
        names.add("localhost")
    if is_every:
        host = socket.gethostname().lower()
        names |= _own_names()
    actual = sockets[0].getsockname()[1]
    url = f"http://{host}:{actual}/"
    return Binding(tuple(sockets), actual, frozenset(names), url, is_loopback)


def _resolved(asked: str) -> list[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    try:
        if not asked:
            raise ValueError("it is empty")
        # UnicodeError, a ValueError: a name with a part of more than 63 characters
        entries = socket.getaddrinfo(asked, None, type=socket.SOCK_STREAM)
        return [ipaddress.ip_address(entry[4][0]) for entry in entries]
    except (OSError, ValueError) as error:
        raise InputError(
            f"Expected an address or a name of this machine, got {asked[:80]!r} "
            f"({getattr(error, 'strerror', None) or error}).",
            remedy="Write --address 127.0.0.1 for this machine alone, or its name or number in "
            "the network.",
        ) from error


def _is_number(asked: str) -> bool:
    """Return whether an address is numeric, also in forms such as `0` and `127.1`."""
    try:
        socket.getaddrinfo(asked, None, flags=socket.AI_NUMERICHOST)
    except OSError:
        return False
    return True


def _own_names() -> set[str]:
    names = {socket.gethostname().lower()}
    with suppress(OSError):
        names.add(socket.getfqdn().lower())
    short = {name.partition(".")[0] for name in names}
    return names | short | {f"{name}.local" for name in short}


LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class ViewServer:
    """A server that listens and is not started yet; its address has the token, if one is asked."""

    url: str
    is_loopback: bool
    _server: Any
    _queue: JobQueue
    _uploads: tempfile.TemporaryDirectory[str]

    @property
    def loop(self) -> Any:
        """The event loop that serves."""
        return self._server.io_loop

    def run(self) -> None:
        """Serve until the loop is stopped."""
        self._server.start()
        self.loop.start()

    def close(self) -> None:
        """End the commands that run, and remove what was sent."""
        self._queue.close()
        self._server.stop()
        self._uploads.cleanup()


def make_server(
    folder: Path,
    out: Path,
    *,
    port: int = 5006,
    address: str = LOOPBACK,
    asks_token: bool = False,
    max_file_bytes: int,
    max_upload_bytes: int,
) -> ViewServer:
    """Return the server, not started yet.

    Args:
        folder: The tests and motor files that it shows; nothing else can be opened.
        out: Where run folders and reports go.
        port: TCP port; 0 takes a free one.
        address: Network address; the default is reachable from this machine alone. Any other
            asks for a token.
        asks_token: Ask for a token at loopback too, for machines with several users.
        max_file_bytes: Largest file that is opened [byte].
        max_upload_bytes: Sum of uploads of all pages [byte].

    Raises:
        InputError: If the folder is none, or the address or port cannot be used.
    """
    shown = Folder(folder)
    binding = bind(address, port)
    store, queue = RecordStore(max_file_bytes), JobQueue()
    uploads = tempfile.TemporaryDirectory(prefix="heatrun-uploads-")
    room = UploadRoom(Path(uploads.name), max_upload_bytes)

    pages: WeakKeyDictionary[Any, Page] = WeakKeyDictionary()

    def page() -> Any:
        try:
            made = Page(shown, out, room, store, queue)
        except Exception as error:
            return pn.pane.HTML(problem("the page", error))
        pages[pn.state.curdoc] = made
        return made.view

    def say(error: BaseException) -> None:
        """Show an error on the page that it happened on, which goes on."""
        told = problem("the page", error if isinstance(error, Exception) else Exception(error))
        found = pages.get(pn.state.curdoc)
        if found is not None:
            found.say(told)

    pn.config.exception_handler = say
    pn.config.raw_css = [PART_CSS]

    ticket = Ticket() if asks_token or not binding.is_loopback else None
    server = serve(page, binding.sockets, Gate(binding.names, binding.port, ticket))
    url = binding.url if ticket is None else f"{binding.url}?token={ticket.token}"
    return ViewServer(url, binding.is_loopback, server, queue, uploads)
