"""What stands above a table or beside it: the resistance that `heatrun init` offers to confirm."""

from __future__ import annotations

import tomllib

import pytest
import scipy.io
from drafted import CURRENT, LOSSES, ROOM, TIME_S, WINDING, named, text_of

from heatrun.init.gaps import gaps
from heatrun.init.survey import survey

BASE = {
    "time_s": TIME_S,
    "losses_W": LOSSES,
    "ambient_degC": ROOM,
    "winding_degC": WINDING,
    "phase_current_A": CURRENT,
}


def winding(text: str) -> dict[str, float]:
    """Return what [winding] would say if its drafted lines were confirmed."""
    part = text.split("\n[winding]\n")[1].split("\n\n")[0]
    keys = ("phase_resistance_ohm", "reference_temperature_degC")
    lines = [line.removeprefix("# ") for line in part.split("\n") if " = " in line]
    said = [line for line in lines if line.startswith(keys) and "  # from" in line]
    return tomllib.loads("\n".join(said))


WORKSHEET = (
    "DATI PER LA STIMA DEI PARAMETRI TERMICI\n"
    "Tamb med: 19,3577 °C Ceq, w: 666,75 J/K\n"
    "Ro rif: 1 ohm Rs: 0,0062 ohm Ceq, sr: 15060,1 J/K\n"
    "To rif: 20 °C Ts: 25 °C Req, w: 0,14485 K/W\n"
    "B: 234,5 °C Req, sr: 0,11625 K/W\n\n"
)


def test_the_head_of_the_worksheet_gives_the_phase_resistance(tmp_path):
    path = named(tmp_path, BASE, head=WORKSHEET)
    text = text_of(path)
    assert winding(text) == {"phase_resistance_ohm": 0.0062, "reference_temperature_degC": 25.0}
    # a proposal: nothing is set
    assert "\nphase_resistance_ohm" not in text
    assert "put in the number, such as 0.0062" not in text
    (gap,) = gaps([survey(path)])
    assert "0.0062 Ω" in gap.sentence


@pytest.mark.parametrize(
    ("line", "ohm", "degC"),
    [
        ("Rs: 0.0062 ohm", 0.0062, None),
        ("Rs;0,0062;ohm", 0.0062, None),
        ("Rs [mOhm];6,2", 0.0062, None),
        ("Phasenwiderstand R20 = 6,2 mΩ", 0.0062, 20.0),
        ("Phase resistance (25 °C): 0.0062 Ω", 0.0062, 25.0),
        ("R_ph = 6.2e-3 Ohm @ 22.5 °C", 0.0062, 22.5),
        ("# Stator resistance: 6.2 mohm at 25 degC", 0.0062, 25.0),
        ("Resistenza di fase: 0,0062 ohm a 20 °C", 0.0062, 20.0),
        ("Strangwiderstand bei 20 °C: 0,0062 Ohm", 0.0062, 20.0),
    ],
)
def test_forms_of_a_stated_resistance(tmp_path, line, ohm, degC):
    said = winding(text_of(named(tmp_path, BASE, head=f"Title\n{line}\n\n")))
    assert said.pop("phase_resistance_ohm") == pytest.approx(ohm, rel=1e-12)
    assert said == ({} if degC is None else {"reference_temperature_degC": degC})


@pytest.mark.parametrize(
    "line",
    [
        "Ro rif: 1 ohm",
        "R_UV = 0.0124 ohm",
        "Phase resistance line-to-line: 0.0124 ohm",
        "Klemmenwiderstand 12,4 mOhm",
        "Isolation: 500 MOhm",
        "Rs232: 9600",
        "Rs: 0 ohm",
        "Shunt Rs1 0.001",
        "Insulation resistance Rs: 500 MOhm",
    ],
)
def test_other_resistances_are_not_offered(tmp_path, line):
    text = text_of(named(tmp_path, BASE, head=f"Title\n{line}\n\n"))
    assert winding(text) == {}
    assert "# phase_resistance_ohm =    # put in the number" in text


def test_two_values_are_both_offered(tmp_path):
    text = text_of(named(tmp_path, BASE, head="Rs: 0.0062 ohm\nR_ph: 0.0071 ohm\n\n"))
    assert text.count("# phase_resistance_ohm = 0.00") == 2


def test_a_scalar_of_a_mat_file_is_offered(tmp_path):
    path = tmp_path / "test.mat"
    scipy.io.savemat(path, {**BASE, "Rs": 0.0062, "Tref": 25.0})
    said = winding(text_of(path))
    assert said == {"phase_resistance_ohm": 0.0062, "reference_temperature_degC": 25.0}
