"""Laplace's evidence of networks against importance sampling: `make study-evidence`.

What the search for effects weighs is the evidence by Laplace's approximation. Here, on ordinary
machines of the tuning seeds, the network that was chosen and the same without each of its effects
are drawn from, and the log Bayes factors of the two ways are held against each other. Importance
weights give the evidence without bias; where their guard fails, or where the page's fit has less
unmodelled heat than the search had, the pair does not count and is said.
"""

import math
from collections.abc import Sequence

import numpy as np
from ordinary_machines import KINDS, make, write_case
from study_runs import Row, options_of, run_study, temporary

from heatrun.calibration import load_tests, with_scales_of
from heatrun.effects.found import as_fit, find
from heatrun.effects.search import ODDS
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.importance import importance_sample

SEED = 8_000

CLOSE = 3.0
"""Error of a log Bayes factor that turns no decision [nat]: below what one effect costs by its odds
and its parameters."""


def run(job: Row) -> Row:
    """Return log Bayes factors of the chosen network over those without one of its effects."""
    with temporary() as folder:
        *fitted, held_out = write_case(make(job["kind"], job["seed"]), folder)
        motor = load_motor(folder / "motor.toml")
        tests = load_tests(motor, fitted, [held_out])
    motor = with_scales_of(tests, motor)
    blocks = {role: [test.blocks for test in tests if test.role == role]
              for role in ("calibration", "holdout")}  # fmt: skip
    model = Model.of("second", motor).scaled(motor, blocks["calibration"])
    alone = fit(Problem.of(model, motor, blocks["calibration"]), seed=0)
    found = find(model, motor, blocks["calibration"], held_out=blocks["holdout"], start=alone)
    assert found is not None
    core = found.core

    def drawn(effects) -> Row:
        member = found.search.fitted[effects]
        settled = as_fit(found.search, member, model)
        weighted = importance_sample(settled, seed=0)
        weights = weighted.weights
        sd = math.sqrt(max(float(np.sum(weights**2)) - 1.0 / weights.size, 0.0))
        return {"laplace": member.log_evidence, "sampled": weighted.log_evidence, "sd": sd,
                "pareto_k": weighted.pareto_k, "is_sound": weighted.is_sound,
                "is_held": settled.problem.model.adequacy != model.adequacy}  # fmt: skip

    without = {each.id: drawn(core.effects - {each}) for each in core.effects}
    return {**job, "effects": list(core.ids), "core": drawn(core.effects), "without": without}


def pairs(rows: Sequence[Row]) -> list[Row]:
    """Return log Bayes factors by both ways [nat], with the error of the sampled one."""
    return [
        {"kind": row["kind"], "seed": row["seed"], "effect": effect,
         **{way: row["core"][way] - less[way] for way in ("laplace", "sampled")},
         "sd": math.hypot(row["core"]["sd"], less["sd"]),
         "is_held": row["core"]["is_held"] or less["is_held"],
         "is_sound": row["core"]["is_sound"] and less["is_sound"]}
        for row in rows for effect, less in row["without"].items()
    ]  # fmt: skip


def counts(pair: Row) -> str:
    if pair["is_held"]:
        return "no: unmodelled heat held down, which is another prior"
    return "yes" if pair["is_sound"] else "no: the guard of the sampling fails"


def table(rows: Sequence[Row]) -> str:
    every = pairs(rows)
    sound = [each for each in every if each["is_sound"] and not each["is_held"]]
    off = np.array([each["laplace"] - each["sampled"] for each in sound])
    asked = [[each[way] > -math.log(ODDS) for way in ("laplace", "sampled")] for each in sound]
    turned = [one for one, other in asked if one != other]
    lines = [
        "| machine | effect | Laplace [nat] | importance sampling [nat] | counts |",
        "|---|---|---|---|---|",
        *(f"| {p['kind']} {p['seed']} | {p['effect']} | {p['laplace']:.1f} | "
          f"{p['sampled']:.1f} ± {p['sd']:.1f} | {counts(p)} |"
          for p in every),
        "",
        f"{len(sound)} of {len(every)} pairs count. Laplace less sampled: median "
        f"{np.median(off):.1f} nat, {np.min(off):.1f} to {np.max(off):.1f}; "
        f"{np.sum(np.abs(off) <= CLOSE)} of {len(sound)} within {CLOSE:g} nat. The effect's odds "
        f"({-math.log(ODDS):.1f} nat) decide otherwise in {len(turned)} of them.",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    options = options_of(__doc__, "ordinary", SEED, cases=6).parse_args()
    jobs = [{"kind": list(KINDS)[place % len(KINDS)], "seed": options.seed + place}
            for place in range(options.cases)]  # fmt: skip
    run_study(options, jobs, run, table, files=("evidence.json", "evidence.md"),
              said=lambda row: row["effects"])  # fmt: skip


if __name__ == "__main__":
    main()
