"""Time of `heatrun discover` on two 2-hour tests at 2 Hz from a cold process, by stage.

Part of `make study-discovery`. Nothing compiled is kept between the runs: the cache folder of the
user is another, empty one.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd
from bench_package import hidden_bench

SEED = 77
OUT = Path("results") / "discovery" / "time.json"


def main() -> None:
    """Measure and write."""
    case = hidden_bench().make_case(("speed_cooling",), SEED, target_K=0.8, resolution_K=0.1)
    rows = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for test in case.tests:
            pd.DataFrame(test.columns).to_csv(folder / f"{test.name}.csv", index=False)
        (folder / "motor.toml").write_text(
            '[motor]\nname = "time"\nlosses = "balance"\n'
            f"rated_speed_rpm = {case.machine.rated_speed_rpm:.3f}\n[winding]\n"
            f"phase_resistance_ohm = {case.machine.phase_resistance_ohm:.6g}\n"
        )
        for label, more in (("--quick", ["--quick"]), ("emcee", [])):
            command = [
                str(Path(sys.executable).with_name("heatrun")), "discover", "motor.toml",
                "test_1.csv", "test_2.csv", "--holdout", "test_3.csv", "--json",
                "--out", f"run{label}", *more,
            ]  # fmt: skip
            environment = {**os.environ, "XDG_CACHE_HOME": str(folder / f"cache{label}")}
            begin = time.perf_counter()
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, check=True, text=True
            )
            wall = time.perf_counter() - begin
            said = json.loads(done.stdout)
            rows[label] = {"wall_s": wall, "stages_s": said["seconds"], "verdict": said["verdict"]}
            print(label, f"{wall:.1f} s", said["seconds"], flush=True)
    content = {
        "command": "python tests/studies/discovery_time.py",
        "seed": SEED,
        "target_s": 60.0,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "runs": rows,
    }
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
