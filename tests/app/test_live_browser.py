"""The live view beside a running bench: followed tests, two cursors, cuts, colours, room."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

playwright = pytest.importorskip("playwright.sync_api")
sees = playwright.expect

WRITER = Path(__file__).with_name("bench_writer.py")

LAST_TIMES = """
() => {
  const plots = Object.values(Bokeh.index).flatMap((view) => [...view.model.references()])
    .filter((m) => m.type === "Figure");
  const lines = plots.flatMap((plot) => plot.renderers.filter(
    (r) => r.type === "GlyphRenderer" && r.data_source.name === "signal"));
  return lines.map((line) => { const t = line.data_source.data.t; return t[t.length - 1]; });
}
"""
PAPER = """() => Object.values(Bokeh.index).flatMap((view) => [...view.model.references()])
  .filter((m) => m.type === "Figure").map((m) => m.background_fill_color)"""
ROOM = """
([width, beside]) => {
  const found = [];
  let aside = null;
  const walk = (node) => {
    for (const each of node.children || []) {
      if (each.classList.contains("bk-Figure")) found.push(each.getBoundingClientRect());
      if (each.textContent === "CSV of this window") aside = each.getBoundingClientRect();
      walk(each);
      if (each.shadowRoot) walk(each.shadowRoot);
    }
  };
  walk(document.body);
  const right = Math.max(...found.map((r) => r.right));
  const bottom = Math.max(...found.map((r) => r.bottom));
  return found.length > 3 && found.every((r) => r.width > 0.48 * width) && right <= width
    && bottom <= 900 && aside && (beside ? aside.left >= right : aside.top >= bottom);
}
"""
"""Whether the plots have their room, and the readings stand beside or below them. The latter is
arranged a moment after the browser's window has changed, and moves the plots once more."""


def _open(tab, served, query: str) -> None:
    tab.goto(f"{served.url}?{query}")
    try:
        tab.locator(".bk-Figure").first.wait_for()
    except playwright.TimeoutError as error:
        plots = tab.locator(".bk-Figure").count()
        alerts = tab.locator(".alert").all_inner_texts()
        told = f"{plots} plots, none in sight; problems {tab.problems}; alerts {alerts}"
        raise AssertionError(told) from error


def _drag(tab, first: float, last: float) -> None:
    """Select a window with the mouse, over shares of the first plot's width."""
    tab.locator(".bk-tool-icon-x-box-select").first.click()
    box = tab.locator(".bk-Figure").first.bounding_box()
    y = box["y"] + box["height"] / 2
    tab.mouse.move(box["x"] + first * box["width"], y)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.5 * (first + last) * box["width"], y, steps=4)
    tab.mouse.move(box["x"] + last * box["width"], y, steps=4)
    tab.mouse.up()


def _click_with_shift(tab, share: float) -> None:
    """Click into the first plot, at a share of its width and where it stands by now."""
    box = tab.locator(".bk-Figure").first.bounding_box()
    tab.mouse.move(0, 0)
    tab.keyboard.down("Shift")
    tab.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
    tab.keyboard.up("Shift")


def _until(tab, act, text: str, most: int = 10) -> None:
    """Do something until a text shows: plots that are just being arranged may miss a click."""
    for _ in range(most):
        act()
        try:
            tab.get_by_text(text).first.wait_for(timeout=6_000)
            return
        except playwright.TimeoutError:
            continue
    raise AssertionError(f"{text} does not show after {most} clicks; problems {tab.problems}")


def test_two_running_tests_are_followed_until_the_button_is_pressed(served, tab):
    files = [served.folder / "fast.csv", served.folder / "slow.csv"]
    writers = [
        subprocess.Popen([sys.executable, str(WRITER), str(path), rate, "7"])
        for path, rate in zip(files, ("20", "0.4"), strict=True)
    ]
    try:
        while not all(path.exists() and path.read_bytes().count(b"\n") > 1 for path in files):
            tab.wait_for_timeout(100)
        _open(tab, served, "test=fast.csv&test=slow.csv&follow=1")
        tab.get_by_label("oil_pressure [bar]").first.check()
        # five channels of two tests: the newest sample of each is drawn
        tab.wait_for_function(
            f"() => {{ const t = ({LAST_TIMES})(); return t.length === 10 && "
            "t.filter((x) => x > 2).length === 10; }"
        )
        writers[0].kill()
        writers[0].wait()
        written = files[0].read_text().splitlines(keepends=True)
        last_s = float(written[-2].split(",")[0])
        tab.wait_for_function(f"() => ({LAST_TIMES})().some((x) => Math.abs(x - {last_s}) < 0.051)")
        files[0].write_text("".join(written[:1] + written[5:9]))
        tab.get_by_text("replaced or cut").first.wait_for()
        tab.wait_for_function(f"() => ({LAST_TIMES})().some((x) => Math.abs(x - 0.15) < 1e-6)")
        follows = tab.get_by_role("button", name="Follow changes")
        sees(follows).to_have_class(re.compile("bk-active"))
        follows.click()
        gone = tab.get_by_text("the file has changed or is gone").first
        gone.wait_for()
        follows.click()
        gone.wait_for(state="hidden")
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
    assert tab.problems == []


def test_room_cursors_a_cut_for_the_motor_file_and_colours_without_a_reload(served, tab):
    motor = served.folder / "motor.toml"
    shutil.copy(motor, served.folder / "mine.toml")
    before = (served.folder / "mine.toml").read_bytes()
    rows = "".join(f"{t},1,2,20,{20 + t / 60}\n" for t in range(0, 600, 10))
    head = "time_s,phase_current_A,losses_W,ambient_degC,winding_degC\n"
    (served.folder / "short.csv").write_text(head + rows)
    _open(tab, served, "test=duty_30min.csv.gz&test=short.csv&motor=mine.toml&type=general")
    for width, beside in ((800, False), (1400, True)):
        tab.set_viewport_size({"width": width, "height": 900})
        tab.wait_for_function(ROOM, arg=[width, beside])
    box = tab.locator(".bk-Figure").first.bounding_box()
    y = box["y"] + box["height"] / 2
    tab.mouse.move(box["x"] + 0.2 * box["width"], y)
    sees(tab.locator("td b")).to_have_count(9)  # five signals of one test and four of the other
    sees(tab.locator("td b", has_text="–")).to_have_count(0)
    tab.mouse.move(box["x"] + 0.8 * box["width"], y)  # behind the end of the shorter test
    sees(tab.locator("td b", has_text="–")).to_have_count(4)
    tab.mouse.click(box["x"] + 0.4 * box["width"], y)
    tab.get_by_text("Shift and click sets cursor B").first.wait_for()
    _until(tab, lambda: _click_with_shift(tab, 0.7), "Δt")

    _drag(tab, 0.3, 0.8)
    tab.get_by_text("Part of the test that counts").wait_for()
    tab.get_by_role("button", name="Use it").click()
    tab.get_by_text("[tests.duty_30min]").wait_for()
    assert (served.folder / "mine.toml").read_bytes() == before
    tab.get_by_role("button", name="Write into the motor file").click()
    tab.get_by_text("Written into mine.toml").wait_for()
    after = (served.folder / "mine.toml").read_bytes()
    assert after.startswith(before)
    ((start, end),) = tomllib.loads(after.decode())["tests"]["duty_30min"]["use"]
    assert 300.0 < start < 700.0 < 1200.0 < end < 1700.0

    assert set(tab.evaluate(PAPER)) == {"#ffffff"}
    tab.evaluate("window.same_page = true")
    tab.emulate_media(color_scheme="dark")
    tab.wait_for_function(f"() => ({PAPER})().every((colour) => colour === '#14181d')")
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    assert tab.evaluate("window.same_page") is True
    assert tab.problems == []
