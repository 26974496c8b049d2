"""How the live view follows two running tests, of 20 and 0.4 rows/s: lag, memory, errors.

    python tests/studies/live_view.py [--minutes 10] [--out FOLDER]

Needs Chromium. Prints a line a minute and writes `follow.json` and a screenshot into the folder.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from view_speed import ROOT, resident_MB, viewed

WRITER = ROOT / "tests" / "app" / "bench_writer.py"
RATES = {"fast.csv": "20", "slow.csv": "0.4"}
LOOK_S = 5.0

SHOWN = """
() => {
  const plots = Object.values(Bokeh.index).flatMap((view) => [...view.model.references()])
    .filter((m) => m.type === "Figure");
  return plots.flatMap((plot) => plot.renderers)
    .filter((r) => r.type === "GlyphRenderer" && r.data_source.name === "signal")
    .map((r) => { const t = Array.from(r.data_source.data.t).filter(Number.isFinite);
                  const dash = r.glyph.line_dash?.value ?? r.glyph.line_dash;
                  const solid = dash === "solid" || dash.length === 0;
                  return [t.length, t[t.length - 1], solid]; });
}
"""
"""Points, time of the newest, and if it is solid, of each line; the second test's are not."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, default=Path("live-view"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder, log = Path(temporary) / "bench", Path(temporary) / "log"
        folder.mkdir()
        writers = [subprocess.Popen([sys.executable, str(WRITER), str(folder / name), rate, "1"])
                   for name, rate in RATES.items()]  # fmt: skip
        try:
            with viewed(folder, log) as (url, page, pid):
                found = follow(folder, url, page, pid, options.minutes * 60.0, options.out)
        finally:
            for writer in writers:
                writer.terminate()
                writer.wait(20)
        found["log"] = log.read_text().splitlines()[1:]
    (options.out / "follow.json").write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps({name: value for name, value in found.items() if name != "rows"}))


def follow(
    folder: Path, url: str, page: Any, pid: int, duration_s: float, out: Path
) -> dict[str, Any]:
    problems: list[str] = []
    rows: list[dict[str, float]] = []
    while not all((folder / name).exists() and written(folder / name)[0] > 1 for name in RATES):
        time.sleep(0.2)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    page.goto(f"{url}?test=fast.csv&test=slow.csv&follow=1")
    page.locator(".bk-Figure").first.wait_for(timeout=60_000)
    page.get_by_label("oil_pressure [bar]").first.check()
    gauge = page.context.new_cdp_session(page)
    gauge.send("Performance.enable")
    begin, used_s = time.monotonic(), processor_s(pid)
    while time.monotonic() < begin + duration_s:
        time.sleep(LOOK_S)
        row: dict[str, float] = {"at_s": round(time.monotonic() - begin, 1)}
        files = {name: written(folder / name) for name in RATES}
        lines = page.evaluate(SHOWN)
        for name, is_solid in (("fast.csv", True), ("slow.csv", False)):
            own = [line for line in lines if line[2] == is_solid]
            row |= {
                f"{name} rows": files[name][0],
                f"{name} points": own[0][0],
                f"{name} lag_s": round(files[name][1] - min(line[1] for line in own), 2),
            }
        metrics = gauge.send("Performance.getMetrics")["metrics"]
        heap = next(each["value"] for each in metrics if each["name"] == "JSHeapUsedSize")
        row |= {"server_MB": round(resident_MB(pid)), "page_MB": round(heap / 1e6)}
        rows.append(row)
        if len(rows) % round(60 / LOOK_S) == 0:
            print(json.dumps(row), flush=True)
    page.screenshot(path=out / "follow.png")
    lags = {name: [row[f"{name} lag_s"] for row in rows] for name in RATES}
    return {
        "problems": problems,
        "lag_median_s": {name: statistics.median(each) for name, each in lags.items()},
        "lag_largest_s": {name: max(each) for name, each in lags.items()},
        "server_processor_share": round((processor_s(pid) - used_s) / duration_s, 4),
        "rows": rows,
    }


def written(path: Path) -> tuple[int, float]:
    """Return how many rows of a file are whole, and the time of the last [s]."""
    lines = path.read_bytes().rpartition(b"\n")[0].split(b"\n")
    return len(lines) - 1, float(lines[-1].split(b",")[0]) if len(lines) > 1 else 0.0


def processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
