"""What the discovery's thresholds do at half and at twice: `make study-thresholds`.

Every case of hidden causes is searched with each threshold at half and at twice its value, all
others as they are: `heatrun.discovery.run.discover` on the records and the motor file that a user
would have, without the posterior, which no threshold touches. Writes rows and a table under
`results/discovery/thresholds/`. Nothing is tuned on its seeds (from 120000 on).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from discovery_gates import all_right, claims
from study_runs import rows_as_they_come, rows_done, write_rows

REPORTING_SEED = 120_000
ROOM = "heatrun.discovery"
GROUPS = ("clean", "unknown", "effect", "pair")
AS_IT_IS = "as it is"


@dataclass(frozen=True)
class Threshold:
    """A number of the code that decides.

    Attributes:
        name: What stands in the code.
        places: Modules that read it.
        meaning: What it is.
        values: Its half and its twice where these make no sense of it, as with a share near 1;
            empty for half and twice.
        keyword: Function and argument that have it as default, where it is read so.
    """

    name: str
    places: tuple[str, ...]
    meaning: str
    values: tuple[float, ...] = ()
    keyword: tuple[str, str] | None = None

    @property
    def value(self) -> float:
        """As it is."""
        return getattr(import_module(f"{ROOM}.{self.places[0]}"), self.name)

    @property
    def others(self) -> tuple[float, ...]:
        """At half, and at twice."""
        value = self.value
        kind = int if isinstance(value, int) else float
        return self.values or (kind(value / 2), kind(value * 2))

    @contextmanager
    def at(self, value: float) -> Iterator[None]:
        """Have another value as long as this lasts."""
        with ExitStack() as stack:
            for place in self.places:
                stack.enter_context(patch(f"{ROOM}.{place}.{self.name}", value))
            if self.keyword is not None:
                function, argument = self.keyword
                defaults = getattr(import_module(f"{ROOM}.{self.places[0]}"), function)
                stack.enter_context(patch.dict(defaults.__kwdefaults__, {argument: value}))
            yield


THRESHOLDS = (
    Threshold("FAMILYWISE", ("grow", "verdict"), "family-wise p of a name"),
    Threshold("WORTH_A_REFIT", ("grow", "judging.acceptance"), "log Bayes factor for a refit"),
    Threshold("BETTER_SHARE", ("judging.acceptance",), "share of the left-out error to close"),
    Threshold("BETTER_K", ("judging.acceptance",), "left-out error to close [K]"),
    Threshold("SEPARATED", ("judging.acceptance",), "amplitude from its null [sd]"),
    Threshold("SLACK", ("judging.acceptance",), "share of a range to lie outside"),
    Threshold("RELEVANT_K", ("judging.acceptance",), "misfit an effect explains [K]"),
    Threshold("RELEVANT_K", ("judging.final_check",), "slow misfit left [K]"),
    Threshold("RELEVANT_SHARE", ("judging.final_check",), "slow misfit left over the noise"),
    Threshold("LONGEST_S", ("judging.final_check",), "correlation time of what is left [s]"),
    Threshold("FORM_SHARE", ("judging.final_check",), "share left by a law of another form"),
    Threshold("TIE_NATS", ("rivals", "traces"), "log Bayes factor of a tie"),
    Threshold("TIE_SHARE", ("rivals", "traces"), "share of the gap of a tie", (0.9, 0.975)),
    Threshold("VISIBLE_K", ("screening.screen",), "misfit that can be seen [K]"),
    Threshold("ENOUGH_VISIBLE", ("verdict",), "share of effects to be seen", (0.275, 0.775)),
    Threshold("HALF", ("verdict",), "share of the misfit that a near miss closes", (0.35, 0.99)),
    Threshold("NUM_DIRECTIONS", ("screening.saturated",), "directions integrated out"),
    Threshold("ROOM", ("screening.saturated",), "prior along them [typical effects]"),
    Threshold("LONGEST_S", ("screening.saturated",), "longest noise while searching [s]",
              keyword=("saturated_noise", "longest_s")),
)  # fmt: skip


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--repeats", type=int, default=8, help="cases of each group")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no case is begun after this; the groups take turns")  # fmt: skip
    parser.add_argument("--resume", action="store_true", help="go on behind the rows in --out")
    parser.add_argument("--out", type=Path, default=Path("results") / "discovery" / "thresholds")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path, listed = options.out / "study.json", jobs(options.seed, options.repeats)
    rows = rows_done(path, options.seed) if options.resume else []
    done = {row["seed"] for row in rows}
    left = [job for job in listed if job["seed"] not in done]
    work = partial(rows_as_they_come, processes=options.processes, minutes=options.minutes)
    for finished in work(left, run):
        for row in finished:
            rows.append(row)
            words = f"{row['group']} {'+'.join(row['hidden'])}: {len(changed(row))} others"
            print(f"{len(rows)}/{len(listed)} {words}, {row['processor_s']:.0f} s", flush=True)
        rows = sorted(rows, key=lambda row: row["seed"])
        write_rows(path, rows, seed=options.seed, planned=len(listed))
        (options.out / "table.md").write_text(table(rows, options.seed, len(listed)), "utf-8")


def jobs(first_seed: int, repeats: int) -> list[dict[str, Any]]:
    """Return the cases; the groups take turns, each effect and each cause at random."""
    from bench_package import hidden_bench
    from discovery_cases import PAIRS, SHOWN

    kinds = {"clean": [()], "unknown": [(each,) for each in hidden_bench().UNKNOWN_IDS],
             "effect": [(each,) for each in SHOWN], "pair": list(PAIRS)}  # fmt: skip
    rng = np.random.default_rng(first_seed)
    rows = []
    for place in range(repeats * len(GROUPS)):
        group = GROUPS[place % len(GROUPS)]
        hidden = kinds[group][rng.integers(len(kinds[group]))]
        rows.append({"group": group, "hidden": hidden, "only_test": None,
                     "seed": first_seed + place})  # fmt: skip
    return rows


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Search one case with every threshold at each value."""
    from bench_package import hidden_bench
    from discovery_cases import write_bench

    from heatrun.calibration import load_tests
    from heatrun.motorfile import load_motor

    begin = time.process_time()
    case = hidden_bench().make_case(job["hidden"], job["seed"])
    with tempfile.TemporaryDirectory() as name:
        write_bench(case, Path(name), "second")
        motor = load_motor(Path(name) / "motor.toml")
        roles = {test.name: test.role for test in case.tests}
        tests = load_tests(
            motor,
            *([Path(name) / f"{each}.csv" for each, role in roles.items() if role == wanted]
              for wanted in ("calibration", "holdout")),
        )  # fmt: skip
    found = {AS_IT_IS: searched(motor, tests)}
    for place, threshold in enumerate(THRESHOLDS):
        for value in threshold.others:
            with threshold.at(value):
                found[f"{place} {value:g}"] = searched(motor, tests)
    return {
        **job,
        "misfit_K": case.visible_misfit_K,
        "is_visible": case.is_visible,
        "found": found,
        "processor_s": time.process_time() - begin,
    }


def searched(motor: Any, tests: Any) -> dict[str, Any]:
    """Return the verdict and what is named."""
    from heatrun.discovery.run import discover

    fitted = [test.blocks for test in tests if test.role == "calibration"]
    held_out = [test.blocks for test in tests if test.role == "holdout"]
    found = discover(motor, fitted, held_out=held_out)
    return {
        "verdict": found.verdict.word,
        "named": [
            {
                "id": each.rival.candidate.id,
                "test": each.rival.candidate.test_name(found.engine.tests),
                "equivalents": [other.id for other in each.equivalents],
            }
            for each in found.named
        ],
    }


def changed(row: dict[str, Any]) -> list[str]:
    """Return the settings under which a case came out otherwise."""
    return [name for name, found in row["found"].items() if found != row["found"][AS_IT_IS]]


def table(rows: list[dict[str, Any]], seed: int, planned: int) -> str:
    """Return the table in Markdown."""
    of = {group: [row for row in rows if row["group"] == group] for group in GROUPS}
    of["unknown"] = [row for row in of["unknown"] if row["is_visible"]]
    counts = ", ".join(f"{len(each)} {group}" for group, each in of.items())
    lines = [
        "# The discovery's thresholds at half and at twice",
        "",
        f"`make study-thresholds`, seeds from {seed} on, {len(rows)} of {planned} cases "
        f"({counts}). Each entry is the count with the threshold at half, as it is, and at twice "
        "(or at the values given), all others as they are. `heatrun.discovery.run.discover` on "
        "two tests of 2 h with a third held out, without the posterior, which no threshold "
        "touches. Another result: the verdict, a name or a set differs from that as it is.",
        "",
        "| threshold | what | values | clean machines claimed | unknown causes flagged "
        "| effects right | pairs right | another result |",
        "|" + "---|" * 8,
    ]
    for place, threshold in enumerate(THRESHOLDS):
        low, high = threshold.others
        names = [f"{place} {low:g}", AS_IT_IS, f"{place} {high:g}"]

        def count(group: str, holds, names=names) -> str:
            here = [[holds({**row, **row["found"][name]}) for row in of[group]] for name in names]
            return ", ".join(str(sum(each)) for each in here) + f" of {len(of[group])}"

        others = ", ".join(
            str(sum(n in changed(row) for row in rows)) for n in (names[0], names[2])
        )
        cells = (
            f"`{threshold.places[0]}.{threshold.name}`", threshold.meaning,
            f"{low:g}, {threshold.value:g}, {high:g}",
            count("clean", claims), count("unknown", lambda r: r["verdict"] == "unexplained"),
            count("effect", all_right), count("pair", all_right), f"{others} of {len(rows)}",
        )  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
