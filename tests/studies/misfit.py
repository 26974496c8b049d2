"""Study of calibrations whose network misses something mild: `make study-misfit`.

Writes rows and a table under `results/misfit/`: how often a parameter is off without any finding,
how often a clean machine is suspected, how often intervals cover, and how far the bands of a
held-out test hold. Seeds below 200000 were used while findings and intervals were made; reports use
seeds from 200000 on, each once (200000: before the posterior was averaged; 210000: now).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import platform
import sys
import time
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from discovery_gates import limits_95
from misfit_cases import KINDS, OF_AN_INSTRUMENT, PARAMETERS, REDEFINES, jobs, run

REPORTING_SEED = 210_000

BEFORE = ("misfit", "not_converged", "several_optima", "sampling_not_converged")
"""Findings on a fit that there were before calibrations screened the catalogue."""

NOW = (*BEFORE, "missing_effect", "instrument_beyond_prior")
"""And those of now. One on the held-out test is not counted: most benches have a single record."""

VISIBLE_K = 0.1
"""Misfit from which on a cause counts as visible [K]."""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=REPORTING_SEED)
    parser.add_argument("--repeats", type=int, default=19, help="machines for each cause")
    parser.add_argument("--clean", type=int, default=60)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no case is begun after this; their order is by chance")  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("results") / "misfit")
    options = parser.parse_args()
    listed = jobs(options.seed, options.repeats, options.clean)
    options.out.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    rows: list[dict[str, Any]] = []
    context = multiprocessing.get_context("spawn")  # JAX must not be forked
    with context.Pool(options.processes) as pool:
        for first in range(0, len(listed), options.processes):
            if time.monotonic() - begin > 60.0 * options.minutes:
                break
            for row in pool.map(run, listed[first : first + options.processes], 1):
                rows.append(row)
                names = [f[0] for f in row.get("findings", [])]
                print(
                    f"{len(rows)}/{len(listed)} {row['kind']} {row['seed']}: {names} "
                    f"{row['processor_s']:.0f} s {row.get('failure', '')}",
                    flush=True,
                )
            write(rows, options.out, " ".join(sys.argv), options.seed, len(listed))


def write(rows: list[dict[str, Any]], out: Path, command: str, seed: int, planned: int) -> None:
    """Write rows and table."""
    rows = sorted(rows, key=lambda row: row["seed"])
    packages = ("heatrun", "jax", "numpy", "scipy", "optimistix")
    content = {
        "command": command,
        "seed": seed,
        "planned": planned,
        "python": platform.python_version(),
        "versions": {name: version(name) for name in packages},
        "rows": rows,
    }
    (out / "study.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    (out / "table.md").write_text(table(rows, command, seed, planned), encoding="utf-8")


def table(rows: Sequence[dict[str, Any]], command: str, seed: int, planned: int) -> str:
    """Return the tables in Markdown."""
    done = [row for row in rows if row["exit_code"] == 0]
    lines = [
        "# Calibrations whose network misses something",
        "",
        f"`make study-misfit` ({command.split('/')[-1]}), seeds from {seed} on; {len(rows)} of "
        f"{planned} cases were run, in an order by chance; {len(rows) - len(done)} ended with an "
        "error. One test of 90 minutes at 1 Hz each, a drive cycle held out, machines at random "
        "over a decade in size, through `heatrun calibrate --model second --quick` and back from "
        "the run folder. *Off*: a parameter is more than 3 of its standard deviations from the "
        "truth, in brackets: outside at least one of its 95 % intervals, which chance alone does "
        "to 10…15 % of machines. A parameter that the effect redefines is left out. *Silent*: off, "
        f"and no finding on the fit ({', '.join(NOW)}). *By the fit alone*: counting only "
        f"{', '.join(BEFORE)}.",
        "",
        "| hidden | cases | visible misfit | off | silent by the fit alone | silent | a finding | "
        "the effect is named | held-out points in the band, mean / worst |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        members = [row for row in done if row["kind"] == kind]
        if members:
            lines.append(_line(kind, members))
    hidden = [row for row in done if row["kind"] not in ("nothing", *OF_AN_INSTRUMENT)]
    lines += ["", "| what | gate | measured | 95 % limits | |", "|---|---|---|---|---|"]
    lines += [
        _gate("clean machines with a finding", 0.05,
              [bool(_said(r, NOW)) for r in done if r["kind"] == "nothing"]),
        _gate(f"silent by more than 3 sds, visible above {VISIBLE_K:g} K", 0.03,
              [_far(r) and not _said(r, NOW) for r in hidden if r["visible_K"] > VISIBLE_K]),
        _gate("silent by more than 3 sds, all causes in the machine or its sensor", 0.08,
              [_far(r) and not _said(r, NOW) for r in hidden]),
        _gate("the same by the findings of the fit alone", 0.08,
              [_far(r) and not _said(r, BEFORE) for r in hidden]),
        _gate("silent by more than 3 sds, errors of current and torque", 0.08,
              [_far(r) and not _said(r, NOW) for r in done if r["kind"] in OF_AN_INSTRUMENT]),
    ]  # fmt: skip
    clean = [row for row in done if row["kind"] == "nothing"]
    chance = sum(map(_outside, clean)) / max(len(clean), 1)
    lines += [
        _gate("outside some 95 % interval without a finding (gate: clean machines + 10 points)",
              chance + 0.10, [_outside(r) and not _said(r, NOW) for r in hidden]),
        _least("95 % intervals that cover, causes in the machine or its sensor", 0.90,
               [hit for r in hidden for hit in _covered(r)]),
        _least("95 % intervals that cover, clean machines", 0.90,
               [hit for r in clean for hit in _covered(r)]),
        _band("held-out points in the 95 % band, causes in the machine or its sensor", hidden),
        _band("held-out points in the 95 % band, clean machines", clean),
    ]  # fmt: skip
    seconds = [row["processor_s"] for row in done]
    lines += ["", f"Median {np.median(seconds) if seconds else 0.0:.0f} s of processor time for a "
              "command in a warm process.", ""]  # fmt: skip
    return "\n".join(lines)


def _line(kind: str, rows: Sequence[dict[str, Any]]) -> str:
    covered = [row["holdout_coverage_95"] for row in rows]
    named = sum(any(f[0] == "missing_effect" and kind in f[1] for f in r["findings"]) for r in rows)
    said = Counter(bool(_said(row, NOW)) for row in rows)[True]
    cells = [
        kind, str(len(rows)), f"{np.mean([row['visible_K'] for row in rows]):.2f} K",
        f"{sum(map(_far, rows))} ({sum(map(_outside, rows))})",
        *(
            f"{sum(_far(r) and not _said(r, ids) for r in rows)} "
            f"({sum(_outside(r) and not _said(r, ids) for r in rows)})"
            for ids in (BEFORE, NOW)
        ),
        str(said), "–" if kind == "nothing" or " " in kind or ":" in kind else str(named),
        f"{100 * np.mean(covered):.0f} / {100 * np.min(covered):.0f} %",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _gate(what: str, most: float, cases: Sequence[bool]) -> str:
    if not cases:
        return f"| {what} | ≤ {100 * most:.0f} % | – | – | – |"
    count, num = sum(cases), len(cases)
    low, high = limits_95(count, num)
    mark = "met" if high <= most else "met, too few cases to show it"
    mark = mark if count <= most * num else "**missed**"
    return (
        f"| {what} | ≤ {100 * most:.0f} % | {100 * count / num:.1f} % ({count} of {num}) | "
        f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
    )


def _least(what: str, least: float, cases: Sequence[bool]) -> str:
    if not cases:
        return f"| {what} | ≥ {100 * least:.0f} % | – | – | – |"
    count, num = sum(cases), len(cases)
    low, high = limits_95(count, num)
    mark = "met" if low >= least else "met, too few cases to show it"
    mark = mark if count >= least * num else "**missed**"
    return (
        f"| {what} | ≥ {100 * least:.0f} % | {100 * count / num:.1f} % ({count} of {num}) | "
        f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
    )


def _band(what: str, rows: Sequence[dict[str, Any]]) -> str:
    if not rows:
        return f"| {what} | 90…98 % | – | – | – |"
    found = np.array([row["holdout_coverage_95"] for row in rows])
    mean, error = 100.0 * found.mean(), 196.0 * found.std() / np.sqrt(found.size)
    mark = "met" if 90.0 <= mean <= 98.0 else "**missed**"
    return (
        f"| {what} | 90…98 % | mean {mean:.1f} %, {100 * np.mean(found < 0.85):.0f} % of the tests "
        f"below 85 % | {mean - error:.0f}…{min(mean + error, 100.0):.0f} % | {mark} |"
    )


def _covered(row: dict[str, Any]) -> list[bool]:
    """Whether each judged parameter is in its 95 % interval."""
    intervals, truth = row["interval_95"], row["truth"]
    return [intervals[n][0] <= truth[n] <= intervals[n][1] for n in _judged(row)]


def _said(row: dict[str, Any], ids: Sequence[str]) -> list[str]:
    return [finding[0] for finding in row["findings"] if finding[0] in ids]


def _judged(row: dict[str, Any]) -> list[str]:
    return [name for name in PARAMETERS if name != REDEFINES.get(row["kind"])]


def _far(row: dict[str, Any]) -> bool:
    """Whether a parameter is off by more than 3 of its standard deviations."""
    return any(
        abs(row["value"][name] - row["truth"][name]) > 3.0 * row["sd"][name]
        for name in _judged(row)
    )


def _outside(row: dict[str, Any]) -> bool:
    """Whether a parameter is outside its 95 % interval."""
    return any(
        not row["interval_95"][name][0] <= row["truth"][name] <= row["interval_95"][name][1]
        for name in _judged(row)
    )


if __name__ == "__main__":
    main()
