"""The server of the live view: on this machine alone, for pages of its own alone."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import panel as pn
from bokeh.server.auth_provider import NullAuth
from tornado.web import HTTPError

from ..errors import InputError
from .folder import Folder
from .jobs import JobQueue
from .page import Page
from .store import RecordStore

LOOPBACK = "127.0.0.1"


class OwnHostOnly(NullAuth):
    """Refuses requests that name another host, such as those of a page that was bound to this one.

    The websocket, on which everything but the page's frame travels, checks its origin against the
    same names.
    """

    def __init__(self, hosts: frozenset[str]) -> None:
        self._hosts = hosts

    @property
    def get_user(self) -> Any:
        """Return the check; there are no users apart."""

        def check(handler: Any) -> str:
            if handler.request.host.lower() not in self._hosts:
                raise HTTPError(403, reason="This host name is not served")
            return "bench"

        return check

    @property
    def login_url(self) -> Any:
        """Nobody is ever sent there."""
        return "/"


def make_server(
    folder: Path,
    out: Path,
    *,
    port: int = 5006,
    address: str = LOOPBACK,
    max_file_bytes: int,
    max_upload_bytes: int,
) -> Any:
    """Return the server, not started yet.

    Args:
        folder: The tests and motor files that it shows; nothing else can be opened.
        out: Where run folders and reports go.
        port: TCP port; 0 takes a free one.
        address: Network address; the default is reachable from this machine alone.
        max_file_bytes: Largest file that is opened [byte].
        max_upload_bytes: Sum of uploads of a page [byte].

    Raises:
        InputError: If the folder is none, or the port is taken.
    """
    shown = Folder(folder)
    store, queue = RecordStore(max_file_bytes), JobQueue()
    uploads = tempfile.TemporaryDirectory(prefix="heatrun-uploads-")

    def page() -> Any:
        return Page(shown, out, Path(uploads.name), store, queue, max_upload_bytes).view

    try:
        server = _bind({"/": page}, address, port)
    except OSError as error:
        raise InputError(
            f"Port {port} of {address} cannot be used: {error.strerror}.",
            remedy="Choose another one with --port.",
        ) from error
    server.heatrun_uploads = uploads  # lives as long as the server
    return server


def _bind(apps: dict[str, Any], address: str, port: int) -> Any:
    """Bind first, so that the names that may be asked for carry the port."""
    from bokeh.server.util import bind_sockets

    sockets, bound = bind_sockets(address, port)
    for socket in sockets:
        socket.close()
    names = {address, "localhost"} if address == LOOPBACK else {address}
    hosts = frozenset(f"{name}:{bound}" for name in names)
    return pn.io.server.get_server(
        apps,
        port=bound,
        address=address,
        websocket_origin=sorted(hosts),
        auth_provider=OwnHostOnly(hosts),
        title="heatrun",
        show=False,
        start=False,
        check_unused_sessions=10_000,
        unused_session_lifetime=30_000,
        websocket_max_message_size=8_000_000,
    )
