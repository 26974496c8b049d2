"""How the live view does on long records: time from zoom to redraw, memory, screenshots.

Run by `make study-view`; writes results/view/. Needs Chromium.
"""

import argparse
import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[2]
CHANNELS = (
    "phase_current_A", "losses_W", "ambient_degC", "winding_degC", "speed_rpm", "torque_Nm",
    "stator_degC", "yoke_degC", "tooth_degC", "end_winding_degC", "housing_degC", "rotor_degC",
    "magnet_degC", "bearing_degC", "controller_degC", "coolant_degC", "coolant_out_degC",
    "coolant_flow_L_per_min", "dc_voltage_V", "dc_current_A",
)  # fmt: skip
NUM_ZOOMS = 20

WATCH = """
() => {
  const models = Object.values(Bokeh.index).flatMap((view) => [...view.model.references()]);
  const sources = models.filter((m) => m.type === "ColumnDataSource" && m.name === "signal");
  window.figure_x = models.find((m) => m.type === "Figure").x_range;
  window.first = window.drawn = null;
  document.addEventListener("wheel", () => {
    window.begun = performance.now(); window.first = null; window.drawn = null;
    requestAnimationFrame(() => requestAnimationFrame(() => { window.first = performance.now(); }));
  }, {capture: true, passive: true});
  for (const source of sources) {
    source.properties.data.change.connect(() => requestAnimationFrame(
      () => requestAnimationFrame(() => { window.drawn = performance.now(); })));
  }
  return sources.length;
}
"""
"""Notes when the wheel turned, when the next frame stood, and when the last new data were drawn."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "view")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    tour(options.out)
    rows = [measure(num, options.out) for num in options.samples]
    found = {
        "command": "make study-view",
        "channels": len(CHANNELS),
        "zooms": NUM_ZOOMS,
        "load_average": os.getloadavg()[0],
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "versions": {name: version(name) for name in ("panel", "bokeh", "tsdownsample", "numpy")},
        "rows": rows,
    }
    (options.out / "speed.json").write_text(json.dumps(found, indent=1) + "\n")
    (options.out / "speed.md").write_text(text(found))
    print(text(found))


@contextmanager
def viewed(folder: Path, log: Path | None = None) -> Iterator[tuple[str, Any, int]]:
    """Serve a folder; give the address, a page of a browser and the server's process id.

    What the server says goes into a log.
    """
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        sys.exit("No Chromium is found; install it and run this again.")
    with tempfile.TemporaryDirectory() as temporary:
        log = log or Path(temporary) / "log"
        with log.open("w") as file:
            server = subprocess.Popen(
                [sys.executable, "-m", "heatrun.cli", "view", str(folder), "--no-browser",
                 "--port", "0", "--out", str(Path(temporary) / "runs")], stderr=file,
            )  # fmt: skip
        try:
            url = wait_for_url(log, server)
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(
                    executable_path=chromium, args=["--no-sandbox"]
                )
                yield url, browser.new_page(viewport={"width": 1366, "height": 800}), server.pid
                browser.close()
        finally:
            server.terminate()
            server.wait(20)


def tour(out: Path) -> None:
    with viewed(ROOT / "data" / "synthetic") as (url, page, _):
        for theme in ("default", "dark"):
            page.goto(f"{url}?test=duty_90min.csv.gz&type=thermal&theme={theme}")
            figure = page.locator(".bk-Figure").first
            figure.wait_for(timeout=300_000)
            time.sleep(2.0)
            box = figure.bounding_box()
            page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
            time.sleep(1.0)
            page.screenshot(path=out / f"signals_{'dark' if theme == 'dark' else 'light'}.png")


def measure(num_samples: int, out: Path) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "long records"
        folder.mkdir()
        write_record(folder / "long.parquet", num_samples)
        (folder / "motor.toml").write_text('[motor]\nname = "long records"\n')
        with viewed(folder) as (url, page, process):
            empty = resident_MB(process)
            page.goto(url)
            begun = time.perf_counter()
            page.get_by_label("long.parquet").first.check()
            page.locator(".bk-Figure").first.wait_for(timeout=300_000)
            opened = time.perf_counter() - begun
            time.sleep(2.0)
            page.screenshot(path=out / f"view_{num_samples}.png")
            first, drawn = zooms(page)
            page.screenshot(path=out / f"view_{num_samples}_zoomed.png")
            memory = resident_MB(process)
    return {
        "samples": num_samples,
        "open_s": round(opened, 2),
        "frame_median_ms": round(statistics.median(first)),
        "redraw_median_ms": round(statistics.median(drawn)),
        "redraw_max_ms": round(max(drawn)),
        "server_empty_MB": round(empty),
        "server_MB": round(memory),
        "record_MB": round(8e-6 * num_samples * (len(CHANNELS) + 1)),
    }


def zooms(page) -> tuple[list[float], list[float]]:
    """Zoom in and out; return times to the next frame and to the full detail [ms]."""
    num_sources = page.evaluate(WATCH)
    assert num_sources == len(CHANNELS), num_sources
    box = page.locator(".bk-Figure").first.bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    first, drawn = [], []
    for number in range(NUM_ZOOMS):
        page.mouse.wheel(0, -400 if number < 0.7 * NUM_ZOOMS else 400)
        page.wait_for_function("() => window.first !== null && window.drawn !== null")
        time.sleep(0.7)
        times = page.evaluate("() => [window.first - window.begun, window.drawn - window.begun]")
        first.append(times[0])
        drawn.append(times[1])
    return first, drawn


def write_record(path: Path, num_samples: int) -> None:
    """Write a record at 10 Hz whose channels wander, with noise and steps."""
    rng = np.random.default_rng(7)
    columns = {"time_s": np.arange(num_samples) / 10.0}
    for name in CHANNELS:
        steps = np.repeat(rng.standard_normal(num_samples // 5000 + 1), 5000)[:num_samples]
        noise = 0.3 * rng.standard_normal(num_samples)
        columns[name] = 50.0 + 10.0 * steps + noise
    pd.DataFrame(columns).to_parquet(path)


def wait_for_url(log: Path, server: subprocess.Popen) -> str:
    for _ in range(1200):
        found = re.search(r"http://[\d.]+:\d+/", log.read_text())
        if found:
            return found.group()
        if server.poll() is not None:
            break
        time.sleep(0.1)
    sys.exit(f"The server did not start: {log.read_text()}")


def resident_MB(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", status).group(1)) / 1e3


def text(found: dict) -> str:
    lines = [
        "# The live view on long records",
        "",
        f"`{found['command']}`: {found['channels']} channels shown in linked plots, "
        f"{found['zooms']} turns of the wheel; {found['machine']}, load {found['load_average']:.1f}"
        " beside it; "
        + ", ".join(f"{name} {number}" for name, number in found["versions"].items())
        + ".",
        "",
        "| samples | open [s] | zoom to next frame [ms] | to full detail, median [ms] "
        "| largest [ms] | server [MB] | of it before [MB] | the record's numbers [MB] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['samples']:,} | {row['open_s']} | {row['frame_median_ms']} | "
        f"{row['redraw_median_ms']} | {row['redraw_max_ms']} | {row['server_MB']} | "
        f"{row['server_empty_MB']} | {row['record_MB']} |"
        for row in found["rows"]
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
