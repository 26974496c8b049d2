"""What commands say: results as text, whole lines, help, and options in any order."""

import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from heatrun import cli, jobs
from heatrun.commands import all_commands, calibrate
from heatrun.commands.console import EVERY_S, PROGRESS, bar, say
from heatrun.record.record import Finding
from heatrun.reports.terminal import discovery_text, findings_text, result_text
from heatrun.results import DiscoveryResult, FitResult, from_json
from heatrun.results.model import DerivedFigure
from heatrun.runs.run import Run

STORED = Path(__file__).parents[1] / "stored"


@pytest.fixture(scope="module")
def stored():
    return from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "stored")


def test_a_warning_of_two_parts_is_said_once_with_both():
    found = [
        Finding("sampling", "warning", f"{n} samples at 600 s.", f"day_{k}, time_s, 0 s", "Export.",
                f"day_{k}")
        for k, n in ((1, 200), (2, 370))
    ]  # fmt: skip
    found.append(
        Finding("saturation", "warning", "Clipped.", "day_2, torque_Nm", "Check.", "day_2")
    )
    other = replace(found[0], where="day_2, winding_degC, 0 s", test="day_2")
    (first, second, third) = findings_text([*found, other]).splitlines()
    assert first.endswith(
        "day_1, time_s, 0 s: 200 samples at 600 s. Export.  (sampling; day_2 too)"
    )
    assert second.endswith("(saturation)")
    assert "winding_degC" in third  # of another channel
    assert len(findings_text(found, verbose=True).splitlines()) == 3
    assert len(findings_text([replace(f, severity="error") for f in found]).splitlines()) == 3


def test_a_large_capacity_has_no_exponent(stored):
    second = stored.models["second"]
    large = replace(
        second.parameters["Ceq_sr"], value=151234.0, sd=2600.0, interval_95=(146123.0, 156321.0)
    )
    models = {"second": replace(second, parameters={"Ceq_sr": large})}
    said = result_text(replace(stored, models=models))
    assert re.search(r"Ceq_sr +151200 ± 5200 J/K +identified", said)
    said = result_text(replace(stored, models=models), verbose=True)
    assert re.search(r"Ceq_sr +151230 J/K +95 % 146100 … 156300 ", said)


def test_compare_into_a_folder_says_how_the_two_networks_compare(stored, monkeypatch, capsys):
    found = SimpleNamespace(result=stored, sampling_s=0.0)
    monkeypatch.setattr(jobs, "calibrate_into", lambda *_, **__: (found, Path("out")))
    monkeypatch.setattr(calibrate, "load", lambda *_, **__: [None])
    motor = Path(__file__).parents[2] / "data" / "synthetic" / "motor.toml"
    words = [str(motor), "duty.csv", "--quick", "--out", "out"]
    assert cli.main(["compare", *words]) == 0
    said = capsys.readouterr().out
    chance, rmse = "describes the fitted tests better", stored.comparison.words[0]
    assert chance in said
    assert rmse in said
    assert said.startswith("USABLE")
    assert "\nSheet: out; with -v: " in said
    assert cli.main(["calibrate", *words]) == 0
    assert rmse not in capsys.readouterr().out


def test_a_result_is_told_in_a_dozen_lines_and_the_rest_on_demand(stored):
    lines = result_text(stored, "runs/demo").splitlines()
    assert len(lines) <= 12
    assert lines[0].startswith("USABLE: Second order. ")
    assert (
        "RMSE: fitted 0.16 K (largest error 0.4 K); held out 0.37 K (largest error 1.0 K)" in lines
    )
    assert "Time constants: 91.8 s (90.6 … 92.9) and 1820 s (1720 … 1920), losses held" in lines[6]
    assert lines[-2].startswith("Next: heatrun simulate data/synthetic/motor.toml runs/demo TEST")
    narrow = replace(stored, models=dict(stored.models))
    second = narrow.models["second"]
    slow = replace(second.derived["tau_slow_s"], value=1038.8, interval_95=(1036.31, 1041.22))
    narrow.models["second"] = replace(second, derived=second.derived | {"tau_slow_s": slow})
    assert "and 1038.8 s (1036.3 … 1041.2)" in result_text(narrow).splitlines()[6]
    fast = replace(second.derived["tau_fast_s"], value=85.7, interval_95=(84.0, 86.2))
    narrow.models["second"] = replace(second, derived=second.derived | {"tau_fast_s": fast})
    assert "85.7 s (84.0 … 86.2) and 1820 s (1720 … 1920)" in result_text(narrow).splitlines()[6]
    foreign = ("posterior", "Pareto", "Bayes", "evidence", "MCMC", "ESS")
    assert not any(word in line for word in foreign for line in lines)
    whole = result_text(stored, "runs/demo", verbose=True)
    assert whole.startswith("\n".join(lines[:-1]))
    assert all(finding.id in whole for finding in stored.findings)


def with_effects(stored, **more):
    second = stored.models["second"]
    one = replace(second.parameters["Req_w"], unit="1", value=1.4, sd=0.06,
                  interval_95=(1.28, 1.52), meaning="the gain")  # fmt: skip
    names = ("speed_cooling.g", "speed_cooling.m", "sensor_lag.tau", "radiation.e")
    of_effects = dict.fromkeys(names, one)
    model = replace(second, parameters={**second.parameters, **of_effects, **more})
    return replace(stored, models={"second": model})


def test_all_effects_have_one_line(stored):
    lines = result_text(with_effects(stored)).splitlines()
    assert (
        "  speed_cooling: g 1.40 ± 0.12 (the gain), m 1.40 ± 0.12 (the gain); "
        "sensor_lag: tau 1.40 ± 0.12 (the gain); radiation: e 1.40 ± 0.12 (the gain)"
    ) in lines
    assert len(lines) == len(result_text(stored).splitlines()) + 1


def test_there_are_never_more_than_twelve_lines(stored):
    """Nine bodies, three effects and a rating, of doubtful tests; the network lacks something."""
    entry = stored.models["second"].parameters["Ceq_w"]
    more = {f"{kind}_{number}": entry for kind in ("Ceq", "Req") for number in range(7)}
    told = with_effects(stored, **more)
    units = [Finding("unit_suspected", "warning", "Huge.", test, "State it.", test)
             for test in ("a", "b")]  # fmt: skip
    findings = (Finding("misfit", "warning", "Too slow.", "a", remedy="Add."), *units)
    lines = result_text(replace(told, findings=findings), sheet="run/sheet.pdf").splitlines()
    assert len(lines) == 12
    assert "In doubt about a: " in lines[1]
    assert "In doubt about b: " in lines[1]
    assert "The network lacks something" in lines[1]
    text = "\n".join(lines)
    assert all(f"{name} 664 ± 15 J/K identified" in text for name in more), text
    assert lines[-2] == "Next: State it."
    assert lines[-1].startswith(
        "Sheet: run/sheet.pdf; with -v: warnings (misfit, unit_suspected), "
    )


def test_what_decides_a_verdict_is_never_hidden_and_comes_next(stored):
    def said(*findings, **change):
        second = replace(stored.models["second"], **change)
        told = replace(stored, findings=findings, models={"second": second})
        return result_text(told).splitlines()

    misfit = Finding("misfit", "warning", "Too slow.", "step", remedy="Add a node.")
    unit = Finding("unit_suspected", "warning", "Huge.", "step", "State the unit.", test="step")
    lines = said(misfit, unit)
    assert lines[0].startswith("RESTRICTED: ")
    assert "In doubt about step: a column may be in another unit" in lines[1]
    assert "The network lacks something that the tests show" in lines[1]
    assert "Next: State the unit." in lines  # of two findings that of the inputs
    assert "warnings (misfit, unit_suspected)" in lines[-1]
    simulated = replace(unit, id="simulated_by_heatrun", remedy="Measure.")
    assert said(misfit, simulated)[0].startswith("NOT USABLE: Second order. No measurement")
    assert "Next: Measure." in said(misfit, simulated)
    entry = stored.models["second"].parameters["Ceq_w"]
    weak = replace(entry, identifiability="weak", why="It is short. A longer test would do.")
    lines = said(misfit, parameters={"Ceq_w": weak})
    assert "known only roughly (Ceq_w" in lines[0]
    assert "Next: A longer test would do for Ceq_w" in lines
    blocked = replace(entry, identifiability="not identifiable", why="not informed by the data.")
    cooling = Finding("no_heating", "warning", "It falls.", "step", "Add a test under load.")
    lines = said(misfit, cooling, parameters={"Ceq_w": blocked})
    assert lines[0] == "NOT USABLE: Second order. The tests give time constants only: " \
                       "91.8 s and 1820 s."  # fmt: skip
    assert "Next: Add a test under load." in lines
    sampling = Finding("sampling", "warning", "Slow.", "step", "Export faster.")
    lines = said(sampling, parameters={"Ceq_w": replace(blocked, why="")})
    assert "Next: add a test with several steps of load and a cool-down" in lines


def test_the_next_step_is_about_the_instrument_that_the_verdict_names(stored):
    far = [
        Finding(id="instrument_beyond_prior", severity="warning", message=f"{name} is far.",
                where=next(reversed(stored.models.values())).title, remedy=f"Check {name}.",
                values={name: 1.0, "prior_sd": score})
        for name, score in (("sensor_offset", 3.4), ("ambient_offset", -19.2))
    ]  # fmt: skip
    said = result_text(replace(stored, findings=tuple(far)))
    assert "ambient_offset stands 19.2 standard deviations" in said.splitlines()[0]
    assert "Next: Check ambient_offset." in said


def test_after_plain_the_next_step_is_the_command_without_it(stored):
    left = Finding("effects_left_out", "warning", "They ask for a fan.", "", "Leave --plain out.")
    command = "heatrun calibrate 'my motor.toml' step.csv --plain --out runs/bare --quick"
    said = result_text(replace(stored, findings=(left,), command=command)).splitlines()
    assert "Next: heatrun calibrate 'my motor.toml' step.csv --quick" in said
    assert "The network lacks effects that the tests ask for" in said[1]
    assert not any("discover" in line for line in said)
    from_python = result_text(replace(stored, findings=(left,), command=""))
    assert "Next: Leave --plain out." in from_python


def test_a_warning_of_the_other_network_alone_is_left_to_the_rest(stored):
    (misfit,) = (one for one in stored.findings if one.id == "misfit")
    assert "first-order" in misfit.message
    assert result_text(stored).splitlines()[-1].startswith("With -v: warnings (single_step), ")
    assert "(misfit)" in result_text(stored, verbose=True)


def test_a_run_at_the_prompt_is_one_line(stored):
    said = repr(Run(Path("results") / "runs" / "demo", stored))
    first = stored.tests[0]
    assert said.startswith(f"<Run {Path('results', 'runs', 'demo')}: {stored.motor.name}; ")
    assert "second order" in said
    assert f"{first.name} ({first.role})" in said
    assert len(said) < 300


def test_figures_of_long_names_stand_below_each_other(stored):
    second = stored.models["second"]
    entry = second.parameters["Ceq_w"]
    models = {"four": replace(second, parameters={"Ceq_tooth": entry, "Req_winding_tooth": entry})}
    lines = result_text(replace(stored, models=models), verbose=True).splitlines()
    figures = [line for line in lines if line.startswith(("  Ceq", "  Req"))]
    for sign in ("±", "95 %"):
        assert len({line.index(sign) for line in figures if sign in line}) == 1
    assert len(figures) == 4


def test_a_rating_that_was_asked_for_is_told_or_refused(stored):
    current = DerivedFigure(
        value=140.279, unit="A", sd=0.74, interval_95=(139.608, 142.139), condition="S2-30, class F"
    )
    no_class = DerivedFigure(refused="no insulation class")
    told = {
        "continuous_current_A": no_class,
        "S2-30_current_A": current,
        "S3-40_current_A": no_class,
    }
    models = {"second": replace(stored.models["second"], derived=told)}
    said = result_text(replace(stored, models=models)).splitlines()
    assert "S2-30_current_A: 140.3 A  95 % 139.6 … 142.1   S2-30, class F" in said
    assert "S3-40_current_A: none; no insulation class" in said
    assert not any("continuous_current_A" in line for line in said)  # nobody asked for it


def test_what_is_missing_is_said_to_be_missing():
    """Below figures of the model after, watts without a word read as what is still missing."""
    stored = from_json(
        (STORED / "discovery-2.json").read_bytes(), DiscoveryResult, "discovery.json", "stored"
    )
    span = stored.where[0]
    lines = discovery_text(replace(stored, where=(span,) * 8)).splitlines()
    place = lines.index("What the network alone misses, with 95 % intervals:")
    assert all(line.startswith(f"  {span.test}, ") for line in lines[place + 1 : place + 7])
    assert lines[place + 7] == "  and 2 more in discovery.pdf"
    assert "alone misses" not in discovery_text(replace(stored, where=()))


class Pieces(io.StringIO):
    """A stream that remembers what it was given at once."""

    def __init__(self) -> None:
        super().__init__()
        self.pieces: list[str] = []

    def write(self, text: str) -> int:
        self.pieces.append(text)
        return super().write(text)


def test_a_line_is_written_in_one_piece(monkeypatch):
    stream = Pieces()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv(PROGRESS, "json")
    say("first order: sampling")
    with bar() as progress:
        progress("250 steps", 0.31)
    assert stream.pieces[0] == "· first order: sampling\n"
    assert json.loads(stream.pieces[1]) == {"share": 0.31, "doing": "250 steps"}
    assert len(stream.pieces) == 2
    assert stream.pieces[1].endswith("\n")


def test_without_a_terminal_the_time_left_is_printed_now_and_then(monkeypatch):
    stream = Pieces()
    now = [100.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.delenv(PROGRESS, raising=False)
    with bar(lambda: now[0]) as progress:
        progress("first order: fitting; about 2 min left", 0.0)
        progress("first order: fitted; about 2 min left", 0.1)
        now[0] += EVERY_S
        progress("second order: 500 steps; about 1 min left", 0.534)
        now[0] += EVERY_S
        progress("done", 1.0)
    assert stream.pieces == [
        "· 0 %, first order: fitting; about 2 min left\n",
        "· 53 %, second order: 500 steps; about 1 min left\n",
    ]


@pytest.mark.parametrize(
    "words", [[], *([name] for name in all_commands())], ids=lambda w: " ".join(w)
)
def test_help_is_printed(words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main([*words, "--help"])
    said = capsys.readouterr()
    assert (stop.value.code, said.err) == (0, "")
    assert " ".join(["usage: heatrun", *words]) in said.out
    if not words:
        assert "parameters with 95 % intervals" in said.out
        assert all(name in said.out for name in all_commands())


def parsed(*words: str):
    return cli._parser().parse_args(list(words))


@pytest.mark.parametrize(
    "words",
    [
        ["export", "run", "new.csv", "--to", "mat"],
        ["export", "run", "--to", "mat", "new.csv"],
        ["export", "--to", "mat", "run", "new.csv"],
        ["export", "--to=mat", "run", "--force", "new.csv"],
        ["export", "run", "--to", "mat", "--", "new.csv"],
    ],
)
def test_a_test_may_be_named_behind_an_option(words):
    options = parsed(*words)
    assert (options.source, options.tests, options.to) == (Path("run"), [Path("new.csv")], "mat")


def test_a_run_alone_is_exported_as_before():
    assert parsed("export", "run", "--to", "mat").tests == []


@pytest.mark.parametrize(
    ("words", "tests"),
    [
        (["check", "motor.toml", "a.csv", "--json", "b.csv"], ["a.csv", "b.csv"]),
        (["calibrate", "motor.toml", "a.csv", "--quick", "b.csv", "--seed", "3"],
         ["a.csv", "b.csv"]),
        (["calibrate", "motor.toml", "a.csv", "--holdout", "c.csv", "--quick", "b.csv"],
         ["a.csv", "b.csv"]),
        (["init", "a.csv", "--out", "m.toml", "b.csv"], ["a.csv", "b.csv"]),
        (["discover", "motor.toml", "a.csv", "--quick", "b.csv"], ["a.csv", "b.csv"]),
        (["report", "motor.toml", "a.csv", "--type", "general", "b.csv"], ["a.csv", "b.csv"]),
    ],
)  # fmt: skip
def test_so_do_the_tests_of_every_command(words, tests):
    assert [str(test) for test in parsed(*words).tests] == tests


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["export", "run"], "required: --to"),
        (["check", "--json"], "required: MOTOR.toml, TEST"),
        (["check", "motor.toml", "a.csv", "--jsn"], "unrecognized arguments: --jsn"),
        (["sheet", "run", "--dcc", "other"], "unrecognized arguments: other"),
    ],
)
def test_what_is_wrong_is_said_as_before(words, said, capsys):
    with pytest.raises(SystemExit) as end:
        parsed(*words)
    assert end.value.code == 2
    assert said in capsys.readouterr().err


SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"
MOTOR, DUTY = (str(SYNTHETIC / name) for name in ("motor.toml", "duty_30min.csv.gz"))

COMPUTING, DRAWING = {"jax", "equinox", "lptn", "scipy", "arviz", "xarray"}, {"matplotlib", "PIL"}
"""Packages that take long to load."""


@pytest.mark.parametrize(
    ("words", "spared"),
    [
        (["--help"], COMPUTING | DRAWING | {"numpy", "pandas"}),
        (["check", MOTOR, DUTY], COMPUTING | DRAWING),
        (["init", DUTY, "--out", "draft.toml"], COMPUTING | DRAWING),
        (["report", "--type", "thermal", MOTOR, DUTY, "--out", "."], COMPUTING),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_what_a_command_has_no_use_for_is_not_loaded(words, spared, tmp_path):
    said = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "heatrun.cli", *words],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    loaded = {line.split("|")[-1].strip().split(".")[0] for line in said.stderr.splitlines()}
    assert "heatrun" in loaded
    assert not loaded & spared
