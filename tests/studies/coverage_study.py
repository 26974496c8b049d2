"""Study of the honesty of the intervals: `make study-coverage`.

Writes rows, gates and tables under `results/coverage/`. Seed 1000 was used to tune;
reports use seed 70000 (50000 was reported before the noise of block means was mended, 60000 before
the heat that a network misses had a prior). Rows go to a file as they come; a run that was killed
goes on from there.
"""

import gzip
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the arrays are small; threads only wait

import numpy as np
from coverage_gates import (
    GROUPS,
    LEVELS,
    MISSPECIFIED,
    NETWORK,
    TIMES,
    chosen,
    coverage,
    gates,
    histogram,
    is_inside,
    rank,
)
from gate_rows import heads, percent_95
from study_runs import Row, about, options_of, rows_as_they_come

from heatrun.posterior.identifiability import BETWEEN_K

TUNING_SEED = 1_000
REPORTING_SEED = 70_000

NUM_RECORDS = {
    "as declared": 400, "prior draws": 200, "exact instruments": 120,
    **dict.fromkeys(MISSPECIFIED, 60),
    **dict.fromkeys(("truncated", "large errors, declared", "large errors, not declared",
                     "errors taken as none", "point samples at 1 Hz", "unevenly soaked"), 30),
}  # fmt: skip
"""Records of each cell."""

NUM_EMCEE = {"as declared": 20, "prior draws": 10}
"""Records of a cell on which the ensemble sampler is run as well: a minute and more each, since
its tails must converge too."""

TASKS = 60
"""Records after which a process is replaced: what it has compiled for each length of record stays
in its memory."""

HURRY = {"as declared": 0.75, "prior draws": 0.75}
"""A run that is cut short has these in full before the others [1]."""


METHODS = ("laplace", "quick", "emcee")


def main() -> None:
    parser = options_of(__doc__, "coverage", REPORTING_SEED)
    parser.add_argument("--only", choices=NUM_RECORDS, help="this cell alone")
    parser.add_argument("--share", type=float, default=1.0, help="of the records of each cell")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / f"rows-{options.seed}.partial.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {(row["cell"], row["index"]) for row in rows}
    wanted = [
        job for job in jobs(options.seed, options.share) if options.only in (None, job["cell"])
    ]
    waiting = [job for job in wanted if (job["cell"], job["index"]) not in done]
    pool = {"processes": options.processes, "minutes": options.minutes, "tasks": TASKS}
    for finished in rows_as_they_come(waiting, _run, **pool):
        for row in finished:
            rows.append(row)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(f"{len(rows)}/{len(wanted)} {row['cell']} {row['index']} {row['seconds']:.1f} s",
                  flush=True)  # fmt: skip
    words = f"--seed {options.seed}"
    if options.only:
        words += f' --share {options.share:g} --only "{options.only}"'
    write(rows, options.out, words, options.seed, len(wanted), has_gates=not options.only)
    if len(rows) == len(wanted):
        path.unlink(missing_ok=True)


def _run(job: Row) -> Row:
    from heatrun.io.caches import use_caches

    use_caches(print)
    from coverage_cases import run

    return run(job)


def jobs(seed: int, share: float) -> Iterator[Row]:
    """Yield the records in such an order that a run cut short has its share of every cell."""
    listed = []
    for cell, count in NUM_RECORDS.items():
        num = max(1, round(share * count))
        every = max(1, num // max(1, round(share * NUM_EMCEE.get(cell, 0)))) | 1
        for index in range(num):
            emcee = cell in NUM_EMCEE and index % every == 0
            job = {"cell": cell, "seed": seed, "index": index, "emcee": emcee}
            listed.append((index / num * HURRY.get(cell, 1.0), job))
    yield from (job for _, job in sorted(listed, key=lambda each: each[0]))


def write(
    rows: list[Row], out: Path, words: str, seed: int, planned: int, *, has_gates: bool
) -> None:
    rows = sorted(rows, key=lambda row: (list(NUM_RECORDS).index(row["cell"]), row["index"]))
    content = about(seed, planned, f"make study-coverage (coverage_study.py {words})")
    content |= {"tuning_seed": TUNING_SEED, "cpu_s": sum(row["cpu_s"] for row in rows)}
    (out / "study.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    found = gates(rows) if has_gates else []  # they are for all cells
    (out / "table.md").write_text(table(rows, found, content), encoding="utf-8")
    lines = "".join(json.dumps(_short(row)) + "\n" for row in rows).encode()
    (out / "rows.jsonl.gz").write_bytes(gzip.compress(lines, mtime=0))


def _short(value: Any) -> Any:
    """Return a row with its figures cut to five digits, without times that differ from run to run.

    Ranks come from 4000 draws: more digits say nothing.
    """
    if isinstance(value, dict):
        return {k: _short(v) for k, v in value.items() if k not in ("seconds", "cpu_s")}
    if isinstance(value, list):
        return [_short(v) for v in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def table(rows: Sequence[Row], found: Sequence[str], content: Row) -> str:
    lines = [
        "# Are the intervals honest?",
        "",
        f"`{content['command']}`: {len(rows)} records of {content['planned']} planned, seed "
        f"{content['seed']}, run once with frozen code; "
        f"tuning used seed {content['tuning_seed']} alone. "
        f"{content['cpu_s'] / 60:.0f} min of one processor, compilation included.",
        "",
        "Cells and methods are explained in `results/coverage/README.md`. Limits are 95 % binomial "
        "(Clopper-Pearson).",
        "",
    ]
    if found:
        lines += ["## Gates", "", *heads("what | wanted | measured | 95 % limits | "), *found]
        lines += [""]
    cells = list(dict.fromkeys(row["cell"] for row in rows))
    lines += ["## Coverage of 50, 90 and 95 % intervals [%]", ""]
    names = (*NETWORK, *TIMES, "end")
    lines += heads(" | ".join(["cell | method | records", *names]))
    for cell in cells:
        for method in METHODS:
            mine = chosen(rows, cell, method)
            if mine:
                lines.append(_coverage_line(cell, method, mine, names))
    lines += ["", "`end`: the reading without noise at the end of the held-out test.", ""]
    lines += _by_duration(rows)
    lines += _prediction(rows, cells)
    lines += _between(rows)
    lines += _widths(rows, cells)
    lines += _ranks(rows)
    lines += _guards(rows, cells)
    return "\n".join(lines) + "\n"


def _coverage_line(cell: str, method: str, rows: Sequence[Row], names: Sequence[str]) -> str:
    parts = []
    for name in names:
        if name not in rows[0][method]["ranks"]:
            parts.append("–")
            continue
        ranks = rank(rows, method, name)
        parts.append(" / ".join(f"{100 * coverage(ranks, level):.0f}" for level in LEVELS))
    return f"| {cell} | {method} | {len(rows)} | {' | '.join(parts)} |"


def _by_duration(rows: Sequence[Row]) -> list[str]:
    lines = ["## Coverage of 95 % intervals by length of the test, quick [%]", ""]
    lines += heads(" | ".join(["cell | test | records", *NETWORK]))
    for cell in ("as declared", "exact instruments"):
        for key, unit, scale in (("duration_s", "min", 60.0), ("kind", "", 1.0)):
            mine = chosen(rows, cell, "quick")
            for value in sorted({row[key] for row in mine}):
                some = [row for row in mine if row[key] == value]
                label = value if key == "kind" else f"{value / scale:.0f} {unit}"
                parts = []
                for name in NETWORK:
                    share = coverage(rank(some, "quick", name), 0.95)
                    limits = percent_95(round(share * len(some)), len(some))
                    parts.append(f"{100 * share:.0f} ({limits.removesuffix(' %')})")
                lines.append(f"| {cell} | {label} | {len(some)} | {' | '.join(parts)} |")
    return [*lines, ""]


def _prediction(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = ["## Held-out tests of twice the length, quick", ""]
    lines += heads(
        "cell | 30 s means in the 50 % band [%] | in the 95 % band [%] | "
        "in the 95 % band, worst tenth of records [%] | median sd at the end [K]"
    )
    for cell in cells:
        mine = [row["quick"] for row in chosen(rows, cell, "quick")]
        share = np.array([row["share_95"] for row in mine])
        half = np.mean([row["share_50"] for row in mine])
        end = np.median([row["end_sd_K"] for row in mine])
        lines.append(f"| {cell} | {100 * half:.0f} | {100 * share.mean():.1f} | "
                     f"{100 * np.quantile(share, 0.1):.0f} | {end:.2f} |")  # fmt: skip
    return [*lines, ""]


def _between(rows: Sequence[Row]) -> list[str]:
    slow = [row for row in rows if max(row.get("between_K", [0.0])) > 0.0]
    if not slow:
        return []
    lines = [
        "## Loads sampled in points, quick",
        "",
        f"*Lost*: heatrun's estimate of what the load does between its samples, in one of the two "
        f"tests, is above its limit of {BETWEEN_K} K (finding `between_samples`).",
        "",
        *heads(" | ".join(["calibrated on | lost | records | estimate [K]", *NETWORK,
                           "end | in the 95 % band"])),
    ]  # fmt: skip
    for is_lost in (False, True):
        mine = [row for row in slow if (max(row["between_K"]) > BETWEEN_K) == is_lost]
        if mine:
            kinds = ", ".join(sorted({row["kind"] for row in mine})).replace("_", " ")
            largest = [max(row["between_K"]) for row in mine]
            parts = [f"{100 * coverage(rank(mine, 'quick', name), 0.95):.0f}"
                     for name in (*NETWORK, "end")]  # fmt: skip
            share = np.mean([row["quick"]["share_95"] for row in mine])
            lines.append(
                f"| {kinds} | {'yes' if is_lost else 'no'} | {len(mine)} | "
                f"{np.median(largest):.2f}, at most {max(largest):.2f} | {' | '.join(parts)} | "
                f"{100 * share:.1f} |"
            )
    return [*lines, ""]


def _widths(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = [
        "## Width over the attainable one",
        "",
        "Median over the records of the posterior's standard deviation of the logarithm over the "
        "Cramér-Rao bound with the true noise and the same priors; in brackets the bound [%].",
        "",
        *heads(" | ".join(["cell | method", *NETWORK])),
    ]
    for cell in cells:
        for method in METHODS:
            mine = chosen(rows, cell, method)
            if not mine:
                continue
            parts = []
            for name in NETWORK:
                best = np.array([row["bound"][name] for row in mine])
                ratio = np.array([row[method]["sd"][name] for row in mine]) / best
                parts.append(f"{np.median(ratio):.2f} ({100 * np.median(best):.1f})")
            lines.append(f"| {cell} | {method} | {' | '.join(parts)} |")
    return [*lines, ""]


def _ranks(rows: Sequence[Row]) -> list[str]:
    drawn = chosen(rows, "prior draws", "quick")
    if not drawn:
        return []
    lines = [f"## Rank histograms, {len(drawn)} draws from the prior, quick", ""]
    lines += [
        "The envelope holds all bins of all quantities of one group in 95 % of studies.",
        "",
        *heads("quantity | counts | inside"),
    ]
    for group in GROUPS:
        for name in group:
            ranks = rank(drawn, "quick", name)
            counts = " ".join(str(count) for count in histogram(ranks))
            mark = "yes" if is_inside(ranks, len(group)) else "**no**"
            lines.append(f"| {name} | {counts} | {mark} |")
    return [*lines, ""]


def _guards(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = ["## What the fit and the sampler said", ""]
    lines += heads("cell | weighted draws sound [%] | flagged as misfit [%] | several optima [%] | "
                   "unmodelled heat above 0.5 % of the loss [%]")  # fmt: skip
    for cell in cells:
        mine = chosen(rows, cell, "quick")
        shares = (
            np.mean([row["quick"]["is_sound"] for row in mine]),
            np.mean(["misfit" in row["findings"] for row in mine]),
            np.mean(["several_optima" in row["findings"] for row in mine]),
            np.mean([row["unmodelled_heat"] > 0.005 for row in mine]),
        )
        lines.append(f"| {cell} | " + " | ".join(f"{100 * share:.0f}" for share in shares) + " |")
    return lines


if __name__ == "__main__":
    main()
