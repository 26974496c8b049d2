"""Whole processes: cold start and peak memory of each command, and of a record of 28 hours."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "studies"))

import bodies_cases
import ordinary_machines
from duty_record import SEED, record
from measured import environment, heatrun
from rows import Row

from heatrun.commands import all_commands

SECTION = "Processes"
DATA = Path(__file__).parents[2] / "data" / "synthetic"
ORDINARY = "enclosed induction motor"
LONG, LARGE = "A million samples", 1_000_000


def help_of_each() -> list[Row]:
    """Time the help of every command: what a slow import at the top of a file would cost."""
    with tempfile.TemporaryDirectory() as folder:
        times = {name: heatrun([name, "--help"], Path(folder)).wall_s for name in all_commands()}
    slowest = max(times, key=lambda name: times[name])
    detail = ", ".join(f"{name} {1e3 * taken:.0f} ms" for name, taken in times.items())
    return [Row(SECTION, f"--help of the slowest command ({slowest})", times[slowest], "s", 0.1,
                detail)]  # fmt: skip


@dataclass(frozen=True)
class Wait:
    """A command that somebody waits for."""

    what: str  # What it is asked for.
    words: Sequence[str]  # After `heatrun`; in them `{out}` is a folder of its own.
    kept_s: float | None  # Wall time that it should not exceed with compiled programs kept [s].
    empty_s: float | None = None  # The same with an empty cache.
    before: str = ""  # What it took at first.


def waits(folder: Path) -> list[Wait]:
    """Return the commands, the files that they need written into a folder."""
    motor, duty, step, short = (
        str(DATA / f"{name}") for name in ("motor.toml", "duty_90min.csv.gz", "step_90min.csv.gz",
                                           "duty_30min.csv.gz")
    )  # fmt: skip
    hidden, named = DATA / "hidden_cause", ("motor.toml", "staircase.csv.gz", "drive_cycle.csv.gz")
    hidden_words = [*(str(hidden / name) for name in named),
                    "--holdout", str(hidden / "other_staircase.csv.gz")]  # fmt: skip
    ordinary, bodies = folder / "ordinary", folder / "bodies"
    for each in (ordinary, bodies):
        each.mkdir()
    *fitted, held_out = map(
        str, ordinary_machines.write_case(ordinary_machines.make(ORDINARY, SEED), ordinary)
    )
    ordinary_words = [str(ordinary / "motor.toml"), *fitted, "--holdout", held_out]
    four = bodies_cases.make("four nodes", "tooth and yoke", SEED)
    of_bodies = bodies_cases.write_case(four, bodies)
    of_bodies[-1] = "{out}"
    run = str(folder / "kept-0")  # of the first command
    return [
        Wait("calibrate, 90 min at 10 Hz, both orders, one held out",
             ["calibrate", motor, duty, "--holdout", step, "--out", "{out}"], 7.0, 20.0,
             "50 s kept"),
        Wait("the same, --quick",
             ["calibrate", motor, duty, "--holdout", step, "--quick", "--out", "{out}"], 4.0, None,
             "27 s kept"),
        Wait("calibrate --quick --model four, winding, tooth and yoke measured", of_bodies, 12.0,
             None, "33 to 160 processor s"),
        Wait("discover --quick, two tests of 2 h, one held out",
             ["discover", *hidden_words, "--quick", "--out", "{out}"], 25.0, 45.0,
             "68 to 127 s kept"),
        Wait(f"calibrate, {ORDINARY}, both orders, one held out",
             ["calibrate", *ordinary_words, "--out", "{out}"], 15.0, None, "179 s kept"),
        Wait("check, 90 min at 10 Hz", ["check", motor, duty], 1.0, None, "3.4 s"),
        Wait("sheet", ["sheet", run], 2.0, None, "5.7 s"),
        Wait("simulate", ["simulate", motor, run, short, "--out", "{out}"], 2.0, None, "7.1 s"),
        Wait("thermal report",
             ["report", "--type", "thermal", motor, duty, "--run", run, "--out", "{out}"], 2.0),
    ]  # fmt: skip


def commands() -> list[Row]:
    """Time each command in a process of its own, with an empty cache and then with what it left."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for place, wait in enumerate(waits(folder)):
            for state, target in (("empty", wait.empty_s), ("kept", wait.kept_s)):
                out = str(folder / f"{state}-{place}")
                words = [word.format(out=out) for word in wait.words]
                took = heatrun(words, folder / f"cache-{place}")
                note = f"{took.processor_s:.3g} processor s, peak {took.peak_MB:.0f} MB"
                note += f"; at first: {wait.before}" if wait.before and state == "kept" else ""
                rows.append(Row(SECTION, f"{wait.what}: {state}", took.wall_s, "s", target, note))
    return rows


def import_alone() -> list[Row]:
    """Time the import of the package, the fastest of five beside that of Python itself."""

    def taken(words: str) -> float:
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", words], check=True, env=environment(Path("unused")))
        return time.perf_counter() - begin

    bare, loaded = (min(taken(words) for _ in range(5)) for words in ("", "import heatrun"))
    return [Row(SECTION, "import heatrun", loaded - bare, "s", 0.1,
                f"beside {1e3 * bare:.0f} ms of Python itself")]  # fmt: skip


def large_record() -> list[Row]:
    """Calibrate a record of a million samples, both orders, to the sheet; time and peak memory."""
    made = record(LARGE)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pd.DataFrame(
            {
                "t": 0.1 * pd.RangeIndex(LARGE).to_numpy(),
                "Is": made["current_squared"] ** 0.5,
                "Pd": made["losses"],
                "Te": made["ambient"],
                "Tw_m": made["measured"].round(1),
            }
        ).to_csv(folder / "long.csv", index=False, float_format="%.6g")
        words = ["calibrate", str(DATA / "motor.toml"), str(folder / "long.csv"), "--quick"]
        took = heatrun([*words, "--out", str(folder / "run")], folder / "cache")
    return [
        Row(LONG, "calibrate --quick, peak memory", took.peak_MB, "MB", 700.0, "to the sheet"),
        Row(LONG, "calibrate --quick, empty", took.wall_s, "s", None,
            f"{took.processor_s:.3g} processor s"),
    ]  # fmt: skip
