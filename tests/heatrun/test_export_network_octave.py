"""GNU Octave integrates network.mat as lptn does: each effect alone, several, four nodes."""

import re
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
from octave import needs_octave, octave
from run_near_truth import TRUTH

from heatrun.export import mat_bytes, network_variables, simulate_network
from heatrun.model.model import Model
from heatrun.model.network_text import read_network
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from lptn import EFFECTS

SCRIPT = files("heatrun.export") / "templates" / "run_network.m"
pytestmark = needs_octave

MOTOR = Motor("bench", phase_resistance_ohm=0.0062)
MAP = replace(MOTOR, losses="map")
VALUES = TRUTH | {
    "Ceq": 12500.0, "Req": 0.132, "Tw_start": 60.4, "Tsr_start": 55.8,
    "sensor_gain": 0.01, "sensor_offset": -0.3,
}  # fmt: skip
FOUR_NODES = b"""
[network]
name = "four"
nodes = ["winding", "tooth", "yoke", "rotor"]
sinks = ["coolant"]
links = [["winding", "tooth"], ["tooth", "yoke"], ["tooth", "rotor"], ["yoke", "coolant"]]
losses = { copper = "winding", iron = ["tooth", "yoke"], mechanical = "rotor" }
sensors = { winding_degC = "winding" }
"""
TURNING = FOUR_NODES.replace(b"coolant", b"ambient").replace(
    b"sensors", b'by_speed = ["mechanical"]\nsensors'
)
FRICTION = (("P_mechanical_n", 30.0), ("P_mechanical_n2", 5.0))
BASES = {
    "first": "first",
    "second": "second",
    "cooled": "cooled",
    "four": read_network(FOUR_NODES, "four.toml"),
    "turning": read_network(TURNING, "turning.toml"),
    "four in air": read_network(FOUR_NODES.replace(b"coolant", b"ambient"), "four.toml"),
}
KINDS = {kind.card.id: kind for kind in EFFECTS}
CLOSE_K = 1e-3


def record(step=1.5, num=401):
    t = step * np.arange(num)
    runs, turns = (t // 60) % 2 == 0, np.clip(t / 20 - 3, 0, 1)
    return Record(
        "short",
        {
            "time_s": t,
            "phase_current_A": np.where(runs, 120.0, 40.0),
            "losses_W": np.where(runs, 1000.0, 100.0),
            "ambient_degC": 22.0 + 0.002 * t,
            "coolant_degC": 25.0 + 10.0 * np.clip((t - 200.0) / 20.0, 0, 1),
            "speed_rpm": 3000.0 * (1.0 + 1.4 * np.sign(np.sin(t / 70.0))) * turns,
            "fan": np.where((t > 100.0) & (t < 400.0), 1.0, 0.2),
            "winding_degC": np.where(t % 7.0 < 1.0, np.nan, 60.0 + 0.03 * t),
        },
    )


def uneven():
    """The same with a sample in 12 s and some of them missing."""
    found = record(12.0, 51)
    kept = np.delete(np.arange(51), [10, 11, 12, 33])
    return Record("uneven", {name: v[kept] for name, v in found.channels.items()})


SHORT = record()


@dataclass(frozen=True)
class Case:
    base: str = "second"  # Key of `BASES`.
    effects: tuple[str, ...] = ()  # Ids, in order.
    motor: Motor = MOTOR  # Says what the losses mean, and the sink.
    record: Record = SHORT  # What drives it.
    values: tuple[tuple[str, float], ...] = ()  # What differs from the typical values.

    def variables(self):
        model = Model.of(BASES[self.base], self.motor, tuple(KINDS[id] for id in self.effects))
        values = {p.name: p.centre for p in model.form.parameters}
        values |= {name: 50.0 - 2.0 * i for i, (_, name) in enumerate(model.form.starts)}
        values |= {"cooling_step.t_star": 300.0, **VALUES}
        for kind in model.effects:
            for name, quantity in kind.card.parameters.items():
                values.setdefault(f"{kind.card.id}.{name}", quantity.typical)
        values |= dict(self.values)
        return network_variables(
            self.record, values, self.motor, model, rated_speed=600.0, rated_current=120.0
        )[0]


def alone(kind):
    return Case("first" if getattr(kind, "rebuilds", False) else "second", (kind.card.id,))


TOGETHER = {
    "none": Case(),
    "none, one node": Case("first"),
    "one node": Case("first", ("speed_cooling", "rotor_node", "radiation", "sensor_contact")),
    "order of the sink": Case(
        effects=("radiation", "coolant_sink", "natural_convection", "bearing_friction")
    ),
    "order of the sensor": Case(
        effects=("end_winding_node", "time_shift", "sensor_gain", "sensor_contact", "sensor_lag")
    ),
    "three nodes more": Case(effects=("rotor_node", "housing_node", "neighbour_body")),
    "uneven": Case(effects=("speed_cooling", "sensor_lag"), record=uneven()),
    "fast sensor": Case(effects=("sensor_lag",), values=(("sensor_lag.tau", 1.0),)),
    "two sinks": Case("cooled", ("speed_cooling", "natural_convection", "radiation")),
    "two sinks, rises above the coolant": Case("cooled", motor=replace(MOTOR, sink="coolant")),
    "four nodes": Case("four", motor=replace(MOTOR, sink="coolant")),
    "losses by speed": Case(
        "turning", ("external_loss", "ac_copper_loss", "standby_loss"), values=FRICTION
    ),
    "losses by speed, map": Case("turning", ("external_loss",), MAP, values=FRICTION),
    "four nodes with effects": Case("four in air", ("speed_cooling", "sensor_lag", "radiation")),
}
OF_A_MAP = ("ac_copper_loss", "stray_load_loss", "loss_gain", "copper_coefficient",
            "winding_resistance", "external_loss")  # fmt: skip
"""Effects that act otherwise where the losses come from a map."""

CASES = (
    {kind.card.id: alone(kind) for kind in EFFECTS}
    | {f"{id}, map": Case(effects=(id,), motor=MAP) for id in OF_A_MAP}
    | {"none, map": Case(motor=MAP)}
    | TOGETHER
)
if "winding_node" in KINDS:
    CASES |= {"winding held": Case("first", ("winding_node",), values=(("winding_node.x", 0.02),))}
PRINTED = r"^(.+): RMSE of the reading to Tw_m: ([0-9.]+) K over (\d+) readings$"


ALONE = [
    pytest.param(id, marks=() if place % 3 == 0 else pytest.mark.slow)
    for place, id in enumerate(KINDS)
]
"""One effect in three by `make test`, the others by `make test-slow`."""


@pytest.fixture(scope="module")
def course(request):
    """What lptn makes of each file that is asked for."""
    asked = {item.callspec.params["name"] for item in request.session.items
             if item.path == request.path}  # fmt: skip
    contents = {name: mat_bytes(case.variables()) for name, case in CASES.items()
                if name in asked | {"none", "none, one node"}}  # fmt: skip
    return {name: (content, simulate_network(content)) for name, content in contents.items()}


@pytest.fixture(scope="module")
def integrated(course, tmp_path_factory):
    """Table and printed RMSE of every case, from one process of Octave."""
    root = tmp_path_factory.mktemp("octave")
    folders = {}
    for number, (name, (content, _)) in enumerate(course.items()):
        folders[name] = root / f"case_{number}"
        folders[name].mkdir()
        (folders[name] / "network.mat").write_bytes(content)
        (folders[name] / "run_network.m").write_bytes(SCRIPT.read_bytes())
    lines = ["1;", "function one(name, file)", "  printf('%s: ', name); source(file);", "end"]
    lines += [f"one('{name}', '{folder / 'run_network.m'}');" for name, folder in folders.items()]
    (root / "all.m").write_text("\n".join(lines))
    said = octave(root / "all.m", root, timeout=300)
    printed = re.findall(PRINTED, said, flags=re.MULTILINE)
    assert [name for name, _, _ in printed] == list(folders), said
    tables = {name: pd.read_csv(folder / "network_course.csv") for name, folder in folders.items()}
    return {name: (tables[name], float(rmse), int(num)) for name, rmse, num in printed}


@pytest.mark.parametrize("name", [*ALONE, *(name for name in CASES if name not in KINDS)])
def test_octave_and_lptn_agree(name, course, integrated):
    found = course[name][1]
    table, rmse, num_read = integrated[name]
    expected = {f"{node}_degC": T for node, T in found.temperature.items()}
    expected |= {"time_s": found.time, "reading_degC": found.reading}
    assert set(table) == set(expected)
    for column, values in expected.items():
        np.testing.assert_allclose(table[column], values, rtol=0, atol=CLOSE_K, err_msg=column)
    is_read = np.isfinite(found.measured)
    assert num_read == np.sum(is_read)
    error = (found.reading - found.measured)[is_read]
    # the script prints four decimals
    assert rmse == pytest.approx(np.sqrt(np.mean(error**2)), abs=CLOSE_K + 1e-4)


@pytest.mark.parametrize("name", ALONE)
def test_each_effect_is_seen_far_beyond_the_agreement(name, integrated):
    """Else a script that left it out would agree as well."""
    base = "none, one node" if getattr(KINDS[name], "rebuilds", False) else "none"
    with_it, without = integrated[name][0], integrated[base][0]
    assert np.max(np.abs(with_it["reading_degC"] - without["reading_degC"])) > 20 * CLOSE_K
