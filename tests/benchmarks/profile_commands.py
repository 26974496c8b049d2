"""What a command costs: wall and processor time by phase, compiled programs and cache hits.

`python tests/benchmarks/profile_commands.py [COMMAND WORDS …]` runs the command twice, each time in
a process of its own: with an empty cache of compilations, then with what the first left. Without
words these are `calibrate`, the same with `--quick`, `discover --quick`, `check` and `sheet` of
bundled tests.

Networks, which a command calibrates beside each other, and the predictions of tests are done in
turn here, so that each second belongs to one phase. A phase counts without the phases inside it.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command sets it

DATA = Path(__file__).parents[2] / "data" / "synthetic"
DUTY = ("motor.toml", "duty_90min.csv.gz")
HIDDEN = ("motor.toml", "staircase.csv.gz", "drive_cycle.csv.gz")

REST = "everything else"
IMPORTS = "imports"

OF_SHEET = {
    "figures": "heatrun.reports.figures.drawn",
    "figure of page 1": "heatrun.reports.of_run.drawn",
    "typesetting": "heatrun.reports.of_run.write_pdf",
    "workbook": "heatrun.reports.of_run.write_xlsx",
}

OF_CALIBRATION = {
    "reading and checks": "heatrun.commands.calibrate.load",
    "fit": "heatrun.calibration.fit",
    "unmodelled heat": "heatrun.calibration.holding_heat",
    "search for effects": "heatrun.calibration.find",
    "missing effects": "heatrun.calibration.small_effects",
    "comparison of the tests": "heatrun.calibration.fit_with_changes",
    "sampling": "heatrun.calibration.sample",
    "average over effects": "heatrun.calibration.averaged",
    "prediction": "heatrun.calibration.predict",
    "ratings": "heatrun.runs.result.derive",
    "description": "heatrun.calibration.describe_model",
    "checks of the fit": "heatrun.calibration.fit_findings",
    "reduction": "heatrun.calibration.check_reduction",
    "comparison of the networks": "heatrun.calibration.assemble",
    "writing the run": "heatrun.jobs.write_run",
}

PHASES = {
    "calibrate": OF_CALIBRATION | OF_SHEET,
    "discover": {
        **OF_CALIBRATION,
        **OF_SHEET,
        "what is told of the search": "heatrun.jobs.tell",
        "the network alone": "heatrun.jobs.holding_heat",
        "prediction before": "heatrun.jobs.predict",
        "result of the discovery": "heatrun.jobs.assemble",
        "figures of the discovery": "heatrun.reports.discovery.draw_all",
        "report of the discovery": "heatrun.reports.discovery.write_report",
    },
    "check": {
        "reading": "heatrun.readers.joined.read_tests",
        "checks": "heatrun.checks.check_record",
        "what the tests suffice for": "heatrun.checks.suitability.suitability",
    },
    "sheet": {"reading the run": "heatrun.reports.of_run.open_run", **OF_SHEET},
}
"""Functions of each command by what they do, at the place that they are called from."""

MODULES = ("heatrun.jobs", "heatrun.api")
"""What a command that computes loads sooner or later."""


@dataclass
class Cost:
    """What a phase costs."""

    wall_s: float = 0.0  # Wall time without the phases inside it [s].
    cpu_s: float = 0.0  # Processor time of all threads, likewise [s].
    trace_s: float = 0.0  # Of it, tracing and lowering [s].
    compile_s: float = 0.0  # Compiling [s of wall time].
    programs: int = 0  # Programs that were compiled [1].
    hits: int = 0  # Programs that were kept and came from the cache [1].
    calls: int = 0  # Calls [1].


@dataclass
class Profile:
    """Costs by phase, and the compilations by name of their program."""

    phases: dict[str, Cost] = field(default_factory=dict)
    compiled: Counter[str] = field(default_factory=Counter)
    _inside: list[str] = field(default_factory=list)
    _since: tuple[float, float] = (0.0, 0.0)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Book what passes to a phase."""
        self._book()
        self._inside.append(name)
        self.phases.setdefault(name, Cost()).calls += 1
        try:
            yield
        finally:
            self._book()
            self._inside.pop()

    @property
    def present(self) -> Cost:
        """The phase that runs now."""
        return self.phases.setdefault(self._inside[-1] if self._inside else REST, Cost())

    def _book(self) -> None:
        if "heatrun.io.programs" in sys.modules:
            counts = sys.modules["heatrun.io.programs"].COUNTS
            self.present.hits += counts["loaded"]
            counts["loaded"] = 0
        now = time.perf_counter(), time.process_time()
        if self._since != (0.0, 0.0):
            self.present.wall_s += now[0] - self._since[0]
            self.present.cpu_s += now[1] - self._since[1]
        self._since = now

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose calls are booked to a phase."""

        @wraps(function)
        def booked(*given: Any, **named: Any) -> Any:
            with self.phase(name):
                return function(*given, **named)

        return booked

    def took(self, event: str, seconds: float, **told: Any) -> None:
        """Book a duration that JAX tells."""
        if event.endswith("backend_compile_duration"):
            self.present.programs += 1
            self.present.compile_s += seconds
            phase = self._inside[-1] if self._inside else REST
            self.compiled[f"{phase}: {told.get('fun_name', 'unnamed')}"] += 1
        elif "jaxpr" in event:
            self.present.trace_s += seconds


def in_turn(function: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Return what a function gives for each item, one after the other."""
    return [function(each) for each in items]


def run(words: Sequence[str], told: Path) -> int:
    """Run the command in this process and write its profile."""
    profile, command = Profile(), words[0]
    with profile.phase(IMPORTS):
        from heatrun.io.caches import use_caches

        use_caches(lambda sentence: None)
        import_module(f"heatrun.commands.{command}")
        if command in ("calibrate", "discover"):
            for name in MODULES:
                import_module(name)
            from jax import monitoring

            import heatrun.calibration

            monitoring.register_event_duration_secs_listener(profile.took)
            for name in ("beside", "at_once"):
                setattr(heatrun.calibration, name, in_turn)
        for phase, place in PHASES[command].items():
            module, name = place.rsplit(".", 1)
            holder = import_module(module)
            setattr(holder, name, profile.timed(phase, getattr(holder, name)))
        from heatrun.cli import main
    with profile.phase(REST):
        code = main(words)
    costs = {name: asdict(cost) for name, cost in profile.phases.items()}
    told.write_text(json.dumps({"phases": costs, "compiled": profile.compiled}), encoding="utf-8")
    return code


def table(told: dict[str, Any]) -> str:
    rows = sorted(told["phases"].items(), key=lambda row: -row[1]["cpu_s"])
    total = {key: sum(cost[key] for _, cost in rows) for key in asdict(Cost())}
    head = ("phase", "wall s", "processor s", "tracing s", "compiling s", "compiled", "from cache",
            "calls")  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for name, cost in [*rows, ("**all**", total)]:
        lines.append(
            f"| {name} | {cost['wall_s']:.1f} | {cost['cpu_s']:.1f} | {cost['trace_s']:.1f} | "
            f"{cost['compile_s']:.1f} | {cost['programs']} | {cost['hits']} | {cost['calls']} |"
        )
    most = Counter(told["compiled"]).most_common(12)
    if most:
        lines += ["", "Compiled most often: " + ", ".join(f"{name} ({num})" for name, num in most)]
    return "\n".join(lines)


def main(words: Sequence[str]) -> int:
    """Run commands cold and warm and print their profiles."""
    print(f"load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        duty = [str(DATA / each) for each in DUTY]
        tests = [*duty, "--holdout", str(DATA / "step_90min.csv.gz")]
        hidden = [str(DATA / "hidden_cause" / each) for each in HIDDEN]
        hidden += ["--holdout", str(DATA / "hidden_cause" / "other_staircase.csv.gz")]
        new = ["--out", str(folder / "run"), "--force"]
        if words:
            commands = [[*words, *(new if words[0] in ("calibrate", "discover") else [])]]
        else:
            commands = [
                ["discover", *hidden, "--quick", *new],
                ["calibrate", *tests, *new],
                ["calibrate", *tests, "--quick", *new],
                ["check", *duty],
                ["sheet", str(folder / "run")],
            ]
        for number, command in enumerate(commands):
            environment = {**os.environ, "XDG_CACHE_HOME": str(folder / f"cache_{number}")}
            environment.pop("JAX_COMPILATION_CACHE_DIR", None)
            shown = " ".join(command).replace(f"{folder}/", "").replace(f"{DATA}/", "")
            print(f"\n## heatrun {shown}")
            for what in ("empty cache", "cache kept"):
                told = folder / "profile.json"
                begun = time.perf_counter()
                done = subprocess.run(
                    [sys.executable, __file__, "--told", str(told), *command],
                    env=environment, stdout=subprocess.DEVNULL, check=False,
                )  # fmt: skip
                taken = time.perf_counter() - begun
                if done.returncode > 1:  # findings alone end with 1
                    return done.returncode
                print(f"\n### {what}: {taken:.1f} s\n\n{table(json.loads(told.read_text()))}")
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--told"]:
        sys.exit(run(sys.argv[3:], Path(sys.argv[2])))
    sys.exit(main(sys.argv[1:]))
