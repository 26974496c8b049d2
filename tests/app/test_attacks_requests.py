"""Requests that no page of heatrun makes, sent to a running server: refused, and the page lives."""

import base64
import json
import time

import pytest

pytestmark = pytest.mark.usefixtures("lives")
PLACES = (
    "/", "/ws", "/favicon.ico", "/static/js/bokeh.min.js",
    "/static/extensions/panel/panel.min.js", "/components/this/a/b/c", "/nothing",
)  # fmt: skip


def _port(served) -> str:
    return served.url.rsplit(":", 1)[1].strip("/")


@pytest.mark.parametrize("module", ["this", "unittest.__main__", "venv.__main__", "heatrun.cli"])
def test_no_module_is_imported_for_a_request(served, wire, module):
    assert wire.ask(served.url, f"/components/{module}/a/b/c")[0] == 404
    assert served.process.poll() is None
    assert "Beautiful is better than ugly" not in served.log.read_text()
    assert not (served.folder / "a").exists()


NOTHING = (
        "/autoload.js?bokeh-autoload-element=1", "/metadata", "/index", "/admin", "/rest",
        "/liveness", "/files", "/static/", "/static/js/", "/static/js/compiler.js",
        "/static/../../motor.toml",
        "/static/extensions/panel/", "/static/extensions/panel/panel.json",
        "/static/extensions/panel/../__init__.py",
        "/static/extensions/panel/bundled/theme/../../../__init__.py",
        "/static/extensions/panel/bundled/theme/%2e%2e/%2e%2e/%2e%2e/config.py",
        "/static/js/..%2f..%2f..%2fserver%2fserver.py", "/static/%2e%2e/%2e%2e/x",
        "/../motor.toml", "//etc/passwd", "/ws/", "/%00",
)  # fmt: skip


def test_what_is_not_on_the_list_is_not_there(served, wire):
    for path in NOTHING:
        status, headers, body = wire.ask(served.url, path)
        assert status in (400, 404), path
        assert "access-control-allow-origin" not in headers
        assert len(body) < 200


def test_nothing_but_reading_is_answered(served, wire):
    for method in ("HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
        assert wire.ask(served.url, method=method)[0] in (403, 405), method
    assert "Traceback" not in served.log.read_text()


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{}", "0.0.0.0:{}", "127.0.0.1", "127.0.0.1:1",
             "127.0.0.2:{}", "localhost.evil.example:{}", "[::1]:{}", "2130706433:{}", "", "a b"]
)  # fmt: skip
def test_other_hosts_are_refused_everywhere(served, wire, host):
    named = host.format(_port(served))
    for path in PLACES:
        status, headers, body = wire.ask(served.url, path, {"Host": named})
        assert status in (400, 403), path
        assert b"token" not in body
        assert "access-control-allow-origin" not in headers


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://127.0.0.1:{}", "http://127.0.0.1:1",
     "http://localhost:{}", "http://127.0.0.1:{}.evil.example", ""],
)  # fmt: skip
def test_other_origins_are_refused_everywhere(served, wire, origin):
    named = {"Origin": origin.format(_port(served))}
    for path in PLACES:
        assert wire.ask(served.url, path, named)[0] == 403, path
    assert wire.is_forbidden(served.url, "token", named)


@pytest.mark.parametrize("site", ["cross-site", "same-site", "", "NONE", "other"])
def test_requests_that_other_pages_make_are_refused_everywhere(served, wire, site):
    for path in PLACES:
        assert wire.ask(served.url, path, {"Sec-Fetch-Site": site})[0] == 403, path


def test_a_user_and_the_page_itself_are_let_in(served, wire):
    own = served.url.rstrip("/")
    for headers in ({}, {"Sec-Fetch-Site": "none"}, {"Sec-Fetch-Site": "same-origin"},
                    {"Sec-Fetch-Site": "same-origin", "Origin": own},
                    {"Host": f"LOCALHOST:{_port(served)}"}):  # fmt: skip
        assert wire.ask(served.url, "/", headers)[0] == 200
        assert wire.ask(served.url, "/static/js/bokeh.min.js", headers)[0] == 200


@pytest.mark.parametrize("path", ["/", "/static/js/bokeh.min.js", "/favicon.ico", "/nothing"])
def test_every_answer_forbids_what_the_page_does_not_need(served, wire, path):
    _, headers, body = wire.ask(served.url, path)
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["x-frame-options"] == "DENY"
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert "server" not in headers
    assert "access-control-allow-origin" not in headers
    if path == "/":
        (script,) = [part for part in policy.split("; ") if part.startswith("script-src")]
        assert "unsafe-inline" not in script
        assert "http" not in script
        nonce = script.split("'nonce-")[1].split("'")[0]
        assert body.count(b"<script") == body.count(f'<script nonce="{nonce}"'.encode())
        assert nonce not in str(wire.ask(served.url, path)[1])


def test_a_session_is_opened_by_a_page_of_the_server_alone(served, wire):
    """A token that someone made up: today's expiry, a name of a session, no signature."""
    content = {"session_id": "mine", "session_expiry": int(time.time()) + 300}
    made_up = base64.urlsafe_b64encode(json.dumps(content).encode()).decode().rstrip("=")
    for token in (made_up, f"{made_up}.AAAA", "", "x"):
        connection, head = wire.upgrade(served.url, token, {})
        if " 101 " in head:
            connection.settimeout(20)
            assert connection.recv(1)[:1] in (b"", b"\x88")  # closed, no ACK
        connection.close()


def test_a_page_keeps_no_cookie_and_no_header_of_its_request(served, wire):
    _, _, page = wire.ask(served.url, "/", {"Cookie": "other=secret", "X-Secret": "hidden"})
    token = wire.token_of(page)
    body = token.split(".")[0]
    read = base64.urlsafe_b64decode(body + "=" * (-len(body) % 4))
    packed = json.loads(read)
    texts = str(packed)
    for value in packed.values():
        if isinstance(value, str):
            import zlib

            try:
                texts += str(zlib.decompress(base64.urlsafe_b64decode(value + "==")))
            except (ValueError, zlib.error):
                continue
    assert "other" not in texts
    assert "hidden" not in texts
