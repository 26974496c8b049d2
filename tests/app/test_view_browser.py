"""The live view as its user sees it: open, choose, zoom, calibrate, download; and its refusals."""

import shutil
import socket
import time
from urllib.parse import urlsplit

from playwright.sync_api import expect

from heatrun.motor.file import load_motor

LONG_MS = 180_000


def _open(tab, served, *tests: str) -> None:
    tab.goto(served.url)
    tab.wait_for_function("() => window.Bokeh?.documents[0]?.is_idle")
    for test in tests:
        tab.get_by_label(test).first.check()
    if tests:
        tab.locator(".bk-Figure").first.wait_for()


def _window(tab) -> tuple[float, float]:
    return tuple(
        tab.evaluate(
            """() => { const found = Object.values(Bokeh.index).flatMap((view) =>
                 [...view.model.references()]).find((m) => m.type === "Figure");
               return [found.x_range.start, found.x_range.end]; }"""
        )
    )


def _window_at_rest(tab, narrower: float) -> tuple[float, float]:
    """Return the window once it is narrower than that and no longer moves [s]."""
    end = time.monotonic() + LONG_MS / 1e3
    before, now = None, _window(tab)
    while now != before or now[1] - now[0] >= narrower:
        assert time.monotonic() < end, now
        tab.wait_for_timeout(700)
        before, now = now, _window(tab)
    return now


def _text(tab, words: str) -> None:
    tab.get_by_text(words).first.wait_for(timeout=LONG_MS)


def _tab(tab, name: str) -> None:
    tab.locator(".bk-tab", has_text=name).click()


def test_open_choose_zoom_read_and_download(served, tab, bench_data):
    shutil.copy(bench_data / "duty_30min.csv.gz", served.folder / "fast.csv.gz")
    _open(tab, served, "fast.csv.gz", "step_30min.csv.gz")
    whole = _window(tab)
    plot = tab.locator(".bk-Figure").first
    box = plot.bounding_box()
    tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    _text(tab, "winding · step_30min")
    _text(tab, "t = ")
    for _ in range(8):
        tab.mouse.wheel(0, -300)
        tab.wait_for_timeout(50)
    start, end = _window_at_rest(tab, 0.7 * (whole[1] - whole[0]))

    with tab.expect_download() as download:
        tab.get_by_text("CSV of this window").click()
    table = download.value.path().read_text().splitlines()
    assert table[0].startswith("time_s,phase_current_A fast,phase_current_A step_30min")
    times = [float(line.split(",")[0]) for line in table[1:]]
    assert start <= times[0] < start + 0.2
    assert end - 0.2 < times[-1] <= end
    assert len(times) > 10 * (end - start) * 0.9  # the file's 10 Hz, not the screen's points

    tab.get_by_label("Test type").select_option(label="Thermal Behaviour Analysis")
    assert tab.problems == []
    assert tab.elsewhere == []
    tab.get_by_role("button", name="Dark").click()
    tab.wait_for_url("**theme=dark**")
    tab.locator(".bk-Figure").first.wait_for()
    expect(tab.get_by_label("fast.csv.gz").first).to_be_checked()


def test_calibrate_and_download_the_sheet_and_a_report(served, tab):
    _open(tab, served, "duty_30min.csv.gz")
    _tab(tab, "Calibration")
    tab.get_by_label("Network").first.select_option(label="first order")
    tab.get_by_role("button", name="Calibrate").click()
    tab.get_by_role("button", name="Cancel").first.wait_for()
    _text(tab, "sheet.pdf")
    _text(tab, "95 % interval")
    with tab.expect_download() as download:
        tab.get_by_text("sheet.pdf").first.click()
    assert download.value.path().read_bytes().startswith(b"%PDF")
    assert (served.out / "duty_30min_calibrate" / "manifest.json").is_file()
    _tab(tab, "Signals")
    _text(tab, "simulated, 95 % (first) · duty_30min")

    _tab(tab, "Report")
    tab.get_by_label("Test type").select_option(label="Energy Consumption")
    _text(tab, "holds no electrical power, which this test type needs")
    virtual = "Semi-real against Virtual Model"
    tab.get_by_label("Test type").select_option(label=virtual)
    _text(tab, "The bench beside a simulation")
    tab.get_by_role("button", name="Make report").click()  # the run of above is still selected
    _text(tab, "SemiRealVsVirtualModelValidation")
    with tab.expect_download() as download:
        tab.get_by_text("SemiRealVsVirtualModelValidation").first.click()
    assert download.value.path().read_bytes().startswith(b"%PDF")

    tab.get_by_label("duty_30min.csv.gz").first.uncheck()
    tab.get_by_label("step_30min.csv.gz").first.check()
    _tab(tab, "Simulate and export")
    tab.get_by_label("What is exported").select_option(label="the tests chosen in the side panel")
    tab.get_by_role("button", name="Export").click()
    _text(tab, "RMSE of the winding [K]")
    with tab.expect_download() as download:
        tab.get_by_text("prova.mat", exact=True).click(timeout=LONG_MS)
    assert download.value.path().read_bytes().startswith(b"MATLAB")
    assert (served.out.parent / "exported/duty_30min_calibrate_step_30min/prova.mat").is_file()
    assert tab.problems == []


def test_a_slider_moves_the_model_over_the_measured_curve(served, tab):
    _open(tab, served, "step_30min.csv.gz")
    _tab(tab, "By hand")
    _text(tab, "Starts from the priors of this machine, second order")
    error = tab.locator("h3", has_text="largest error")  # the verdict of a run names its RMSE too
    error.wait_for()
    before = error.inner_text()
    handles = tab.locator(".noUi-handle")
    expect(handles).to_have_count(4)
    handles.first.press("ArrowRight")
    error.filter(has_not_text=before).wait_for()
    tab.get_by_role("button", name="Back to the start").click()
    error.filter(has_text=before).wait_for()
    assert tab.problems == []


def test_the_start_page_leads_from_a_file_to_a_calibration(serve, tab):
    server = serve(fill=lambda folder: (folder / "motor.toml").unlink())
    _open(tab, server)
    tab.get_by_label("duty_30min.csv.gz").first.check()
    _text(tab, "2 Columns")
    tab.locator("#main").get_by_label("speed_rpm").uncheck()
    tab.get_by_placeholder("such as 0.0062").fill("0,0062")
    tab.get_by_label("File name").fill("../motor.toml")
    tab.get_by_role("button", name="Write motor file").click()
    tab.get_by_role("button", name="Calibrate these tests").click()
    tab.get_by_role("button", name="Cancel").first.click()
    _text(tab, "Cancelled.")
    (written,) = server.folder.glob("*.toml")
    motor = load_motor(written)
    assert motor.phase_resistance_ohm == 0.0062
    assert motor.columns == {"speed_rpm": "none"}
    assert tab.problems == []


CUT = """() => { const cut = [], wide = document.documentElement.clientWidth;
  const look = (root) => { for (const e of root.querySelectorAll("*")) {
    const box = e.getBoundingClientRect();
    if (!e.closest("table, .bk-GlyphRenderer") && box.width && e.checkVisibility()
        && box.right > wide + 1) cut.push(`${e.tagName} to ${box.right}`);
    if (e.shadowRoot) look(e.shadowRoot); } };
  look(document);
  return cut.concat(document.documentElement.scrollWidth > wide ? ["the page"] : []); }"""
"""What goes beyond the right edge; wide tables scroll, and a plot cuts its lines."""


LENGTH = "() => document.querySelector('#main').scrollHeight"


def test_nothing_is_cut_on_a_phone(served, phone):
    tab = phone
    _open(tab, served, "duty_30min.csv.gz")
    assert tab.evaluate("innerWidth") == 390
    long = tab.evaluate(LENGTH)
    for name in ("Start", "Signals", "Checks", "Motor file", "By hand", "Calibration", "Report",
                 "Simulate and export"):  # fmt: skip
        _tab(tab, name)
        if name == "Report":
            assert tab.evaluate(LENGTH) < 0.8 * long  # what other tabs hold takes no room
        if name == "By hand":
            _text(tab, "RMSE")
        tab.wait_for_timeout(250)  # for what is still to come
        for _ in range(100):  # and until what has come is arranged
            if not (cut := tab.evaluate(CUT)):
                break
            tab.wait_for_timeout(100)
        assert cut == [], name
    panel = tab.locator("#sidebar")
    assert panel.evaluate("(e) => e.scrollHeight - e.clientHeight") == 0  # the page scrolls as one
    tab.locator("#sidebar-button").click()
    panel.wait_for(state="hidden")
    tab.reload()
    tab.locator(".bk-Figure").first.wait_for()
    panel.wait_for(state="hidden")  # what is chosen is shown
    assert tab.problems == []


def test_two_tabs_calibrate_in_turn_and_one_is_cancelled(served, tab):
    other = tab.context.new_page()
    _open(tab, served, "duty_30min.csv.gz")
    _open(other, served, "step_30min.csv.gz")
    for page in (tab, other):
        _tab(page, "Calibration")
        page.get_by_role("button", name="Calibrate").click()
        page.get_by_role("button", name="Cancel").first.wait_for()
    _text(other, "Waiting for 1 other command to end")
    tab.get_by_role("button", name="Cancel").first.click()
    _text(tab, "Cancelled. Started again, it resumes")
    other.get_by_text("Waiting for 1 other").first.wait_for(state="hidden", timeout=LONG_MS)
    other.get_by_role("button", name="Cancel").first.click()
    _text(other, "Cancelled.")
    assert not (served.out / "step_30min_calibrate").exists()


def test_names_are_text_seen_to_their_end_and_of_no_file_outside(served, tab, bench_data):
    """Names of one day differ at their end; the column on the left is 300 px wide."""
    long = "Dauerlauf_Pruefstand_3_2024_03_05_with_hub_motor_001.csv.gz"
    name = "<img src=x onerror=window.hacked=1>"
    for each in (long, f"{name}.csv.gz"):
        shutil.copy(bench_data / "duty_30min.csv.gz", served.folder / each)
    motor = (served.folder / "motor.toml").read_text()
    (served.folder / "hostile.toml").write_text(motor.replace("IPM-SynRel 2022", name))
    (served.folder / "bad.csv").write_bytes(b"\x00\xff" * 100)
    (served.folder.parent / "secret.csv").write_text("t,Is\n0,1\n")
    tab.goto(served.url + "?test=../secret.csv&motor=../../etc/passwd&run=..")
    _text(tab, "Choose tests in the side panel")
    assert tab.problems == []
    label = tab.get_by_text(long).first
    label.wait_for()
    box = label.bounding_box()
    assert box["x"] + box["width"] <= 300.0

    tab.get_by_label("Motor file").select_option("hostile.toml")
    tab.get_by_label(name).first.check()
    tab.locator(".bk-Figure").first.wait_for()
    tab.get_by_label("bad.csv").first.check()
    tab.locator(".error").first.wait_for()
    for each in ("Checks", "Motor file", "Calibration", "Discovery", "Report", "Signals"):
        _tab(tab, each)
        tab.wait_for_timeout(300)
    assert tab.evaluate("window.hacked") is None


def test_the_motor_file_is_edited(served, tab):
    motor = served.folder / "edited.toml"
    shutil.copy(served.folder / "motor.toml", motor)
    before = motor.read_text()
    tab.goto(f"{served.url}?motor=edited.toml")
    _tab(tab, "Motor file")
    text = tab.get_by_label("Text")
    text.fill(before.replace("6000", '"<img src=x onerror=window.hacked=1>"'))
    tab.get_by_role("button", name="Save", exact=True).click()
    _text(tab, "Line 5")
    assert motor.read_text() == before
    text.fill(before.replace("6000", "5000"))
    text.press("End")  # typed, and the field not left yet
    text.press("Control+End")
    text.press_sequentially("# mine")
    motor.write_text(before + "# theirs\n")
    _text(tab, "has changed since it was read")
    tab.get_by_role("button", name="Read the file again").click()
    tab.wait_for_function("(area) => area.value.endsWith('# theirs\\n')", arg=text.element_handle())
    tab.get_by_role("button", name="Back to my text").click()
    tab.wait_for_function("(area) => area.value.endsWith('# mine')", arg=text.element_handle())
    tab.get_by_role("button", name="Save", exact=True).click()
    _text(tab, "Written into edited.toml")
    assert motor.read_text() == before.replace("6000", "5000") + "# mine"
    assert tab.evaluate("window.hacked") is None
    assert tab.problems == []


def test_an_empty_folder_takes_uploads_and_refuses_what_is_none(
    served_empty, tab, tmp_path, bench_data
):
    _open(tab, served_empty)
    _text(tab, "There are no bench files in")
    _text(tab, "Tick the tests of one motor")
    send = tab.locator("input[type=file]").first
    send.set_input_files(bench_data / "step_30min.csv.gz")
    tab.get_by_label("uploaded/step_30min.csv.gz").first.check()
    _text(tab, "2 Columns")
    _tab(tab, "Signals")
    tab.locator(".bk-Figure").first.wait_for()
    program = tmp_path / "run.exe"
    program.write_bytes(b"MZ")
    send.set_input_files(program)
    _text(tab, "Expected a bench file or a motor file")


def test_other_networks_are_refused(served):
    port = urlsplit(served.url).port
    bound = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), port)}
    for address in bound - {"127.0.0.1", "::1", "127.0.1.1"}:
        with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET) as probe:
            probe.settimeout(3)
            assert probe.connect_ex((address, port)) != 0
