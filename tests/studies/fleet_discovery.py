"""Effects that the machines of a fleet share: `results/fleet/discovery.md` and `.json`.

Fleets of one type on one bench, by `fleet_of_hidden_causes`, which is independent of lptn: two
tests of one hour a machine; nothing hidden, or an effect that leaves 0.1 K of a refitted network of
the middle machine, or a cause that is in no catalogue, or an instrument of the bench off by two
stated standard deviations for all machines. Each machine is fitted, its evidence on effects worked
out, and the fleet searched as `heatrun fleet --discover` does. It goes on where it was stopped.
"""

from collections.abc import Callable, Sequence
from functools import partial

import fleet_of_hidden_causes as hidden_fleet
import numpy as np
from gate_rows import heads, limits_95
from study_runs import Row, options_of, run_study

from heatrun.fit.fit import fit
from heatrun.fit.fit_result import RESULT, Fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.results import to_plain
from heatrun.runtime import configure
from heatrun_fleet.batch.fit import fit_batch
from heatrun_fleet.shared_effects.pooled import Evidence, evidence_of
from heatrun_fleet.shared_effects.search import discover_type

COMMAND = "make study-fleet-discovery"
FIRST_SEED = 130_000
VISIBLE_K = 0.1
NUM, LARGE = 40, 100
THERMAL = {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr"}

OFF = {"power_gain": 0.02, "current_gain": 0.01, "sensor_gain": 0.01, "sensor_offset": 1.0,
       "ambient_offset": 1.0}  # fmt: skip
"""Two stated standard deviations of each instrument: 1, 1, 1, K, K."""

MOTOR = Motor(
    "line",
    phase_resistance_ohm=hidden_fleet.RS0,
    reference_temperature_degC=hidden_fleet.TREF,
    rated_speed_rpm=hidden_fleet.RATED_RPM,
    losses="balance",
)


def cases(clean: int, hidden: int, large: int, off: int, unknown: int) -> list[Row]:
    kinds: list[tuple[str, str, int, int]] = [("clean", "", NUM, clean)]
    kinds += [("hidden", name, NUM, hidden) for name in hidden_fleet.EFFECTS]
    kinds += [("hidden", name, LARGE, large) for name in hidden_fleet.EFFECTS]
    kinds += [("instrument", name, NUM, off) for name in OFF]
    kinds += [("unknown", name, NUM, unknown) for name in hidden_fleet.UNKNOWN]
    rows = []
    for place, (kind, name, num, count) in enumerate(kinds):
        for number in range(count):
            seed = FIRST_SEED + 1000 * place + number
            rows.append({"kind": kind, "name": name, "num": num, "number": number, "seed": seed,
                         "at": (number + 0.5) / count})  # fmt: skip
    # so that a study that was stopped early has a part of each kind
    return sorted(rows, key=lambda row: (row["at"], row["seed"]))


def run(case: Row) -> Row:
    amplitude, bench = 0.0, {}
    hidden = case["name"] if case["kind"] in ("hidden", "unknown") else ""
    if hidden:
        amplitude = hidden_fleet.amplitude_of(case["name"], VISIBLE_K)
    if case["kind"] == "instrument":
        bench = {case["name"]: OFF[case["name"]] * (-1.0) ** case["number"]}
    drawn = hidden_fleet.fleet(case["num"], case["seed"], hidden, amplitude, bench)
    evidence = evidence_of_fleet(drawn.tests)
    found = discover_type("A", evidence, THERMAL, seed=case["seed"])
    row = {
        **{key: case[key] for key in ("kind", "name", "num", "seed")},
        "amplitude": amplitude,
        "num_machines": found.num_machines,
        "num_alone": found.num_alone,
        "verdict": found.verdict,
        "effects": found.effects,
        "traces": found.traces,
        "could_show_K": np.median([e.could_show_K for e in found.screened]),
    }
    return to_plain(row)


def evidence_of_fleet(tests: Sequence[Sequence[dict[str, np.ndarray]]]) -> list[Evidence]:
    """Return the evidence of the machines whose fit converged."""
    problems = []
    for own in tests:
        reduced = [reduce(Record(f"test {i}", columns), MOTOR) for i, columns in enumerate(own)]
        model = Model.of("second", MOTOR).scaled(MOTOR, reduced)
        problems.append(Problem.of(model, MOTOR, reduced))
    evidence = []
    for number, found in enumerate(fit_batch(problems, seed=0)):
        one = found if isinstance(found, Fit) else fit(problems[number], seed=0, throw=False)
        if one.result is RESULT.converged:
            evidence.append(evidence_of(one))
    return evidence


def is_named(row: Row) -> bool:
    claims = [e for e in row["effects"] if e["is_beyond_instruments"]]
    return any(row["name"] in (e["id"], *e["equivalents"]) for e in claims)


def is_exact(row: Row) -> bool:
    """Whether the hidden effect is named first, and not with others in its place."""
    return bool(row["effects"]) and row["effects"][0]["id"] == row["name"] and not (
        row["effects"][0]["equivalents"]
    )  # fmt: skip


def is_found(row: Row) -> bool:
    return bool(row["effects"])


def has_more(row: Row) -> bool:
    return len(row["effects"]) > 1


def is_claimed(row: Row) -> bool:
    """Whether an effect is claimed as one: beyond instruments, and the catalogue explains it."""
    return row["verdict"] in ("named", "ambiguous")


def table(rows: list[Row]) -> list[str]:
    machines_alone = "machines that show something alone"
    lines: list[str] = []

    def head(*names: str) -> None:
        lines.extend(["", *heads(" | ".join([*names, machines_alone]))])

    def line(label: str, some: list[Row], *tests: Callable[[Row], bool]) -> None:
        said = []
        for hits in (sum(map(test, some)) for test in tests):
            low, high = limits_95(hits, len(some))
            said.append(f"{hits} of {len(some)} ({100 * low:.0f}…{100 * high:.0f} %)")
        if some:
            machines = sum(row["num_machines"] for row in some)
            alone = 100 * sum(row["num_alone"] for row in some) / machines
            lines.append(f"| {label} | {' | '.join(said)} | {alone:.0f} % |")

    def of(kind: str, name: str = "all") -> list[Row]:
        return [row for row in rows if row["kind"] == kind and name in (row["name"], "all")]

    head("nothing hidden", "anything said", "claimed as an effect")
    line(f"fleets of {NUM}", of("clean"), is_found, is_claimed)
    head("hidden, 0.1 K visible", "found", "named or in the stated set", "named alone",
         "a second one beside it")  # fmt: skip
    for num in (NUM, LARGE):
        for name in [*hidden_fleet.EFFECTS, "all"]:
            some = [row for row in of("hidden", name) if row["num"] == num]
            line(f"{name}, {num} machines", some, is_found, is_named, is_exact, has_more)
    head("an instrument off by two stated sds", "anything said", "claimed as an effect")
    for name in [*OFF, "all"]:
        line(name, of("instrument", name), is_found, is_claimed)
    head("a cause of no catalogue, 0.1 K visible", "anything said", "claimed as an effect")
    for name in hidden_fleet.UNKNOWN:
        some = of("unknown", name)
        names = dict.fromkeys(e["id"] for r in some if is_claimed(r) for e in r["effects"])
        line(name + (f" (as {', '.join(names)})" if names else ""), some, is_found, is_claimed)
    return lines[1:]


def page(rows: list[Row], planned: int) -> str:
    size = [e["size"]["value"] / row["amplitude"] for row in rows if row["kind"] == "hidden"
            for e in row["effects"] if e["id"] == row["name"]]  # fmt: skip
    show = np.median([row["could_show_K"] for row in rows if row["kind"] == "clean"] or [np.nan])
    lines = [
        "# Effects that the machines of a fleet share",
        "",
        f"`{COMMAND}`, seeds from {FIRST_SEED}, {len(rows)} of {planned} fleets; "
        "rates with their 95 % limits.",
        "Two tests of one hour a machine, noise of 0.6 to 1.0 K over 50 to 120 s, readings to",
        "0.5 K, parameters 4 % and the effect 20 % apart from machine to machine; the errors of",
        "the bench are drawn once for a fleet. A machine alone shows something at the same level",
        "in 5 % by chance.",
        "",
        *table(rows),
        "",
        f"{NUM} machines together would show half of the catalogue from {show:.3f} K on.",
    ]
    if size:
        lines.append(
            f"Found sizes over hidden ones (other laws than the catalogue's): {np.min(size):.2f} "
            f"to {np.max(size):.2f}, median {np.median(size):.2f}."
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    counts = {"clean": 120, "hidden": 6, "large": 2, "off": 6, "unknown": 3}
    parser = options_of(__doc__, "fleet", FIRST_SEED, **counts)
    parser.set_defaults(processes=0)
    options = parser.parse_args()
    configure()
    listed = cases(*(getattr(options, name) for name in counts))

    def said(row: Row) -> str:
        effects = [effect["id"] for effect in row["effects"]]
        return f"{row['kind']} {row['name']} {row['num']} {row['verdict']} {effects}"

    shown = partial(page, planned=len(listed))
    files = "discovery.json", "discovery.md"
    run_study(options, listed, run, shown, files=files, command=COMMAND, said=said)


if __name__ == "__main__":
    main()
