"""Study of ordinary machines on ordinary benches: `make study-ordinary`.

Six kinds of machines, each with two to four imperfections at once, go as files through `heatrun
calibrate` (a share of them through `discover` too) and are read back from the run folder. Rows go
to a file as they come; a run that was killed goes on from there. Seed 8000 is for tuning, reports
use seed 100300 (80000 to 100223 were before it).
"""

import json
import os
import re
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the arrays are small; threads only wait
sys.path.insert(0, str(Path(__file__).parents[1] / "heatrun"))

import numpy as np
from gate_rows import at_least, at_most
from ordinary_machines import KINDS, Case, make, resistance, structure_fitted, write_case
from page_numbers import said_and_simulated
from study_runs import Row, command, options_of, run_study, temporary

REPORTING_SEED = 100_300
"""Tuning used those from 8000 on."""

IN_SET = 0.1
"""Probability from which on an effect that may be missing is told, and counts as in the set [1]."""


def page_invariant(run_folder: Path) -> bool:
    """Return whether what page 1 says, simulated, has the RMSE that it says."""
    return all(
        abs(simulated - said) <= 0.1 * said + 0.05
        for said, simulated in said_and_simulated(run_folder)
    )


def stated_effects(fit: Row) -> list[Row]:
    """Return what `fit.json` claims: an id, the set that it stands in, and whether it is firm."""
    model = fit["models"]["second"]
    has = list(fit.get("effects") or [effect["id"] for effect in model.get("effects", ())])
    tied = {each: list(f["values"]) for f in fit["findings"] if f["id"] == "effect_ambiguous"
            for each in has if each in f["values"]}  # fmt: skip
    claims = [{"id": each, "set": tied.get(each, [each]), "firm": True} for each in has]
    maybe = [row["id"] for row in model.get("maybe_missing") or ()
             if row["probability"] >= IN_SET and row["id"] not in has]  # fmt: skip
    if maybe:
        is_firm = any(f["id"] == "missing_effect" and f["severity"] == "warning"
                      for f in fit["findings"])  # fmt: skip
        claims.append({"id": maybe[0], "set": maybe, "firm": is_firm})
    return claims


def discovered(found: Row) -> list[Row]:
    """Return what `discovery.json` claims; traces are not said to be there."""
    return [
        {"id": each["id"], "set": [each["id"], *each["equivalents"]], "firm": is_firm}
        for name, is_firm in (("effects", True), ("traces", False))
        for each in found[name]
    ]


def stated_parameters(fit: Row) -> dict[str, Row]:
    model = fit["models"]["second"]
    entries, derived = model["parameters"], model["derived"]
    found = {name: entries[name] for name in ("Ceq_w", "Ceq_sr", "Req_w")}
    loaded = derived.get("Req_sr_loaded", entries["Req_sr"])
    found["Req_sr_loaded"] = entries["Req_sr"] | loaded
    if "Req_sr_at_rest" in derived:
        found["Req_sr_rest"] = entries["Req_sr"] | derived["Req_sr_at_rest"]
    return found


def true_at(case: Case, condition: str, otherwise: float | None) -> float | None:
    read = {name: float(number) for name, number in re.findall(
        r"(stator|sink) (-?\d+) °C", condition)}  # fmt: skip
    rpm = re.search(r"(\d+) rpm", condition)
    if (rpm is None and not case.machine.is_coil) or len(read) < 2:
        return otherwise
    p, rated = case.machine.physics, case.machine.rated["rpm"] or 1.0
    speed = float(rpm[1]) / rated if rpm else 0.0
    return resistance(p, read["stator"] - read["sink"], speed, p["rotor_W"] if speed else 0.0)


def stated_use(run_folder: Path) -> str:
    import heatrun
    from heatrun.runs.verdict import headline

    return headline(heatrun.open_run(run_folder).result).use


def instruments_told(fit: Row, wanted: dict[str, float]) -> list[str]:
    """Return the instruments' parameters that left their prior's centre on the side of the sign.

    The resistance of a coil has a prior that allows for eddies: it is held against the one given.
    """
    model, told = fit["models"]["second"], []
    for name, entry in (model["parameters"] | model["nuisances"]).items():
        bare = name.split("[")[0].removeprefix("own_")  # told by a test's inputs: 0 otherwise
        sign = wanted.get(bare)
        centre = 0.0 if name.startswith("own_") else np.mean(entry["prior_95"])
        centre = fit["motor"]["phase_resistance_ohm"] if bare == "Rs0" else centre
        ends = [sign * (e - centre) for e in entry["interval_95"]] if sign else [0.0]
        if min(ends) > 0.0:
            told.append(name)
    return told


def jobs(first_seed: int, num: int, kinds: Sequence[str], discover: float) -> list[Row]:
    listed = [
        {"kind": list(KINDS)[place % len(KINDS)], "seed": first_seed + place,
         "seeks": (place // len(KINDS) + 1) * discover % 1.0 < discover}
        for place in range(num)
    ]  # fmt: skip
    return [job for job in listed if job["kind"] in kinds]


def run(job: Row) -> Row:
    case = make(job["kind"], job["seed"])
    machine, begin = case.machine, time.process_time()
    structure = structure_fitted(case, job["seed"])
    row = {
        **job, "tests": list(case.tests), "drawn": machine.drawn, "truth": case.truth(),
        "structure": structure | {"processor_s": time.process_time() - begin},
        "imperfections": {
            cause: {"alone_K": alone, "refit_K": structure["refit_K"][cause],
                    "ids": sorted(machine.names(cause)), "instruments": machine.instruments(cause)}
            for cause, alone in case.alone_K.items()
        },
    }  # fmt: skip
    with temporary() as folder:
        *fitted, held_out = map(str, write_case(case, folder))
        for verb in ("calibrate", "discover")[: 1 + job["seeks"]]:
            begin, out = time.process_time(), folder / verb
            code, said = command([verb, str(folder / "motor.toml"), *fitted, "--holdout", held_out,
                                  "--model", "second", "--quick", "--out", str(out)])  # fmt: skip
            row[verb] = {"exit_code": code, "processor_s": time.process_time() - begin}
            row[verb] |= described(out, row, case) if code == 0 else {"failure": said[-1200:]}
    return row


def described(folder: Path, row: Row, case: Case) -> Row:
    fit = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
    path = folder / "discovery.json"
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    claims = stated_effects(fit) if found is None else discovered(found)
    residuals = fit["models"]["second"]["residuals"]
    ids = {each for one in row["imperfections"].values() for each in one["ids"]}
    told = {}
    for cause, one in row["imperfections"].items():
        wanted = set(one["ids"])
        told[cause] = (
            "named" if any(claim["firm"] and claim["id"] in wanted for claim in claims)
            else "in set" if any(wanted & set(claim["set"]) for claim in claims)
            else "instrument" if instruments_told(fit, one["instruments"]) else ""
        )  # fmt: skip
    return {
        "use": stated_use(folder), "page_invariant": page_invariant(folder),
        "verdict": found["verdict"] if found else None, "claims": claims, "told": told,
        "false": [c["id"] for c in claims if c["firm"] and not ids & set(c["set"])],
        "rmse_K": max(r["rmse_K"] for r in residuals if r["role"] == "calibration"),
        "holdout_rmse_K": next(r["rmse_K"] for r in residuals if r["role"] == "holdout"),
        "parameters": {
            name: {"truth": true_at(case, entry.get("condition", ""), row["truth"][name]),
                   **{key: entry[key] for key in ("value", "sd", "interval_95")},
                   "identifiability": entry.get("identifiability", "")}
            for name, entry in stated_parameters(fit).items() if row["truth"][name] is not None
        },
        "findings": [f["id"] for f in fit["findings"] if f["severity"] == "warning"],
    }  # fmt: skip


def covered(said: Row) -> list[bool]:
    """Return whether each parameter that is said to be identified is in its 95 % interval."""
    return [
        bool((low or 0.0) <= each["truth"] <= (np.inf if high is None else high))
        for each in said["parameters"].values()
        if each["identifiability"] != "not identifiable"
        for low, high in (each["interval_95"],)  # an open end is null
    ]


def is_off(said: Row) -> bool:
    """Return whether a parameter is more than 3 sds or more than 10 % off."""
    return any(
        (off := abs(each["value"] - each["truth"])) > 3.0 * (each["sd"] or np.inf)
        or off > 0.1 * each["truth"]
        for each in said["parameters"].values()
    )


def told(rows: Sequence[Row], verb: str, above_K: float, by: str = "alone_K") -> list[bool]:
    """Return whether each imperfection above a size is named, in a set or an instrument's."""
    return [
        bool(row[verb]["told"][cause])
        for row in rows
        for cause, one in row["imperfections"].items()
        if one[by] > above_K
    ]


def held(rows: Sequence[Row], verb: str, by: str = "holdout_rmse_K") -> list[bool]:
    """Return whether the held-out test is predicted nearly as well as by the true structure, where
    that found a fit.
    """
    return [r[verb]["holdout_rmse_K"] <= 1.5 * r["structure"][by] for r in rows
            if np.isfinite(r["structure"][by])]  # fmt: skip


def gates(rows: Sequence[Row], verb: str) -> list[str]:
    stated = [row for row in rows if row[verb]["use"] != "not usable"]
    usable = [row for row in rows if row[verb]["use"] == "usable"]
    lines = [
        at_least("parameters in their 95 % intervals, pages that can be used", 0.90,
                 [hit for row in stated for hit in covered(row[verb])]),
        at_least("the same, all pages", 0.90, [hit for row in rows for hit in covered(row[verb])]),
        at_most("*usable* with a parameter > 3 sds or > 10 % off, of pages that say usable", 0.03,
                [is_off(row[verb]) for row in usable]),
        at_most("the same, of all cases", 0.03,
                [row[verb]["use"] == "usable" and is_off(row[verb]) for row in rows]),
        at_least("page invariant", 1.0,
                 [row[verb]["page_invariant"] for row in rows]),
        at_least("imperfections > 1 K alone: named or in the set", 0.90, told(rows, verb, 1.0)),
        at_least("imperfections > 0.3 K alone: named or in the set", 0.75, told(rows, verb, 0.3)),
        at_least("imperfections that leave > 0.3 K when all else is fitted anew", 0.90,
                 told(rows, verb, 0.3, "refit_K")),
        at_least("imperfections that leave > 0.1 K when all else is fitted anew", 0.75,
                 told(rows, verb, 0.1, "refit_K")),
        at_most("cases in which something is named that is not there", 0.05,
                [bool(row[verb]["false"]) for row in rows]),
        at_least("held-out RMSE ≤ 1.5 × that of the true structure, fitted", 0.85,
                 held(rows, verb)),
        at_least("the same, where that starts from priors about other figures", 0.85,
                 held(rows, verb, "holdout_unknowing_K")),
        at_least("the same, where its instruments are known as well as heatrun knows them", 0.85,
                 held(rows, verb, "holdout_instruments_K")),
    ]  # fmt: skip
    verdicts = [row[verb]["verdict"] == "unexplained" for row in rows if row[verb]["verdict"]]
    return [*lines, at_most("UNEXPLAINED", 0.10, verdicts)]


def share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} of {len(hits)}" if hits else "–"


def table(rows: Sequence[Row], words: str, planned: int) -> str:
    failed = [(row, verb) for row in rows for verb in ("calibrate", "discover")
              if row.get(verb, {}).get("exit_code", 0) != 0]  # fmt: skip
    lines = [
        "# Ordinary machines on ordinary benches", "",
        f"`make study-ordinary` (ordinary.py {words}); {len(rows)} of {planned} cases, "
        f"{len(failed)} commands ended with an error. Each machine has two to four imperfections "
        "at once; two or three tests, one of another kind held out. *Alone*: RMS on the winding "
        "over the fitted tests between the machine and itself without the imperfection. *Left*: "
        "what the true structure without it leaves when all else is fitted anew. *Told*: named, in "
        "a stated set (from 5 % on), or an instrument's parameter that says the same. The true "
        "structure, fitted, has priors of a factor of e about the true figures; other figures are "
        "off by such a factor. It found no fit in "
        f"{sum(not np.isfinite(row['structure']['holdout_rmse_K']) for row in rows)} cases, which "
        "are not counted against it.",
    ]  # fmt: skip
    for verb in ("calibrate", "discover"):
        done = [row for row in rows if row.get(verb, {}).get("exit_code") == 0]
        if not done:
            continue
        kinds = [(kind, [r for r in done if r["kind"] == kind]) for kind in KINDS]
        lines += ["", f"## `heatrun {verb}`, {len(done)} cases", "",
                  "| what | gate | measured | 95 % limits | |", "|---|---|---|---|---|",
                  *gates(done, verb), "",
                  "| kind | cases | in 95 % | usable / restricted / not | usable and off "
                  "| > 1 K told | > 0.3 K told | not there | held out | its RMSE over the "
                  "structure's, median | processor s, median / most |", "|---" * 11 + "|",
                  *(_of_kind(kind, of, verb) for kind, of in kinds if of), "",
                  "| imperfection | alone > 0.3 K | named | in set | instrument | missed | left "
                  "by those missed, median / most |", "|---" * 7 + "|",
                  *_of_causes(done, verb)]  # fmt: skip
    lines += ["", *(f"- {r['kind']} {r['seed']}, {verb}: {r[verb]['failure'][-300:]!r}"
                    for r, verb in failed), ""]  # fmt: skip
    return "\n".join(lines)


def _of_kind(kind: str, rows: Sequence[Row], verb: str) -> str:
    said = [row[verb] for row in rows]
    uses = [str(sum(one["use"] == use for one in said))
            for use in ("usable", "restricted", "not usable")]  # fmt: skip
    ratio = [r[verb]["holdout_rmse_K"] / r["structure"]["holdout_rmse_K"] for r in rows]
    seconds = [one["processor_s"] for one in said]
    cells = [kind, str(len(rows)), share([hit for one in said for hit in covered(one)]),
             " / ".join(uses), share([is_off(one) for one in said if one["use"] == "usable"]),
             share(told(rows, verb, 1.0)), share(told(rows, verb, 0.3)),
             share([bool(one["false"]) for one in said]), share(held(rows, verb)),
             f"{np.nanmedian(ratio):.2f}",
             f"{np.median(seconds):.0f} / {max(seconds):.0f}"]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _of_causes(rows: Sequence[Row], verb: str) -> list[str]:
    lines = []
    for cause in dict.fromkeys(each for row in rows for each in row["imperfections"]):
        seen = [(row[verb]["told"][cause], one["refit_K"]) for row in rows
                if (one := row["imperfections"].get(cause)) and one["alone_K"] > 0.3]  # fmt: skip
        how = [str(sum(word == each for word, _ in seen))
               for each in ("named", "in set", "instrument", "")]  # fmt: skip
        left = [refit for word, refit in seen if not word]
        words = f"{np.nanmedian(left):.2f} / {np.nanmax(left):.2f} K" if left else "–"
        lines.append(f"| {cause} | {len(seen)} | {' | '.join(how)} | {words} |")
    return lines


def main() -> None:
    parser = options_of(__doc__, "ordinary", REPORTING_SEED, cases=72)
    parser.add_argument("--kind", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--discover", type=float, default=0.0, help="share of the cases [1]")
    options = parser.parse_args()
    listed = jobs(options.seed, options.cases, options.kind, options.discover)
    words = f"--seed {options.seed} --cases {options.cases} --discover {options.discover:g}"

    def said(row: Row) -> str:
        found = row["calibrate"]
        use = found.get("use", found["exit_code"])
        return f"{row['kind']} {row['seed']}: {use}, {found['processor_s']:.0f} s"

    page = partial(table, words=words, planned=len(listed))
    run_study(options, listed, run, page, said=said, tasks=4)


if __name__ == "__main__":
    main()
