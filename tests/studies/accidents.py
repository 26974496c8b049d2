"""Study of accidents on the bench: what is caught and named, and what clean records are told.

`make study-accidents` writes `results/accidents/`: machines and loads of `ordinary_machines`, each
record written as a file and read as `heatrun check` reads it. Beside its columns a record here has
a current for each phase and the housing, some the resistance between two terminals; some loggers
round to 1 °C, some record the inrush of a start. Thresholds were set on seeds below 12000. A first
look: `accidents.py --seed 1000 --clean 12 --each 2 --out FOLDER`; one cut short goes on.
"""

import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from gate_rows import limits_95
from ordinary_machines import COIL, KINDS, PER_KELVIN, Columns, make
from study_runs import Row, options_of, run_study

from heatrun.checks import check_record
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_tests

REPORTING_SEED = 12000
MOST_FALSE = 0.02
"""Share of clean records that may be accused [1]."""


PHASES = ("amps1", "amps2", "amps3")
HEADINGS = {
    "time": "t [s]", "amps1": "I1 [A]", "amps2": "I2 [A]", "amps3": "I3 [A]", "watts": "P [W]",
    "losses": "Pv [W]", "rpm": "n [rpm]", "torque": "M [Nm]", "winding": "Tw [degC]",
    "housing": "Th [degC]", "sink": "T0 [degC]",
    "ohms": "R [Ohm]",
}  # fmt: skip
CHANNELS = {
    "time": "time_s", "watts": "electrical_power_W", "losses": "losses_W", "rpm": "speed_rpm",
    "torque": "torque_Nm", "winding": "winding_degC", "housing": "housing_degC",
    "ohms": "winding_resistance_ohm",
}  # fmt: skip
MARKERS = (65535.0, 32767.0, 6553.5, 3276.7, 655.35, 4095.0)

Damage = Callable[["Bench"], float | None]


class Bench:
    """A record as it is written, and the figures of its motor file; damage changes them.

    Attributes:
        columns: What the logger writes, by name.
        motor: `[motor]` and `[winding]` in numbers.
        material: The line of `[winding]` that states B; none for copper.
        ohms: Between two terminals [ohm]; a column of some records.
        rng: Random numbers of the case.
        loaded: Places under load, not near a load step nor to the ends.
    """

    def __init__(self, kind: str, seed: int) -> None:
        case = make(kind, seed)
        self.rng = rng = np.random.default_rng((seed, 41))
        name = str(rng.choice(list(case.tests)))
        read, course = case.tests[name], case.courses[name]
        self.machine, self.test = case.machine, name
        at = np.searchsorted(course["time"], read["time"])
        stator = course["stator"][np.minimum(at, course["stator"].size - 1)]
        columns: Columns = dict(read)
        if "torque" in columns:  # an offset is an accident here
            columns["torque"] = columns["torque"] - case.machine.physics["offset_Nm"]
        amps = columns.pop("amps")
        starts = np.flatnonzero((amps[1:] > 0.1 * amps.max()) & (amps[:-1] < 0.02 * amps.max())) + 1
        if case.machine.kind.startswith("enclosed") and rng.random() < 0.5:
            amps[starts] *= rng.uniform(3.0, 6.0)  # switched on to the mains
        for phase in PHASES:
            noise = 1.0 + 1e-3 * rng.standard_normal(amps.size)
            columns[phase] = np.round(amps * rng.uniform(0.993, 1.007) * noise, 4)
        housing = read["sink"] + rng.uniform(0.75, 0.95) * (stator - read["sink"])
        columns["housing"] = np.round(housing + rng.normal(0.0, 0.3), 1)
        if rng.random() < 0.25:
            columns["winding"] = np.rint(columns["winding"])
        self.columns = columns
        self.material = ""
        self.motor = {"ohm": case.machine.physics["ohm"] * (1.0 + case.bench["ohm"])}
        load = amps > 0.5 * np.quantile(amps, 0.95)
        step = max(1, int(30.0 / (read["time"][1] - read["time"][0])))
        calm = np.convolve(np.abs(np.diff(1.0 * load, prepend=0.0)), np.ones(2 * step + 1), "same")
        inside = np.arange(load.size) / load.size
        warm = columns["winding"] - columns["sink"] > 10.0
        self.loaded = np.flatnonzero(load & (calm < 0.5) & warm & (inside > 0.15) & (inside < 0.85))
        if case.machine.is_coil:
            columns["losses"] = columns.pop("watts")
        mean = course["winding"][np.minimum(at, course["winding"].size - 1)]
        ohms = 2.0 * self.motor["ohm"] * (1.0 + PER_KELVIN * (mean - 20.0))
        self.ohms = ohms * (1.0 + 1e-3 * rng.standard_normal(ohms.size))
        if rng.random() < 0.25:
            columns["ohms"] = self.ohms

    @property
    def time(self) -> np.ndarray:
        return self.columns["time"]

    def moment(self) -> int:
        """Return a place under load."""
        if self.loaded.size:
            return int(self.rng.choice(self.loaded))
        rise = self.columns["winding"] - self.columns["sink"]
        return int(np.argmax(rise))  # of short loads, the end of the hottest

    def after(self, place: int, seconds: float) -> int:
        return int(min(np.searchsorted(self.time, self.time[place] + seconds), self.time.size - 1))

    def write(self, folder: Path) -> Path:
        path = folder / "test.csv"
        table = pd.DataFrame(self.columns).rename(columns=HEADINGS)
        table.to_csv(path, index=False, float_format="%.9g")
        sink = "coolant" if "jacket" in self.machine.kind else "ambient"
        lines = [
            f'[motor]\nname = "M"\nphases = {self.machine.phases}\nsink = "{sink}"',
            f"[winding]\nphase_resistance_ohm = {self.motor['ohm']:.5g}",
            f"reference_temperature_degC = 20.0\n{self.material}\n[columns]",
            f'{sink}_degC = "T0"\nphase_current_A = "mean(I1, I2, I3)"',
        ]
        for name, heading in HEADINGS.items():
            if name in self.columns and name in CHANNELS:
                lines.append(f'{CHANNELS[name]} = "{heading.split(" [")[0]}"')
        (folder / "motor.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path


def falls_off(bench: Bench) -> float:
    place, tau = bench.moment(), float(bench.rng.uniform(3.0, 60.0))
    winding, sink = bench.columns["winding"], bench.columns["sink"]
    later = bench.time[place:] - bench.time[place]
    fallen = sink[place:] + (winding[place] - sink[place:]) * np.exp(-later / tau)
    winding[place:] = np.round(fallen, 1)
    return float(bench.time[place])


def off_and_on(bench: Bench) -> float:
    before = bench.columns["winding"].copy()
    at = falls_off(bench)
    place = int(np.searchsorted(bench.time, at))
    back = bench.after(place, 600.0)
    bench.columns["winding"][back:] = before[back:]
    return at


def slides_off(bench: Bench) -> float:
    """A sensor that comes loose over ten minutes and then half shows the air."""
    place = bench.moment()
    share = np.clip((bench.time - bench.time[place]) / 600.0, 0.0, 1.0) * 0.85
    rise = bench.columns["winding"] - bench.columns["sink"]
    bench.columns["winding"] = np.round(bench.columns["winding"] - share * rise, 1)
    return float(bench.time[place])


def shifts(bench: Bench) -> float:
    place = bench.moment()
    by = float(bench.rng.uniform(5.0, 15.0) * bench.rng.choice([-1.0, 1.0]))
    bench.columns["winding"][place:] += by
    return float(bench.time[place])


def sticks(bench: Bench) -> float:
    place = bench.moment()
    # a plateau hides it: from a load step on
    end = bench.after(place, 1200.0)
    bench.columns["winding"][place:end] = bench.columns["winding"][place]
    return float(bench.time[place])


def opens(bench: Bench) -> float:
    place = bench.moment()
    code = float(bench.rng.choice([850.0, 1372.0, -200.0, 3276.7, -99.9, 6553.5, 2047.0]))
    bench.columns["winding"][place : place + int(bench.rng.integers(1, 40))] = code
    return float(bench.time[place])


def _phase(factor: float) -> Damage:
    def damage(bench: Bench) -> None:
        name = str(bench.rng.choice(PHASES))
        bench.columns[name] = np.round(bench.columns[name] * factor, 4)
        if factor == 0.0:
            bench.columns[name] += 0.002

    return damage


def _marker(names: tuple[str, ...]) -> Damage:
    def damage(bench: Bench) -> float:
        name = str(bench.rng.choice(names))
        largest = float(np.max(np.abs(bench.columns[name])))
        value = float(bench.rng.choice([m for m in MARKERS if m > 4.0 * largest] or [2.0**31 - 1]))
        place = bench.moment()
        count = int(bench.rng.integers(1, 4))
        for each in PHASES if name in PHASES else (name,):
            bench.columns[each][place : place + count] = value
        return float(bench.time[place])

    return damage


def overrange(bench: Bench) -> float:
    place, name = bench.moment(), str(bench.rng.choice(["watts", "amps2"]))
    bench.columns[name][place : place + int(bench.rng.integers(1, 30))] = 9.9e37
    return float(bench.time[place])


def bursts(bench: Bench) -> float:
    place = bench.moment()
    bench.columns["watts"][place : place + 2] *= float(bench.rng.uniform(15.0, 60.0))
    return float(bench.time[place])


def input_power(bench: Bench) -> None:
    bench.columns["losses"] = bench.columns.pop("watts")


def output_power(bench: Bench) -> None:
    shaft = bench.columns["torque"] * bench.columns["rpm"] * np.pi / 30.0
    bench.columns["losses"] = np.round(shaft, 2)
    del bench.columns["watts"]


def torque_zero(bench: Bench) -> None:
    by = float(bench.rng.uniform(0.02, 0.06) * bench.rng.choice([-1.0, 1.0]))
    bench.columns["torque"] = bench.columns["torque"] + by * bench.machine.rated["Nm"]


def power_zero(bench: Bench) -> None:
    losses = bench.columns["watts"] - bench.columns["torque"] * bench.columns["rpm"] * np.pi / 30.0
    bench.columns["watts"] = bench.columns["watts"] + 0.12 * float(np.quantile(losses, 0.9))


def between_lines(bench: Bench) -> None:
    bench.motor["ohm"] *= 2.0


def wrong_material(bench: Bench) -> None:
    bench.columns["ohms"] = bench.ohms
    B = 234.5 + bench.rng.choice([-1.0, 1.0]) * bench.rng.uniform(70.0, 120.0)
    bench.material = f"resistance_coefficient_degC = {B:.0f}"


def peaks(bench: Bench) -> None:
    for name in PHASES:
        bench.columns[name] = np.round(np.sqrt(2.0) * bench.columns[name], 4)


def kilowatts(bench: Bench) -> None:
    bench.columns["watts"] = bench.columns["watts"] / 1e3


def bad_day(bench: Bench) -> float:
    """Kilowatts under a heading of watts, the sensor falls off, the clock is set back."""
    kilowatts(bench)
    at = falls_off(bench)
    place = bench.after(int(np.searchsorted(bench.time, at)), 900.0)
    bench.columns["time"][place:] -= 3600.0 if bench.time[place] > 3600.0 else 600.0
    return at


def load_is_late(bench: Bench) -> None:
    """The clock of the load is 12 s to 3 min behind that of the temperatures."""
    step_s = float(bench.time[1] - bench.time[0])
    num = max(3, round(float(bench.rng.uniform(12.0, 180.0)) / step_s))
    for name in {*PHASES, "watts", "losses", "rpm", "torque", "ohms"} & set(bench.columns):
        values = bench.columns[name]
        bench.columns[name] = np.concatenate([np.repeat(values[0], num), values[:-num]])


def power_is_lost(bench: Bench) -> float:
    """The power reads nothing for one to ten minutes under load."""
    place = bench.moment()
    end = bench.after(place, float(bench.rng.uniform(60.0, 600.0)))
    bench.columns["watts"][place:end] = 0.0
    return float(bench.time[place])


def sink_opens(bench: Bench) -> float:
    place = bench.moment()
    end = bench.after(place, float(bench.rng.uniform(10.0, 600.0)))
    bench.columns["sink"][place:end] = float(bench.rng.choice([850.0, 1372.0, -200.0]))
    return float(bench.time[place])


def contact_is_loose(bench: Bench) -> float:
    """The winding's sensor reads nothing, or its fault code, for a sample here and there."""
    inside = np.arange(bench.time.size // 20, bench.time.size)
    places = np.sort(bench.rng.choice(inside, int(bench.rng.integers(8, 25)), replace=False))
    code = float(bench.rng.choice([0.0, 850.0, -200.0]))
    bench.columns["winding"][places] = code
    return float(bench.time[places[0]])


def picks_up(bench: Bench) -> None:
    """The sensor's line reads the current too."""
    amps = bench.columns["amps1"]
    bench.columns["winding"] += (
        bench.rng.choice([-1.0, 1.0]) * bench.rng.uniform(12.0, 18.0) * (amps / amps.max())
    )


def shifts_with_load(bench: Bench) -> float:
    """The sensor moves as the load steps."""
    load = bench.columns["amps1"] > 0.5 * np.quantile(bench.columns["amps1"], 0.95)
    steps = np.flatnonzero(np.diff(1.0 * load) != 0.0) + 1
    inside = steps[(steps > 0.15 * load.size) & (steps < 0.85 * load.size)]
    place = int(bench.rng.choice(inside)) if inside.size else bench.moment()
    bench.columns["winding"][place:] += float(bench.rng.choice([-1, 1]) * bench.rng.uniform(6, 12))
    return float(bench.time[place])


def halves_current(bench: Bench) -> None:
    for name in PHASES:
        bench.columns[name] = np.round(0.5 * bench.columns[name], 4)


def two_phases(bench: Bench) -> None:
    bench.columns["watts"] = np.round(2.0 / 3.0 * bench.columns["watts"], 2)


def no_torque(bench: Bench) -> None:
    bench.columns["torque"] = 0.0 * bench.columns["torque"]


def exchanges_room(bench: Bench) -> None:
    bench.columns |= {"housing": bench.columns["sink"], "sink": bench.columns["housing"]}


def exchanges_wires(bench: Bench) -> None:
    bench.columns["winding"] = 2.0 * bench.columns["sink"] - bench.columns["winding"]


class Accident(NamedTuple):
    """What happens, and the findings that name it, all of them needed; `told` are words in one."""

    damage: Damage
    ids: tuple[str, ...]
    told: str = ""
    on_coil: bool = False


SLOWLY = "comes loose slowly"
WITHIN_S = 120.0
"""A moment is named rightly within this time; one that comes over ten minutes within those [s]."""

OFF = "sensor_detached|temperature_jump"
ACCIDENTS: dict[str, Accident] = {
    "sensor falls off": Accident(falls_off, ("sensor_detached",), "mask|use =", True),
    "falls off, put back": Accident(off_and_on, (OFF,), "mask", True),
    SLOWLY: Accident(slides_off, (OFF,), "mask|use ="),
    "jumps by 5 … 15 K": Accident(shifts, (OFF,), "use =|mask", True),
    "shifts with a load step": Accident(shifts_with_load, (OFF,), "use =|mask", True),
    "its line picks up the current": Accident(picks_up, ("sensor_pickup",), "sensor_pickup", True),
    "sticks": Accident(sticks, ("sensor_stuck",), "mask", True),
    "opens": Accident(opens, (OFF,), "mask", True),
    "a phase reads nothing": Accident(_phase(0.0), ("sensors_differ",), "'I"),
    "a phase reads half": Accident(_phase(0.5), ("sensors_differ",), "'I"),
    "a phase has the other sign": Accident(_phase(-1.0), ("sensors_differ",), "'I"),
    "marker in the current": Accident(_marker(PHASES), ("load_spike",), "bridge"),
    "marker in the power": Accident(_marker(("watts",)), ("load_spike",), "bridge"),
    "marker in torque or speed": Accident(_marker(("torque", "rpm")), ("load_spike",), "bridge"),
    "overrange 9.9E+37": Accident(overrange, ("nan_block",), "overrange"),
    "burst of the power": Accident(bursts, ("load_spike",), "bridge"),
    "input power as losses": Accident(input_power, ("losses_of_shaft",), "electrical_power_W"),
    "shaft power as losses": Accident(output_power, ("losses_of_shaft",)),
    "zero of the torque": Accident(torque_zero, ("shaft_power_disagrees",), "torque_offset"),
    "zero of the power": Accident(power_zero, ("shaft_power_disagrees",), "shaft_power_offset"),
    "resistance between lines": Accident(
        between_lines, ("losses_below_copper|current_amplitude|unit_suspected",), "terminals"
    ),
    "B of no winding": Accident(wrong_material, ("resistance_coefficient",), "material", True),
    "peak in place of rms": Accident(
        peaks, ("losses_below_copper|current_amplitude|unit_suspected",), "peak|amplitude"
    ),
    "kW under W": Accident(kilowatts, ("unit_suspected",), "kW"),
    "bad day: three at once": Accident(
        bad_day, ("unit_suspected", "sensor_detached", "time_backwards")
    ),
    "load recorded late": Accident(load_is_late, ("load_late",), "load_offset", True),
    "power reads nothing": Accident(power_is_lost, ("load_stuck",), "bridge|use ="),
    "sink's sensor opens": Accident(sink_opens, ("sensor_detached",), "under [constants]", True),
    "loose contact": Accident(contact_is_loose, (OFF,), "mask", True),
    "current reads half": Accident(
        halves_current, ("unit_suspected|standstill_losses|losses_of_shaft",), "half|low|current"
    ),
    "power of two phases": Accident(two_phases, ("unit_suspected",), "two phases"),
    "torque reads nothing": Accident(no_torque, ("load_stuck",), "torque_Nm"),
    "housing and sink exchanged": Accident(
        exchanges_room, ("ambient_implausible",), "exchanged", True
    ),
    "wires of the sensor exchanged": Accident(
        exchanges_wires, ("ambient_implausible",), "wires", True
    ),
}
"""By name. An accident of the shaft or of three phases cannot happen to a coil."""

USUAL = {
    "ambient_moving", "start_not_in_equilibrium", "sampling", "single_step", "too_short",
    "cut_while_warm", "saturation", "truncation", "resolution",
}  # fmt: skip
"""Warnings about a test, not about an accident."""


def run(job: Row, folder: Path) -> Row:
    """Return the row of a case: its findings as id, severity, text and moment."""
    kinds = list(KINDS)
    accident = ACCIDENTS.get(job["accident"])
    if accident is not None and not accident.on_coil:
        kinds.remove(COIL)
    bench = Bench(kinds[job["seed"] % len(kinds)], job["seed"])
    at = accident.damage(bench) if accident is not None else None
    path = bench.write(folder)
    motor = load_motor(folder / "motor.toml")
    findings = [f for record in read_tests(path, motor) for f in check_record(record, motor)]
    return job | {
        "kind": bench.machine.kind, "test": bench.test, "at_s": at,
        "findings": [
            [f.id, f.severity, f.sentence().replace(f"{folder}/", ""), f.values.get("from_s")]
            for f in findings if f.severity != "note"
        ],
    }  # fmt: skip


def doubts(row: Row) -> list[str]:
    """Return the ids of the findings that are no matter of the test's course."""
    return [id for id, severity, *_ in row["findings"] if severity == "error" or id not in USUAL]


def is_caught(row: Row) -> bool:
    return bool(doubts(row))


def is_named(row: Row) -> bool:
    """Return whether the accident was named, with the line or the column, where it was."""
    accident = ACCIDENTS[row["accident"]]
    for ids in accident.ids:
        named = [f for f in row["findings"] if f[0] in ids.split("|")]
        told = [f for f in named if any(word in f[2] for word in accident.told.split("|"))]
        if row["at_s"] is not None and len(accident.ids) == 1:
            within = 600.0 if row["accident"] == SLOWLY else WITHIN_S
            told = [f for f in told if f[3] is None or abs(f[3] - row["at_s"]) <= within]
        if not told:
            return False
    return True


def num_beside(row: Row) -> int:
    """Return how many findings stand beside those that name the accident."""
    return max(0, len(doubts(row)) - len(ACCIDENTS[row["accident"]].ids))


def table(rows: Sequence[Row], seed: int) -> str:
    clean = [row for row in rows if not row["accident"]]
    accused = [row for row in clean if doubts(row)]
    low, high = limits_95(len(accused), max(len(clean), 1))
    ids = Counter(id for row in accused for id in set(doubts(row)))
    of = ", ".join(f"{id} ({count})" for id, count in ids.most_common()) or "none"
    lines = [
        "# Accidents on the bench\n",
        f"`make study-accidents` (accidents.py), seeds from {seed} on; versions stand in "
        "`study.json`. Six kinds of machines under three kinds of load with independent noise, "
        "rounding and two to four imperfections each; "
        "currents of three phases, some records rounded to 1 °C, some with the inrush of a start. "
        "*Named*: the finding that belongs to it, with the column or the line of the motor file, "
        "at its moment within 120 s (600 s where it comes over ten minutes). *Beside*: records "
        "with a finding beside it that is none of the test's course.\n",
        f"**Clean records:** {len(accused)} of {len(clean)} accused "
        f"({100.0 * len(accused) / max(len(clean), 1):.1f} %, 95 % limits {100.0 * low:.1f} to "
        f"{100.0 * high:.1f} %; at most {100.0 * MOST_FALSE:.0f} % are allowed): {of}.\n",
        "| accident | records | caught | named rightly | with a finding beside |",
        "|---|---:|---:|---:|---:|",
    ]
    of_each = {name: [row for row in rows if row["accident"] == name] for name in ACCIDENTS}
    of_each["**all**"] = [row for row in rows if row["accident"]]
    for name, struck in of_each.items():
        beside = sum(num_beside(row) > 0 for row in struck)
        counts = len(struck), sum(map(is_caught, struck)), sum(map(is_named, struck)), beside
        lines.append(f"| {name} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines) + "\n"


def struck(job: Row) -> Row:
    with tempfile.TemporaryDirectory() as folder:
        return run(job, Path(folder))


def main() -> None:
    options = options_of(__doc__, "accidents", REPORTING_SEED, clean=240, each=6).parse_args()
    names = [""] * options.clean + [name for name in ACCIDENTS for _ in range(options.each)]
    jobs = [{"accident": name, "seed": options.seed + n} for n, name in enumerate(names)]
    page = partial(table, seed=options.seed)
    print(page(run_study(options, jobs, struck, page, command="make study-accidents")))


if __name__ == "__main__":
    main()
