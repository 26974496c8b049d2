"""Two runs of one machine against formulas: what changed, at which load, and what is not told."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import UNSET
from run_files import edit
from run_near_truth import TRUTH, run_near_truth

import heatrun
from heatrun import cli
from heatrun.record.motor import Motor, ShutDown
from heatrun.record.record import Record
from heatrun.runs.before_after import Estimate, _moved, _Side
from lptn.effects import EFFECTS

MOTOR = Motor("reference", phase_resistance_ohm=TRUTH["Rs0"], insulation_class="F")
B, TREF, SINK = 234.5, 25.0, 20.0
SPEED_COOLING = next(kind for kind in EFFECTS if kind.card.id == "speed_cooling")
FALL, SD = 0.18, 0.005
"""Of the winding's resistance, and of all draws [1]."""


def heated(amperes=110.0, watts=620.0, rpm=2000.0, ends=150.0):
    """An hour at one load, of which the tests have seen what `ends` says [degC]."""
    time_s = np.arange(0.0, 3600.0, 4.0)
    one, winding = np.ones(time_s.size), SINK + (ends - SINK) * -np.expm1(-time_s / 900.0)
    return Record("duty", {
        "time_s": time_s, "phase_current_A": amperes * one, "losses_W": watts * one,
        "ambient_degC": SINK * one, "winding_degC": winding,
        "speed_rpm": rpm * one,
    })  # fmt: skip


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    return run_near_truth(tmp_path_factory.mktemp("one") / "run", MOTOR, heated())


@pytest.fixture(scope="module")
def loose(tmp_path_factory):
    """The same machine at another load, after its winding was impregnated again."""
    folder = tmp_path_factory.mktemp("two") / "run"
    others = {"Req_w": (1.0 - FALL) * TRUTH["Req_w"]}
    return run_near_truth(folder, MOTOR, heated(120.0, 760.0, 2100.0), others=others, seed=8)


def compared(before, after, **options):
    found = heatrun.compare_runs(heatrun.open_run(before), heatrun.open_run(after), **options)
    return found, {each.name: each for each in found.changes}


@pytest.mark.parametrize(
    ("value", "ends", "said"),
    [(-0.001, (-0.073, 0.074), "Req_w moved by 0 % (-7 … 7 %)"),
     (-0.0001, (-0.005, 0.005), "Req_w moved by 0.0 % (-0.5 … 0.5 %)"),
     (0.02, (-0.01, 0.05), "Req_w grew by 2 % (-1 … 5 %)"),
     (-0.02, (-0.05, 0.01), "Req_w fell by 2 % (-1 … 5 %)")],
)  # fmt: skip
def test_what_moved_by_nothing_neither_fell_nor_grew(value, ends, said):
    assert (
        _moved(SimpleNamespace(name="Req_w", relative=Estimate(value=value, interval_95=ends)))
        == said
    )


def test_a_resistance_that_fell_is_named_with_its_probability(before, loose):
    found, changes = compared(before, loose)
    fell = changes["Req_w"]
    assert found.sentence.startswith("Req_w fell by 18.0 % (1")
    assert "probability above 99.9 % that it changed by more than 5 %" in found.sentence
    assert fell.relative.value == pytest.approx(-FALL)
    # a ratio of two independent values of 0.5 %, and 500 draws tell an interval to 6 %
    half = 1.96 * np.sqrt(2.0) * SD * (1.0 - FALL)
    low, high = fell.relative.interval_95
    assert 0.5 * (high - low) == pytest.approx(half, rel=0.12)
    assert fell.difference.value == pytest.approx(-FALL * TRUTH["Req_w"])
    assert fell.grew == 0.0
    assert changes["Ceq_sr"].changed == 0.0
    assert 0.0 < changes["Ceq_sr"].grew < 1.0


def test_the_size_that_is_asked_for_decides(before, loose):
    found, changes = compared(before, loose, size=0.2)
    assert changes["Req_w"].changed < 0.01
    assert found.sentence.startswith("Nothing changed by more than 20 %")
    assert "not decided" in compared(before, loose, size=FALL)[0].sentence


def test_figures_after_are_those_at_the_load_before(before, loose):
    """Other current, losses and speed are the tests', not the machine's."""
    _, changes = compared(before, loose)

    def rise(Req_w, other, amperes=110.0):
        both = Req_w + TRUTH["Req_sr"]
        k = 3.0 * amperes**2 * TRUTH["Rs0"] / (B + TREF)
        return (k * (B + SINK) * both + TRUTH["Req_sr"] * other) / (1.0 - k * both)

    loaded = SINK + 130.0 * np.mean(-np.expm1(-np.arange(0.0, 3600.0, 4.0) / 900.0))
    other = 620.0 - 3.0 * 110.0**2 * TRUTH["Rs0"] * (B + loaded) / (B + TREF)
    steady = changes["steady_rise_K"]
    # medians of 500 draws of 0.5 %, and means over blocks in the place of samples
    assert steady.before.value == pytest.approx(rise(TRUTH["Req_w"], other), rel=4e-3)
    assert steady.after.value == pytest.approx(rise((1 - FALL) * TRUTH["Req_w"], other), rel=4e-3)
    assert "110 A rms, other losses" in steady.condition
    allowed = changes["continuous_current_A"]
    per_square = 3.0 * TRUTH["Rs0"] * (B + 155.0) / (B + TREF)
    for value, Req_w in ((allowed.before.value, 1.0), (allowed.after.value, 1.0 - FALL)):
        room = 155.0 - SINK - TRUTH["Req_sr"] * other
        square = room / ((Req_w * TRUTH["Req_w"] + TRUTH["Req_sr"]) * per_square)
        assert value == pytest.approx(np.sqrt(square), rel=4e-3)
    assert allowed.grew > 0.999
    by_rise = changes["continuous_current_by_rise_A"]
    per_square = 3.0 * TRUTH["Rs0"] * (B + SINK + 105.0) / (B + TREF)
    for value, Req_w in ((by_rise.before.value, 1.0), (by_rise.after.value, 1.0 - FALL)):
        room = 105.0 - TRUTH["Req_sr"] * other
        square = room / ((Req_w * TRUTH["Req_w"] + TRUTH["Req_sr"]) * per_square)
        assert value == pytest.approx(np.sqrt(square), rel=4e-3)
    assert "class F, permitted rise 105 K" in by_rise.condition
    assert changes["tau_fast_s"].relative.value == pytest.approx(-FALL, abs=0.02)


def test_a_resistance_that_follows_the_speed_is_compared_at_one_speed(before, tmp_path):
    """The run after was scaled with another speed, and tested at half of it."""
    record = heated(rpm=4000.0)
    record.channels["speed_rpm"][: record.time_s.size // 20] = 8000.0
    law = {"speed_cooling.g": 0.6, "speed_cooling.m": 0.8}
    after = run_near_truth(tmp_path / "run", MOTOR, record, others=law, effects=(SPEED_COOLING,))
    found, changes = compared(before, after)
    one = changes["Req_sr_loaded"]
    assert "2000 rpm" in one.condition
    assert one.before.value == pytest.approx(TRUTH["Req_sr"])
    expected = TRUTH["Req_sr"] / (1.0 + 0.6 * (2000.0 / 8000.0) ** 0.8)
    assert one.after.value == pytest.approx(expected, rel=4e-3)
    assert "Req_sr" not in changes
    assert found.not_compared["speed_cooling.g"] == "not in the network before"


def test_what_no_effect_follows_is_not_compared_at_another_speed(before, tmp_path):
    after = run_near_truth(tmp_path / "run", MOTOR, heated(rpm=4000.0), seed=9)
    found, changes = compared(before, after)
    assert set(changes) == {"Ceq_w", "Ceq_sr", "Req_w", "Rs0"}
    assert found.not_compared["Req_sr"].startswith("2000 rpm before, 4000 after")
    assert "steady rise" in " ".join(found.not_compared)


def test_what_a_run_does_not_say_is_not_compared(before, tmp_path):
    after = run_near_truth(tmp_path / "run", MOTOR, heated(), seed=9)

    def change(content):
        model = content["models"]["second"]
        del model["load"]  # as in runs of earlier versions
        model["parameters"]["Rs0"]["identifiability"] = "not identifiable"
        low, high = model["parameters"]["Req_w"]["interval_95"]
        model["parameters"]["Req_w"]["interval_95"] = [low - 3.0 * (high - low), high]

    edit(after / "fit.json", change)
    found, changes = compared(before, after)
    assert "not identifiable after" in found.not_compared["Rs0"]
    assert any("earlier version" in why for why in found.not_compared.values())
    # over models that the tests do not tell apart, the run states more than its draws
    one = changes["Req_w"]
    low, high = one.difference.interval_95
    assert low < one.after.interval_95[0] - one.before.value * (1.0 - 2.0 * SD)
    assert high < 5.0 * SD * TRUTH["Req_w"]


def test_a_run_alone_has_the_figures_of_its_calibration(finished_day):
    """What is worked out from the run folder is what was worked out from the tests."""
    run = heatrun.open_run(finished_day / "run")
    for name, said in run.result.models.items():
        side = _Side("before", run, name)
        assert side.seen is not None
        found = side.figures(side.seen, side.seen.amperes, side.seen)
        assert "steady_rise_K" in found
        for key, (_, entry) in found.items():
            stated = said.derived[key]
            assert entry.refused == stated.refused
            if entry.refused is UNSET:
                # 1e-9: the load was printed to all digits, and its current squared again
                assert entry.value == pytest.approx(stated.value, rel=1e-9)
                assert entry.interval_95 == pytest.approx(stated.interval_95, rel=1e-9)


def test_the_load_is_the_rated_one_and_other_classes_are_not_compared(tmp_path):
    runs = []
    for name, rated, letter, amperes in (("a", 77.0, "B", 110.0), ("b", 80.0, None, 112.0)):
        motor = replace(MOTOR, rated_current_A=rated, shutdown=ShutDown(utilisation_class=letter))
        runs.append(run_near_truth(tmp_path / name, motor, heated(amperes), seed=int(rated)))
    found, changes = compared(*runs)
    assert changes["steady_rise_K"].condition.startswith("rated current 77 A, other losses")
    assert "80 A after: the steady rise is that at 77 A" in " ".join(found.notes)
    assert found.not_compared["continuous_current_by_rise_A"] == "class B before, class F after"
    assert "continuous_current_A" in changes


def test_the_command_takes_two_run_folders(before, loose, capsys):
    assert cli.main(["compare", str(before), str(loose), "--change", "10"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("Req_w fell by 18.0 %")
    assert "Continuous current (S1) at class F, permitted rise 105 K: " in said
    assert "Steady rise at 110 A rms: " in said
    assert "changed > 10 %" in said
    assert "Holds at" in said
    assert cli.main(["compare", str(before), str(loose), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["format"] == "heatrun-compare/1"
    names = [each["name"] for each in content["changes"]]
    assert names[:4] == ["Ceq_w", "Ceq_sr", "Req_w", "Req_sr"]
    assert content["changes"][2]["relative"]["value"] == pytest.approx(-FALL)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["{before}", "record.csv"], 2, "RUN_BEFORE RUN_AFTER"),
        (["{before}", "{before}"], 1, "one and the same"),
        (["{before}", "{loose}", "--quick"], 2, "--quick is for a calibration"),
        (["{before}", "{loose}", "--change", "-3"], 2, "per cent above 0"),
        (["{before}", "{loose}", "--model", "third"], 1, "no third network"),
        (["motor.toml", "record.csv", "--change", "3"], 2, "two run folders"),
    ],
)
def test_wrong_use_is_told(before, loose, words, code, said, capsys):
    filled = [word.format(before=before, loose=loose) for word in words]
    assert cli.main(["compare", *filled]) == code
    assert said in capsys.readouterr().err


def test_two_runs_of_one_file_are_said_not_to_be_independent(before, loose):
    assert any("fitted to one file" in note for note in compared(before, loose)[0].notes)
