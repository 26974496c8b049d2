"""Who may ask, and what may be opened: nothing of a stranger's page, nothing outside a folder.

A page of a stranger in the same browser reaches this server too, and so does, by a name that is
bound to this machine, a page that the browser takes for one of ours. Their requests carry a Host,
an Origin or a Sec-Fetch-Site that is not ours. Every request is judged here before any handler sees
it; what the page makes itself, or a user by typing its address, is let in.
"""

import hmac
import ipaddress
import os
import secrets
import stat
from contextlib import suppress
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.whole_files import PARTIAL, write_whole

HTTP_PORT = 80
"""The port that a browser leaves out of Host and Origin."""

OWN_SITES = (None, "none", "same-origin")
"""Values of Sec-Fetch-Site of a typed address and of the page itself; None is a client that does
not send it, which Host and Origin judge alone."""


@dataclass(frozen=True)
class Ticket:
    """The secret of an address that others on the network can reach.

    The token stands in the address that is printed; the browser gets the cookie for it, and sends
    that from then on.
    """

    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(32))


def _is_same(text: str, secret: str) -> bool:
    """Return whether a text is a secret, in a time that does not depend on the text."""
    return hmac.compare_digest(text.encode(), secret.encode())


@dataclass(frozen=True)
class Gate:
    """Judges requests."""

    # Host names that are served, in lower case. Numeric addresses need not stand here: the one that
    # a connection came in on is served.
    names: frozenset[str]
    port: int  # TCP port.
    # Asked for; None lets everyone in who reaches the address, which is for loopback.
    ticket: Ticket | None = None

    @property
    def cookie_name(self) -> str:
        """Name of the cookie; browsers share cookies between the ports of a host."""
        return f"heatrun-{self.port}"

    def refusal(self, request: Any) -> str:
        """Return why a request of Tornado's is refused, and what the user may do; or nothing."""
        host = request.headers.get("Host", "").lower()
        if not self._is_own(host, request):
            return "This host name is not served. Open the address that heatrun view printed."
        # Websocket clients of before 2011 called it Sec-WebSocket-Origin; Tornado still reads it.
        for name in ("Origin", "Sec-WebSocket-Origin"):
            origin = request.headers.get(name)
            if origin is not None and origin.lower() != f"http://{host}":
                return "Requests of other pages are refused."
        has_token = self.takes_token(request)
        if request.headers.get("Sec-Fetch-Site") not in OWN_SITES and not has_token:
            return (
                "Another page has sent you here, which is refused. Type the address that heatrun "
                "view printed, or open it from a bookmark."
            )
        if self.ticket is not None and not has_token and not self._has_cookie(request):
            return (
                "This address asks for its token. Open the whole address that heatrun view "
                "printed, with ?token=…."
            )
        return ""

    def takes_token(self, request: Any) -> bool:
        """Return whether a request opens the page with the right token in its address.

        The user may come from anywhere with it, a mail or a chat; nothing is done on such a
        request but to exchange the token for the cookie.
        """
        if self.ticket is None or request.path != "/" or request.method != "GET":
            return False
        if request.headers.get("Sec-Fetch-Mode", "navigate") != "navigate":
            return False
        if request.headers.get("Sec-Fetch-Dest", "document") != "document":
            return False
        found = request.query_arguments.get("token", [])
        return len(found) == 1 and _is_same(found[0].decode("utf-8", "replace"), self.ticket.token)

    def _has_cookie(self, request: Any) -> bool:
        assert self.ticket is not None
        found = request.cookies.get(self.cookie_name)
        return found is not None and _is_same(found.value, self.ticket.cookie)

    def _is_own(self, host: str, request: Any) -> bool:
        is_plain = ":" not in host or host.endswith("]")
        if host.endswith(f":{self.port}"):
            name = host.removesuffix(f":{self.port}")
        elif self.port == HTTP_PORT and is_plain:
            name = host
        else:
            return False
        if name in self.names:
            return True
        try:
            asked = ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return False
        is_bracketed = name.startswith("[") and name.endswith("]")
        return is_bracketed == (asked.version == 6) and asked == _reached(request)


def _reached(request: Any) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Return the address of this machine that a request's connection came in on."""
    socket = request.connection.stream.socket
    if socket is None:
        return None
    try:
        # An address of one link carries the name of its interface, which no browser sends.
        return ipaddress.ip_address(socket.getsockname()[0].partition("%")[0])
    except (OSError, ValueError):
        return None


HAS_FOLDERS = os.open in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
"""Whether the system opens a file relative to an open folder; Windows does not."""

FOLDER_FLAGS = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
FILE_FLAGS = (
    os.O_RDONLY
    | getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)  # a FIFO would wait for its writer, a device for itself
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_BINARY", 0)
)
CLOEXEC = getattr(os, "O_CLOEXEC", 0)


def open_inside(root: Path, path: Path) -> BufferedReader:
    """Open a regular file in a folder for reading.

    A path that was looked at and is opened afterwards may have become a link in between. So the
    folders on the way are opened one in the other, none of them through a link, and the file in the
    last one.

    Links that stay inside the folder are followed: they are resolved first, and what comes of it
    is opened without any.

    Raises:
        InputError: If it is none, or lies outside the folder by `..`, an absolute path or a link.
    """
    try:
        steps = (root / path).resolve().relative_to(root).parts
        if not steps:
            raise InputError("Expected a file, got a directory.", where=str(path))
        descriptor = _open_in_steps(root, steps) if HAS_FOLDERS else _open_checked(root, steps)
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: links in a circle
        raise outside(str(path)) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise no_regular_file(str(path))
    return os.fdopen(descriptor, "rb")


def outside(where: str) -> InputError:
    """Return the error of a file that is not in the folder."""
    return InputError(
        "Expected a file in the folder that is shown; this is none.",
        where=repr(where),
        remedy="Put the file into the folder, or start heatrun view on its folder.",
    )


def no_regular_file(where: str) -> InputError:
    """Return the error of a pipe, a device or a folder."""
    return InputError(
        "Expected a file in the folder that is shown, got a pipe, a device or a folder.",
        where=repr(where),
        remedy="Copy what comes out of it into a file.",
    )


def _open_in_steps(root: Path, steps: tuple[str, ...]) -> int:
    folder = _folder_of(root, steps)
    try:
        # Some devices act when they are opened, so what is known to be one is not.
        status = os.stat(steps[-1], dir_fd=folder, follow_symlinks=False)
        if not stat.S_ISREG(status.st_mode):
            raise no_regular_file(steps[-1])
        return os.open(steps[-1], FILE_FLAGS | CLOEXEC, dir_fd=folder)
    finally:
        os.close(folder)


def _folder_of(root: Path, steps: tuple[str, ...]) -> int:
    """Return the open folder of a file; none on the way to it is opened through a link."""
    folder = os.open(root, FOLDER_FLAGS | CLOEXEC)
    try:
        for step in steps[:-1]:
            inner = os.open(step, FOLDER_FLAGS | CLOEXEC, dir_fd=folder)
            os.close(folder)
            folder = inner
    except BaseException:
        os.close(folder)
        raise
    return folder


def _open_checked(root: Path, steps: tuple[str, ...]) -> int:
    """Open by path and look where it led; a link could be there for the time of the opening."""
    path = root.joinpath(*steps)
    descriptor = os.open(path, FILE_FLAGS | CLOEXEC)
    found = path.resolve()
    if found.is_relative_to(root) and os.path.samestat(os.fstat(descriptor), found.stat()):
        return descriptor
    os.close(descriptor)
    raise outside(str(path))


def read_inside(root: Path, path: Path, max_bytes: int) -> bytes:
    """Return the content of a regular file in a folder, of so many bytes at most.

    Raises:
        InputError: If it is none, lies outside the folder, cannot be read or is larger.
    """
    try:
        with open_inside(root, path) as file:
            content = file.read(max_bytes + 1)
    except OSError as error:
        raise outside(str(path)) from error
    if len(content) > max_bytes:
        raise InputError(
            f"Expected a file of at most {max_bytes / 1e6:.0f} MB, got a larger one.",
            where=str(path),
            remedy="Open it from the folder itself.",
        )
    return content


def is_inside(root: Path, path: Path) -> bool:
    """Return whether a path is a regular file in a folder, for lists of what may be opened."""
    try:
        found = path.resolve()
        return found.is_relative_to(root) and stat.S_ISREG(found.lstat().st_mode)
    except (OSError, ValueError, RuntimeError):  # RuntimeError: links in a circle
        return False


def replace_inside(root: Path, path: Path, before: bytes, after: bytes) -> None:
    """Put another content into a regular file in a folder, whole or not at all.

    With anything but what it held before in it, it stays.

    Raises:
        InputError: If it is none, lies outside the folder, holds something else by now or cannot
            be written.
    """
    with open_inside(root, path) as file:
        is_same = file.read(len(before) + 1) == before
        mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
    if not is_same:
        raise InputError(
            "The file was changed meanwhile; it was not written.",
            where=path.name,
            remedy="Look at it, and press the button again.",
        )
    try:
        steps = (root / path).resolve().relative_to(root).parts
        if not HAS_FOLDERS:
            write_whole(root.joinpath(*steps), after)
            return
        folder = _folder_of(root, steps)
        try:
            _write_beside(folder, steps[-1], after, mode)
        finally:
            os.close(folder)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"The file cannot be written ({getattr(error, 'strerror', None) or error}).",
            where=path.name,
            remedy="Make the folder writable, or put the lines in by hand.",
        ) from error


def _write_beside(folder: int, name: str, content: bytes, mode: int) -> None:
    """Write a file in an open folder under another name, and give it its own then."""
    partial = f".{name}.{os.getpid()}{PARTIAL}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | CLOEXEC
    descriptor = os.open(partial, flags, mode, dir_fd=folder)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            os.fchmod(file.fileno(), mode)
        os.replace(partial, name, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        with suppress(OSError):
            os.unlink(partial, dir_fd=folder)
        raise
