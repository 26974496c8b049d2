"""The server of the live view: its folder, its address, its jobs, and its end."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import panel as pn

from ..folder import Folder
from ..jobs.running import JobQueue
from ..look import PART_CSS
from ..reading import problem
from ..store import RecordStore
from ..tabs.page import Page
from ..uploads import UploadRoom
from .binding import bind
from .gate import Gate, Ticket
from .serving import serve

LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class ViewServer:
    """A server that listens and is not started yet.

    Attributes:
        url: The page's address, with its token where one is asked for.
        is_loopback: Whether it is reachable from this machine alone.
    """

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
