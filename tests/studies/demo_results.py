"""Everything that a user gets, as files to look at: `make demo-results`.

Runs the commands on bundled data and keeps their documents in `results/demo/`, with a page of the
commands.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

SYNTHETIC = Path("data") / "synthetic"
PROTOTYPES = SYNTHETIC / "prototypes"
HIDDEN = SYNTHETIC / "hidden_cause"
BENCH = PROTOTYPES / "Test_2024_03_05_001.csv.gz"
ROAD = PROTOTYPES / "Road_2024_03_05_001.csv.gz"

CALIBRATE = (
    "calibrate", SYNTHETIC / "motor.toml", SYNTHETIC / "duty_90min.csv.gz",
    "--holdout", SYNTHETIC / "step_90min.csv.gz", "--meta", SYNTHETIC / "certificate.toml",
    "--out", "OUT/run",
)  # fmt: skip

COMMANDS: tuple[tuple[tuple[object, ...], str, dict[str, str]], ...] = (
    (CALIBRATE, "the run: certificate, workbook, figures",
     {"run/sheet.pdf": "sheet.pdf", "run/sheet.xlsx": "sheet.xlsx", "run/sheet.json": "sheet.json",
      "run/figures": "figures"}),
    (("sheet", "OUT/run", "--dcc", "--out", "OUT/dcc"), "Digital Calibration Certificate",
     {"dcc/dcc.xml": "dcc.xml"}),
    (("export", "OUT/run", "--to", "mat", "--out", "OUT/mat"),
     "MATLAB, Simulink, Octave: prova.mat and the scripts of the package", {}),
    (("report", "--type", "general", PROTOTYPES / "motor.toml", BENCH, "--out", "OUT/general"),
     "General Test", {"general/*.pdf": "general.pdf"}),
    (("report", "--type", "thermal", SYNTHETIC / "motor.toml", SYNTHETIC / "step_90min.csv.gz",
      "--run", "OUT/run", "--out", "OUT/thermal"),
     "Thermal Behaviour Analysis", {"thermal/*.pdf": "thermal.pdf"}),
    (("report", "--type", "energy", PROTOTYPES / "motor.toml", BENCH, "--out", "OUT/energy"),
     "Energy Consumption", {"energy/*.pdf": "energy.pdf"}),
    (("report", "--type", "virtual", SYNTHETIC / "motor.toml", SYNTHETIC / "step_90min.csv.gz",
      "--run", "OUT/run", "--out", "OUT/virtual"),
     "Semi-real against virtual", {"virtual/*.pdf": "virtual.pdf"}),
    (("report", "--type", "real", PROTOTYPES / "motor.toml", BENCH, "--reference", ROAD,
      "--out", "OUT/real"),
     "Semi-real against real", {"real/*.pdf": "real.pdf"}),
    (("calibrate", PROTOTYPES / "motor.toml", BENCH, "--quick", "--out", "OUT/bench"),
     "the network of the bench's prototype, for the next report", {}),
    (("report", "--type", "prototypes", PROTOTYPES / "motor.toml", "virtual=OUT/bench",
      f"semi-real={BENCH}", f"real={ROAD}", "--run", "OUT/bench", "--out", "OUT/prototypes"),
     "virtual, semi-real and real beside each other", {"prototypes/*.pdf": "prototypes.pdf"}),
    (("discover", HIDDEN / "motor.toml", HIDDEN / "staircase.csv.gz", HIDDEN / "drive_cycle.csv.gz",
      "--holdout", HIDDEN / "other_staircase.csv.gz", "--quick", "--out", "OUT/discovery"),
     "a hidden cause, found", {"discovery/discovery.pdf": "discovery.pdf"}),
)  # fmt: skip
"""Words of each command, what it gives, and which of its files are kept under which name."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results") / "demo")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines = []
    with tempfile.TemporaryDirectory() as name:
        for words, title, kept in COMMANDS:
            spoken = [str(word) for word in words]
            print(title, flush=True)
            run([word.replace("OUT", name, 1) for word in spoken])
            for source, target in kept.items():
                keep(Path(name), source, options.out / target)
            files = ", ".join(f"[{target}]({target})" for target in kept.values()) or "nothing kept"
            lines += [f"- {title}: {files}", "", f"      heatrun {' '.join(spoken)}", ""]
    (options.out / "README.md").write_text(page(lines), encoding="utf-8")


def run(words: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "heatrun.cli", *words], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise SystemExit(
            f"heatrun {' '.join(words)}: exit {done.returncode}\n{done.stderr[-3000:]}"
        )


def keep(made: Path, pattern: str, target: Path) -> None:
    (source,) = made.glob(pattern)
    if source.is_dir():
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target)
    else:
        shutil.copyfile(source, target)


def page(lines: list[str]) -> str:
    return "\n".join([
        "# What a user gets",
        "",
        f"`make demo-results` (heatrun {version('heatrun')}, seed 0, bundled data, which are "
        "simulated; the laboratory and its instruments are invented). OUT is a folder.",
        "",
        *lines,
    ]) + "\n"  # fmt: skip


if __name__ == "__main__":
    main()
