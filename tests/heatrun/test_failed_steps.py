"""What comes after the fit may fail: that is a finding on its part, and the parameters are written.

Each step is made to fail; some of them cannot be reached where an earlier one failed, so these
stand in tests of their own.
"""

import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from heatrun import calibration, jobs
from heatrun.calibration import Settings, load_tests
from heatrun.errors import InputError, UsageError
from heatrun.model.network_text import networks_of
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import unpredicted
from heatrun.record.findings import FAILED, OUTPUT_FAILED, Attempts
from heatrun.reports import figures, of_run
from heatrun.reports.of_run import rewrite_sheet, write_sheet
from heatrun.reports.terminal import result_text
from heatrun.runs import result as of_result
from heatrun.runs import write
from heatrun.runs.run import open_run
from heatrun.runs.run_folder import RunFolder
from heatrun.runs.verdict import favoured, headline


def fail(*_, **__):
    raise np.linalg.LinAlgError("Singular matrix")


STEPS = {
    "the search for effects": (calibration, "find"),
    "the search for missing effects": (calibration, "small_effects"),
    "the sampling of the posterior": (calibration, "sample"),
    "the prediction": (calibration, "predict"),
    "the check of the fit": (calibration, "fit_findings"),
    "the check of the reduction": (calibration, "check_reduction"),
    "the forecast of a longer test": (of_result, "forecast"),
    "the ratings": (of_result, "derive"),
    "the evidence": (of_result, "_evidence"),
    "the difference of the scores": (of_result, "score_difference"),
    "the comparison of the networks": (of_result, "compare"),
    "the figure": (figures, "pairs"),
    "the sheet": (of_run, "write_pdf"),
}
"""Steps of a calibration by the words of their finding, with the function that does them."""


@pytest.fixture(scope="module")
def left(finished_day, tmp_path_factory):
    """What a calibration leaves of which every step after the fit fails.

    The tests are those of the shared run, so that nothing new is compiled for their fits.
    """
    folder = tmp_path_factory.mktemp("failed") / "run"
    motor = load_motor(finished_day / "motor.toml")
    tests = load_tests(motor, [finished_day / "duty.csv"], [finished_day / "step.csv"])
    with pytest.MonkeyPatch.context() as patch:
        for module, name in STEPS.values():
            patch.setattr(module, name, fail)
        return jobs.calibrate_into(
            jobs.Place(folder), motor, tests, Settings(networks=networks_of("both"), method="quick")
        )


@pytest.fixture(scope="module")
def second_order(left):
    """The fit of the second order, which did not fail."""
    return left[0].posteriors["second"].fit


def test_a_calibration_of_which_every_step_fails_leaves_its_parameters(left, truth):
    _, folder = left
    run = open_run(folder)
    for name, value in truth.items():
        entry = run.result.models["second"].parameters[name]
        assert entry.interval_95[0] < entry.value < entry.interval_95[1]
        assert abs(entry.value - value) < 5.0 * entry.sd
    assert run.draws("second").values()["Req_w"].size > 1000
    found = left[0].result.models["second"]
    assert run.result.models["second"].parameters == found.parameters


@pytest.mark.parametrize("step", STEPS)
def test_each_step_that_failed_is_a_finding(step, left):
    found, folder = left
    for result in (found.result, open_run(folder).result):
        failed = [f for f in result.findings if f.id in (FAILED, OUTPUT_FAILED)]
        of_step = [f for f in failed if f.message.startswith(f"{step} failed")]
        assert of_step, step
        for finding in of_step:
            assert finding.severity == "warning"
            assert "LinAlgError: Singular matrix" in finding.message
            assert "test_failed_steps.py" in finding.message
            # and the line of ours that asked for it
            assert re.search(r", for \w+\.py, line \d+\)", finding.message)
            assert "report" in finding.remedy


def test_a_prediction_that_failed_is_told_for_each_test_of_each_network(left):
    found, _ = left
    failed = [f for f in found.result.findings if f.message.startswith("the prediction")]
    assert sorted(f.where for f in failed) == [
        f"{order} order, {test}" for order in ("first", "second") for test in ("duty", "step")
    ]
    assert all(model.residuals == () for model in found.result.models.values())


def test_what_is_left_can_be_read_and_printed(left):
    found, folder = left
    assert not found.result.models["second"].posterior.is_sound
    assert "normal law" in found.result.models["second"].posterior.verdict
    assert "cannot be compared" in found.result.verdict.sentence
    assert "Ceq_w" in result_text(found.result)
    table = open_run(folder).courses()[1]
    assert table["second_winding_degC"].isna().all()
    assert table["measured_degC"].notna().all()
    assert not (folder / "sheet.pdf").exists()
    assert (folder / "sheet.xlsx").exists()
    findings = json.loads((folder / "sheet.json").read_text())["findings"]
    assert any("posterior.png: the figure failed" in text for _, text in findings)


def test_usable_is_not_said_where_a_step_failed_that_judges_the_result(finished_day):
    result = open_run(finished_day / "run").result
    before = headline(result)
    for network, is_about in ((favoured(result), True), ("another", False)):
        attempts = Attempts()
        attempts.of("the search for missing effects", fail, None)
        failed = [replace(each, network=network) for each in attempts.findings]
        judged = headline(replace(result, findings=(*result.findings, *failed)))
        said = any("A step that judges the result failed" in reason for reason in judged.reasons)
        assert said == is_about
        assert judged.use == ("restricted" if is_about and before.use == "usable" else before.use)
    figure = Attempts(OUTPUT_FAILED)
    figure.of("the figure", fail, None, where="posterior.png")
    whole = headline(replace(result, findings=(*result.findings, *figure.findings)))
    assert whole.use == before.use


@pytest.fixture
def own_run(finished_day, tmp_path):
    return shutil.copytree(finished_day / "run", tmp_path / "run")


PARTS = {
    "course_1.png": (figures, "course"),
    "first_against_second.png": (figures, "errors"),
    "posterior.png": (figures, "pairs"),
    "certificate.png": (of_run, "certificate_figure"),
    "sheet.pdf": (of_run, "write_pdf"),
    "sheet.xlsx": (of_run, "write_xlsx"),
}
"""Parts of a sheet, with the function that makes them."""


@pytest.mark.parametrize("failing", [list(PARTS)[::2], list(PARTS)[1::2]], ids=["odd", "even"])
def test_parts_of_a_sheet_that_fail_are_left_out_and_told(failing, own_run, tmp_path, monkeypatch):
    """Every part fails once, and is there once when others fail."""
    for part in failing:
        monkeypatch.setattr(*PARTS[part], fail)
    told = []
    written = rewrite_sheet(own_run, tmp_path / "again", tell=told.append)
    names = {path.name for path in written}
    assert {*PARTS, "sheet.json"} & names == {*PARTS, "sheet.json"} - {*failing}
    findings = json.loads((tmp_path / "again" / "sheet.json").read_text())["findings"]
    for part in failing:
        assert any(text.startswith(f"{part}: ") and "failed" in text for text in told)
        if part != "sheet.pdf":
            assert any(text.startswith(f"{part}: ") for _, text in findings)


def test_a_part_that_fails_again_is_told_once(own_run, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "pairs", fail)
    run = open_run(own_run)
    first = write_sheet(run, tmp_path / "one")
    second = write_sheet(replace(run, result=first.result), tmp_path / "two")
    assert second.result == first.result


def test_draws_whose_densities_fail_are_written_without_them(
    left, second_order, own_run, tmp_path, monkeypatch
):
    monkeypatch.setattr(write, "densities_of", fail)
    posterior = replace(normal_draws(second_order), method="emcee")
    folder = RunFolder.begin(tmp_path / "new", {})
    before = open_run(own_run).result
    result = replace(before, tests=before.tests[:1])
    predicted = {"second": [unpredicted(posterior, second_order.problem.tests[0].winding)]}
    run = write.write_run(folder, left[0].motor, result, {"second": posterior}, predicted)
    assert [f.where for f in run.result.findings if f.id == OUTPUT_FAILED] == ["second"]
    assert "log_likelihood" not in run.posterior("second").children


def test_effects_that_cannot_be_averaged_leave_the_draws_of_the_network(second_order, monkeypatch):
    monkeypatch.setattr(calibration, "averaged", fail)
    drawn = normal_draws(second_order)
    monkeypatch.setattr(calibration, "sample", lambda *_, **__: drawn)
    effect = SimpleNamespace(probability=0.4)
    screened = SimpleNamespace(effects=(effect,))
    attempts = Attempts()
    settings = Settings(networks=["second"], method="quick")
    found = calibration._sampled(second_order, screened, settings, None, lambda *_: None, attempts)
    assert found is drawn
    assert [f.message.split(" failed")[0] for f in attempts.findings] == [
        "the average over effects that may be missing"
    ]


def test_a_refusal_after_the_fit_keeps_its_own_words():
    def refuse():
        raise InputError("the model leaves the machine.", where="duty", remedy="Mask it.")

    attempts = Attempts()
    assert attempts.of("the prediction", refuse, "nothing", test="duty") == "nothing"
    (finding,) = attempts.findings
    said = "duty: the prediction failed: the model leaves the machine. Mask it."
    assert finding.sentence() == said


@pytest.mark.parametrize("error", [OSError(28, "No space left"), MemoryError(), UsageError("S9")])
def test_a_full_disk_memory_and_wrong_use_end_the_command(error):
    def end():
        raise error

    attempts = Attempts()
    with pytest.raises(type(error)):
        attempts.of("the figure", end, None)
    assert not attempts.findings
