"""Addresses that others can reach: the token, real names, and addresses that are none."""

import re
import socket
from urllib.parse import urlsplit

import pytest


def _split(url: str) -> tuple[str, str]:
    """Return the address at loopback and the token of a printed one."""
    parts = urlsplit(url)
    return f"http://127.0.0.1:{parts.port}/", parts.query.removeprefix("token=")


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory, served_class, warm):
    """A server at all addresses of this machine, reached through loopback alone."""
    folder = tmp_path_factory.mktemp("everywhere") / "bench"
    folder.mkdir()
    (folder / "mine.csv").write_text("time_s,winding_degC\n0,20\n1,21\n")
    server = served_class(folder, "--address", "0.0.0.0", warm=warm)
    try:
        yield server
    finally:
        server.close()


def test_nothing_is_served_without_the_token(everywhere, wire):
    url, token = _split(everywhere.url)
    assert len(token) > 40
    assert "warning: everyone in the network" in everywhere.log.read_text()
    for path in ("/", "/ws", "/static/js/bokeh.min.js", "/favicon.ico", f"/ws?token={token}",
                 f"/static/js/bokeh.min.js?token={token}", "/?token=", f"/?token={token}x",
                 f"/?token={token[:-1]}", f"/?token={token}&token={token}", "/?token=%ff",
                 f"/?token={token.swapcase()}"):  # fmt: skip
        status, _, body = wire.ask(url, path)
        assert status == 403, path
        assert b"mine.csv" not in body
    assert wire.is_forbidden(url, "x", {})


def test_the_token_is_exchanged_for_a_cookie_of_this_site_alone(everywhere, wire, open_tab):
    url, token = _split(everywhere.url)
    status, headers, body = wire.ask(url, f"/?token={token}&test=mine.csv&theme=%22%3E%3Cb%3E")
    assert status == 200
    cookie = headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert token not in cookie
    assert token.encode() not in body
    assert b'url=/?test=mine.csv&amp;theme=%22%3E%3Cb%3E"' in body
    held = {"Cookie": cookie.split(";")[0]}
    tab = open_tab(url, "?test=mine.csv", **held)
    assert "mine.csv" in tab.document()
    page = wire.ask(url, "/", held)[2]
    assert cookie.split(";")[0].split("=")[1].encode() not in page
    assert wire.is_forbidden(url, wire.token_of(page), {})
    wrong = {"Cookie": held["Cookie"][:-2]}
    assert wire.ask(url, "/", wrong)[0] == 403


def test_another_page_may_link_to_the_address_but_ask_for_nothing_else(everywhere, wire):
    url, token = _split(everywhere.url)
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate",
            "Sec-Fetch-Dest": "document"}  # fmt: skip
    assert wire.ask(url, f"/?token={token}", link)[0] == 200
    assert wire.ask(url, "/?token=wrong", link)[0] == 403
    for other in ({"Sec-Fetch-Dest": "iframe"}, {"Sec-Fetch-Mode": "no-cors"},
                  {"Origin": "http://evil.example"}, {"Host": "evil.example"}):  # fmt: skip
        assert wire.ask(url, f"/?token={token}", link | other)[0] == 403


def test_the_machines_own_names_are_served_and_no_others(everywhere, wire):
    url, token = _split(everywhere.url)
    port = urlsplit(url).port
    for name in (socket.gethostname(), "localhost", "127.0.0.1"):
        host = {"Host": f"{name}:{port}"}
        assert wire.ask(url, f"/?token={token}", host)[0] == 200, name
    for name in ("0.0.0.0", "evil.example", "192.0.2.1", "[::1]", "127.0.0.1."):
        host = {"Host": f"{name}:{port}"}
        assert wire.ask(url, f"/?token={token}", host)[0] == 403, name


def test_a_token_can_be_asked_for_at_loopback(serve, wire):
    url, token = _split(serve("--token").url)
    assert wire.ask(url, "/")[0] == 403
    assert wire.ask(url, f"/?token={token}")[0] == 200


def _has_v6() -> bool:
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


@pytest.mark.skipif(not _has_v6(), reason="no IPv6 here")
def test_the_loopback_of_ipv6_is_served_under_its_name(serve, wire, open_tab):
    server = serve("--address", "::1")
    assert re.fullmatch(r"http://\[::1\]:\d+/", server.url)
    tab = open_tab(server.url)
    assert "duty_30min.csv.gz" in tab.document()
    port = urlsplit(server.url).port
    for host in (f"::1:{port}", f"127.0.0.1:{port}", f"[::2]:{port}", f"[::1%lo]:{port}"):
        assert wire.ask(server.url, "/", {"Host": host})[0] in (400, 403), host


def test_a_real_name_is_served(serve, wire):
    name = socket.gethostname()
    try:
        socket.getaddrinfo(name, None)
    except OSError:
        pytest.skip("this machine does not know its own name")
    server = serve("--address", name)
    parts = urlsplit(server.url)
    assert parts.hostname == name.lower()
    assert wire.ask(server.url, f"/?{parts.query}")[0] == 200
    assert (
        wire.ask(server.url, f"/?{parts.query}", {"Host": f"evil.example:{parts.port}"})[0] == 403
    )


NO_ADDRESSES = (
    ("--address", ""), ("--address", "no-such-host.invalid"), ("--address", "300.0.0.1"),
    ("--address", "192.0.2.1"), ("--address", "a" * 300), ("--address", "http://127.0.0.1"),
    ("--address", "::g"), ("--port", "70000"), ("--port", "-1"),
)  # fmt: skip


@pytest.mark.parametrize("options", NO_ADDRESSES)
def test_an_address_that_is_none_is_an_error_in_words(warm, tmp_path, options):
    log = tmp_path / "said.log"
    assert warm.start(["view", str(tmp_path), "--no-browser", *options], log).wait() == 1
    errors = log.read_text()
    assert "Traceback" not in errors
    assert "--address" in errors or "--port" in errors
