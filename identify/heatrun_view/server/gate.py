"""Who may ask: requests that the page makes itself, or that a user makes by typing its address.

A page of a stranger in the same browser reaches this server too, and so does, by a name that is
bound to this machine, a page that the browser takes for one of ours. Their requests carry a Host,
an Origin or a Sec-Fetch-Site that is not ours. Every request is judged here before any handler
sees it.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from dataclasses import dataclass, field
from typing import Any

HTTP_PORT = 80
"""The port that a browser leaves out of Host and Origin."""

OWN_SITES = (None, "none", "same-origin")
"""Values of Sec-Fetch-Site of a typed address and of the page itself; None is a client that does
not send it, which Host and Origin judge alone."""


@dataclass(frozen=True)
class Refusal:
    """Why a request is refused.

    Attributes:
        status: HTTP status.
        words: What the user may do about it.
    """

    status: int
    words: str


@dataclass(frozen=True)
class Ticket:
    """The secret of an address that others on the network can reach.

    Attributes:
        token: Stands in the address that is printed.
        cookie: What the browser gets for it and sends from then on.
    """

    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(32))

    def is_token(self, text: str) -> bool:
        """Return whether a text is the token, in a time that does not depend on the text."""
        return hmac.compare_digest(text.encode(), self.token.encode())

    def is_cookie(self, text: str) -> bool:
        """Return whether a text is the cookie's, in a time that does not depend on the text."""
        return hmac.compare_digest(text.encode(), self.cookie.encode())


@dataclass(frozen=True)
class Gate:
    """Judges requests.

    Attributes:
        names: Host names that are served, in lower case. Numeric addresses need not stand here:
            the one that a connection came in on is served.
        port: TCP port.
        ticket: Asked for; None lets everyone in who reaches the address, which is for loopback.
    """

    names: frozenset[str]
    port: int
    ticket: Ticket | None = None

    @property
    def cookie_name(self) -> str:
        """Name of the cookie; browsers share cookies between the ports of a host."""
        return f"heatrun-{self.port}"

    def refusal(self, request: Any) -> Refusal | None:
        """Return why a request is refused, None if it is let in.

        Args:
            request: Tornado's request, of which the headers and the connection count.
        """
        host = request.headers.get("Host", "").lower()
        if not self._is_own(host, request):
            return Refusal(
                403, "This host name is not served. Open the address that heatrun view printed."
            )
        # Websocket clients of before 2011 called it Sec-WebSocket-Origin; Tornado still reads it.
        for name in ("Origin", "Sec-WebSocket-Origin"):
            origin = request.headers.get(name)
            if origin is not None and origin.lower() != f"http://{host}":
                return Refusal(403, "Requests of other pages are refused.")
        has_token = self.takes_token(request)
        if request.headers.get("Sec-Fetch-Site") not in OWN_SITES and not has_token:
            return Refusal(
                403,
                "Another page has sent you here, which is refused. Type the address that heatrun "
                "view printed, or open it from a bookmark.",
            )
        if self.ticket is not None and not has_token and not self._has_cookie(request):
            return Refusal(
                403,
                "This address asks for its token. Open the whole address that heatrun view "
                "printed, with ?token=….",
            )
        return None

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
        return len(found) == 1 and self.ticket.is_token(found[0].decode("utf-8", "replace"))

    def _has_cookie(self, request: Any) -> bool:
        assert self.ticket is not None
        found = request.cookies.get(self.cookie_name)
        return found is not None and self.ticket.is_cookie(found.value)

    def _is_own(self, host: str, request: Any) -> bool:
        name = _without_port(host, self.port)
        if name is None:
            return False
        if name in self.names:
            return True
        try:
            asked = ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return False
        is_bracketed = name.startswith("[") and name.endswith("]")
        return is_bracketed == (asked.version == 6) and asked == _reached(request)


def _without_port(host: str, port: int) -> str | None:
    """Return the name of a Host header, None if its port is another one."""
    if host.endswith(f":{port}"):
        return host.removesuffix(f":{port}")
    is_plain = ":" not in host or host.endswith("]")
    return host if port == HTTP_PORT and is_plain else None


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
