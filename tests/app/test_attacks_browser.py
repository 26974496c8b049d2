"""Pages of strangers in the same browser reach nothing of a running server, and it lives on."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

TRIES = """
async (target) => {
  const load = (kind, address) => new Promise((tell) => {
    const each = document.createElement(kind);
    each.onload = () => tell("loaded"); each.onerror = () => tell("refused");
    each.src = target + address;
    document.body.append(each);
    setTimeout(() => tell("nothing came"), 8000);
  });
  const found = {};
  found.module = await load("img", "components/this/a/b/c");
  found.killer = await load("img", "components/unittest.__main__/a/b/c");
  found.icon = await load("img", "favicon.ico");
  found.script = await load("script", "static/js/bokeh.min.js");
  found.bokeh = typeof window.Bokeh;
  for (const mode of ["cors", "no-cors"]) {
    try { found["page " + mode] = (await (await fetch(target, {mode})).text()) || "empty"; }
    catch (error) { found["page " + mode] = "refused"; }
  }
  found.socket = await new Promise((tell) => {
    const socket = new WebSocket(target.replace("http", "ws") + "ws", ["bokeh", "x"]);
    socket.onopen = () => tell("open"); socket.onerror = () => tell("refused");
  });
  return found;
}
"""


class Stranger(BaseHTTPRequestHandler):
    """Serves an empty page, whatever is asked."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>stranger</title><body>")

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def stranger() -> Iterator[int]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Stranger)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server.server_port
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture(params=["127.0.0.1", "localhost"])
def foreign(request, stranger, tab):
    """A page of another port of this host, and one of another host."""
    tab.goto(f"http://{request.param}:{stranger}/")
    return tab


@pytest.fixture(autouse=True, scope="module")
def _lives(browser, served) -> Iterator[None]:
    """After all of them a user's page still opens."""
    yield
    page = browser.new_page()
    page.goto(served.url)
    page.get_by_label("step_30min.csv.gz").first.wait_for()
    page.close()


def test_nothing_is_loaded_into_a_page_of_a_stranger(foreign, served):
    found = foreign.evaluate(TRIES, served.url)
    assert found.pop("bokeh") == "undefined"
    assert found.pop("page no-cors") in ("empty", "refused")  # opaque: it cannot be read
    assert set(found.values()) == {"refused"}, found
    assert "Beautiful is better" not in served.log.read_text()


def test_the_page_stands_in_no_frame(foreign, served):
    foreign.evaluate(
        """(target) => new Promise((loaded) => { const frame = document.createElement("iframe");
           frame.onload = loaded; frame.src = target; document.body.append(frame); })""",
        served.url,
    )
    foreign.wait_for_timeout(300)
    texts = [frame.content() for frame in foreign.frames[1:]]
    assert texts
    assert not any("bokeh" in text for text in texts)


def test_a_link_of_a_stranger_opens_no_page(foreign, served):
    foreign.evaluate("(target) => { window.location = target + '?test=duty_30min.csv.gz'; }",
                     served.url)  # fmt: skip
    foreign.get_by_text("Another page has sent you here").wait_for()


def test_a_link_with_the_token_opens_the_page_and_the_token_leaves_the_address(
    serve, stranger, tab
):
    served = serve("--token")
    tab.goto(f"http://localhost:{stranger}/")
    tab.evaluate("(target) => { window.location = target; }", served.url)
    tab.get_by_label("duty_30min.csv.gz").first.check()
    tab.locator(".bk-Figure").first.wait_for()
    assert "token" not in tab.url
    assert tab.evaluate("document.cookie") == ""
    assert tab.problems == []
    other = tab.context.browser.new_page()
    other.goto(served.url.partition("?")[0])
    other.get_by_text("This address asks for its token").wait_for()
    other.close()


def test_a_script_that_got_into_the_page_does_not_run(tab, served):
    """The policy of the page, whatever may get past the escaping one day."""
    tab.goto(served.url)
    tab.get_by_label("duty_30min.csv.gz").first.wait_for()
    tab.evaluate(
        """() => { const place = document.createElement("div");
           place.innerHTML = "<img src=x onerror='window.hacked = 1'>";
           const script = document.createElement("script"); script.text = "window.hacked = 2";
           const far = document.createElement("script"); far.src = "http://127.0.0.1:9/x.js";
           document.body.append(place, script, far); }"""
    )
    tab.wait_for_timeout(1000)
    assert tab.evaluate("window.hacked") is None
    assert any("Content Security Policy" in each for each in tab.problems)
