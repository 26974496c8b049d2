"""The tab “Switch-off”: readings that are typed, what comes of them, and what cannot be read."""

import json
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun_view.reading import Reader
from heatrun_view.store import Folder, RecordStore
from heatrun_view.tabs.switching_off import SwitchingOff, Typed, answer

pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")

MOTOR = """
[motor]
name = "reference motor"
insulation_class = "F"
[columns]
winding_degC = "PT100"
[winding]
resistance_coefficient_degC = 235
[constants]
ambient_degC = 22.0
"""

TIME_S = np.arange(20.0, 620.0, 20.0)
DEGC = 22.0 + 30.0 * np.exp(-TIME_S / 60.0) + 75.0 * np.exp(-TIME_S / 2400.0)
MILLIOHM = 12.4 * (235.0 + DEGC) / (235.0 + 25.0)
LINES = "\n".join(f"{t:g} {r:.4f}" for t, r in zip(TIME_S, MILLIOHM, strict=True))
WINDING_DEGC = 22.0 + 30.0 + 75.0


def typed(readings: str = LINES, **other: str) -> Typed:
    said = {"head": "R [mOhm]", "cold": "12,4", "cold_at": "25", "sink": ""} | other
    return Typed(readings=readings, **said)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "motor.toml").write_text(MOTOR, encoding="utf-8")
    return tmp_path


@pytest.fixture
def tab(folder: Path) -> SwitchingOff:
    files, store = Folder(folder), RecordStore()
    shown = SwitchingOff(Reader(files.path, store, files.open), folder / "runs", lambda: None)
    shown._readings.value, shown._cold.value, shown._cold_at.value = LINES, "12.4", "25"
    return shown


def test_the_winding_at_switch_off_follows_from_what_is_typed(folder):
    found = answer(typed(), load_motor(folder / "motor.toml"), None)
    low, high = found.winding_95_degC
    assert low < WINDING_DEGC < high
    assert high - low < 12.0
    assert found.sink_degC == 22.0
    colder = answer(typed(sink="18"), load_motor(folder / "motor.toml"), None)
    assert colder.sink_degC == 18.0


@pytest.mark.parametrize(
    "readings",
    [
        LINES.replace(" ", "\t"),
        LINES.replace(" ", ","),
        LINES.replace(".", ",").replace(" ", "; "),
        "\n".join(f"{int(t) // 60}:{int(t) % 60:02d} {r:.4f}"
                  for t, r in zip(TIME_S, MILLIOHM, strict=True)),
    ],
)  # fmt: skip
def test_readings_may_be_typed_as_people_write_them(readings):
    assert typed(readings).table() == typed().table()


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"readings": "20 16.4\n40"}, "readings, line 2"),
        ({"readings": "20 16.4\n40 a"}, "readings, line 2"),
        ({"readings": "40 16.4\n20 16.3\n60 16.2"}, "readings"),
        ({"readings": "20 16.4"}, "readings"),
        ({"cold": "?"}, "cold resistance"),
        ({"cold": "12400"}, "readings"),
    ],
)
def test_what_cannot_be_is_refused_where_it_stands(folder, change, where):
    with pytest.raises(InputError) as caught:
        answer(typed(**change), load_motor(folder / "motor.toml"), None)
    assert caught.value.where.startswith(where)
    assert "/tmp" not in str(caught.value)


def test_the_page_shows_the_answer_and_saves_it(tab, folder):
    tab.offer("motor.toml", None)
    assert "Winding at switch-off" in tab._said.object
    assert "Where the uncertainty comes from" in tab._said.object
    assert tab._figure.object.startswith(b"\x89PNG")
    tab._write()
    saved = json.loads((folder / "runs" / "switch_off" / "shutdown.json").read_text())
    assert saved["winding_degC"] == pytest.approx(WINDING_DEGC, abs=6.0)
    tab._readings.value = LINES.splitlines()[0]
    tab._ask()
    assert "at least 3 readings" in tab._said.object
    assert tab._save.disabled
    assert not tab._figure.visible


def test_the_page_asks_for_the_sink_of_the_machine_and_shows_what_its_file_says(tab, folder):
    tab.offer("motor.toml", None)
    fields = (tab._cold, tab._cold_at, tab._sink)
    assert tab._sink.name == "Ambient [°C]"
    assert [each.placeholder for each in fields] == ["", "25 (motor file)", "22 (motor file)"]
    winding = "[winding]\nmeasured_resistance_ohm = 0.0124\nreference_temperature_degC = 20\n"
    text = '[motor]\nname = "m"\nsink = "coolant"\n' + winding
    (folder / "liquid.toml").write_text(text, encoding="utf-8")
    tab.offer("liquid.toml", None)
    assert tab._sink.name == "Coolant [°C]"
    assert [each.placeholder for each in fields] == ["12.4 (motor file)", "20 (motor file)", ""]


def test_nothing_is_worked_out_without_a_machine(tab):
    tab.offer(None, None)
    assert "Choose a motor file" in tab._said.object
