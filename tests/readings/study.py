"""How bench files are read: every file of the corpus against its truth, in a table by cause.

python tests/readings/study.py [--results results/readings] [--table table.md] [--list]
"""

import argparse
import datetime
import platform
import sys
import tempfile
from collections import Counter
from importlib.metadata import version
from pathlib import Path

from reading_corpus.case import Truth
from reading_corpus.corpus import corpus
from reading_corpus.oracle import (
    ASKED,
    MISREAD,
    NEEDLESS,
    REFUSED,
    RIGHT,
    SHOWN,
    TRACEBACK,
    WARNED,
    Outcome,
    judge,
)
from scipy.stats import beta

COLUMNS = (RIGHT, REFUSED, ASKED, WARNED, SHOWN, NEEDLESS, MISREAD, TRACEBACK)
EXPLAINED = """
Every file is written by `tests/readings/reading_corpus` from a heat run of its own formulas, so
that its true values are known, and read as `heatrun check` does. The channels and the time, missing
samples included, are compared with the truth within the digits that the file holds.

- right: every value is the true one; refused: no record, and called so.
- asked: an error, or a finding that forbids a fit, where the file cannot settle the reading or
  contradicts itself.
- warned: read otherwise than the truth, and a warning names the unit or the cause; counted only
  where the file cannot settle it.
- shown: a good file of another machine would look the same; the unit is shown as assumed, nothing
  else is said.
- needless question: the file states it, or the ordinary reading is right, and still it is not let
  through.
- misread: a value differs from the truth, or one of two contradicting statements is taken, and
  nothing says so. A warning does not excuse the misreading of what the file states.
""".strip()


def upper_limit(num_hits: int, num_files: int) -> float:
    """Return the one-sided 95 % upper limit of a share (Clopper and Pearson)."""
    return (
        1.0 if num_hits == num_files else float(beta.ppf(0.95, num_hits + 1, num_files - num_hits))
    )


def run() -> list[Outcome]:
    """Read the whole corpus."""
    with tempfile.TemporaryDirectory() as folder:
        return [judge(case, Path(folder), number) for number, case in enumerate(corpus())]


def share(name: str, hits: int, total: int) -> str:
    """Return a sentence on a share and its limit."""
    return (
        f"- {hits} of {total} {name} ({hits / total:.1%}; 95 % upper limit "
        f"{upper_limit(hits, total):.1%})."
    )


def table(outcomes: list[Outcome], note: str = "") -> str:
    """Return the table by cause, with a sentence on what was read by what."""
    packages = ("heatrun", "numpy", "pandas", "h5py", "pyarrow", "asammdf", "nptdms")
    versions = ", ".join(f"{name} {version(name)}" for name in packages)
    by_cause: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        by_cause.setdefault(outcome.case.cause, Counter())[outcome.verdict] += 1
    total = sum(by_cause.values(), Counter())
    stated = [o for o in outcomes if o.case.truth is Truth.READ]
    plain = [o for o in outcomes if o.case.truth is Truth.PLAIN]
    unsettled = [o for o in outcomes if o.verdict in (ASKED, WARNED)]
    stating = "files that state everything"
    rates = (
        ("files are misread in silence", total[MISREAD], len(outcomes)),
        ("end in a traceback", total[TRACEBACK], len(outcomes)),
        (f"{stating} are misread", sum(o.verdict == MISREAD for o in stated), len(stated)),
        (f"{stating} get a needless question", sum(o.verdict == NEEDLESS for o in stated),
         len(stated)),
        (f"{stating} are read wrongly and stopped by a check of values alone",
         sum(o.beneath for o in stated), len(stated)),
        ("plain files whose ordinary reading is right get a needless question",
         sum(o.verdict == NEEDLESS for o in plain), len(plain)),
        ("questions and warnings on what the file cannot settle do not name the doubt",
         sum(not o.named for o in unsettled), len(unsettled)),
    )  # fmt: skip
    rows = [*by_cause.items(), ("all", total)]
    lines = [
        "# How bench files are read",
        "",
        "`make study-readings` (`python tests/readings/study.py`; the corpus is always the same: "
        "loads are seeded with 1000 + a number of the file, noise with 5, bytes with 1), "
        f"{datetime.date.today().isoformat()}, Python {platform.python_version()}, {versions}. "
        f"{note}",
        "",
        EXPLAINED,
        "",
        *(share(*rate) for rate in rates),
        "",
        "The limits hold for files like these, which are chosen to be hard: no rate of a bench.",
        "",
        f"| cause | files | {' | '.join(COLUMNS)} |",
        f"|---|---:|{'---:|' * len(COLUMNS)}",
        *(
            f"| {cause} | {sum(counts.values())} | "
            + " | ".join(str(counts[column]) for column in COLUMNS) + " |"
            for cause, counts in rows
        ),
        "",
    ]  # fmt: skip
    for verdict in (MISREAD, TRACEBACK, SHOWN):
        if found := [o for o in outcomes if o.verdict == verdict]:
            lines += [
                f"## {verdict.capitalize()}",
                "",
                "| cause | file | what came |",
                "|---|---|---|",
            ]
            lines += [f"| {cell(o.case.cause)} | {cell(o.case.name)} | {cell(o.said)} |"
                      for o in found] + [""]  # fmt: skip
    return "\n".join(lines)


def cell(text: str) -> str:
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return shown.replace("|", "\\|").replace("<", "&lt;").replace(tempfile.gettempdir(), "")[:160]


def main() -> int:
    """Read all files, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=Path("results") / "readings")
    parser.add_argument("--table", default="table.md")
    parser.add_argument("--note", default="", help="a sentence for the head of the table")
    parser.add_argument("--list", action="store_true", help="print what is not right, one by one")
    options = parser.parse_args()
    outcomes = run()
    if options.list:
        for o in outcomes:
            if o.verdict not in (RIGHT, REFUSED):
                unnamed = "" if o.named else " (doubt not named)"
                print(f"{o.verdict}{unnamed} | {o.case.truth.name} | {o.case.label} | {o.said}")
    text = table(outcomes, options.note)
    options.results.mkdir(parents=True, exist_ok=True)
    (options.results / options.table).write_text(text, encoding="utf-8")
    print(text)
    return 1 if any(o.verdict in (MISREAD, TRACEBACK) for o in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
