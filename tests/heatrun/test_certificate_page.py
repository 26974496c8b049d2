"""Page 1 of the sheet: verdict, numbers, days, names to the letter, blank lines for the rest."""

import doctest
import json
from dataclasses import replace
from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader

from heatrun.io.texts import Texts
from heatrun.record.derive import BY_CONSTANTS
from heatrun.record.motor import Certificate, Instrument
from heatrun.record.record import Finding
from heatrun.reports import printed as printed_module
from heatrun.reports.certificate import certificate_content
from heatrun.reports.content import sheet_content
from heatrun.reports.figures import save
from heatrun.reports.pdf import shown, write_pdf
from heatrun.reports.printed import printed
from heatrun.reports.printed import test_days as days_of
from heatrun.reports.terminal import verdict_lines
from heatrun.reports.xlsx import write_xlsx
from heatrun.results import FitResult, from_json, to_json
from heatrun.results.model import AT_REST, LOADED, DerivedFigure, FittedParameter
from heatrun.runs.verdict import headline

STORED = Path(__file__).parents[1] / "stored" / "fit-1.json"

HOSTILE = '#panic() $a_1$ *b* <script> & "q" @import \\ ]]> Ångström שלום'


@pytest.fixture(scope="module")
def result():
    return from_json(STORED.read_bytes(), FitResult, "fit.json", str(STORED))


def parameter(value, sd, interval, unit="J/K", **more):
    return FittedParameter(
        value=value, unit=unit, sd=sd, sd_type_a=sd, sd_type_b=0.0, interval_95=interval,
        relative_sd=None, prior_95=(0.0, 1.0), prior_basis="", meaning="", fixed=False, **more,
    )  # fmt: skip


def with_second(stored, **changes):
    models = {**stored.models, "second": replace(stored.models["second"], **changes)}
    return replace(stored, models=models)


def judged(result, **verdicts):
    held = result.models["second"].parameters
    changed = {name: replace(held[name], identifiability=word) for name, word in verdicts.items()}
    return with_second(result, parameters={**held, **changed})


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        # normal: the ends are at 1.96 u
        (parameter(666.0, 10.0, (646.4, 685.6)), "666 ± 20 J/K"),
        (parameter(640.0, 32.0, (577.0, 703.0)), "640 ± 64 J/K"),
        (parameter(15090.0, 185.0, (14727.0, 15453.0)), "15090 ± 370 J/K"),
        (parameter(-0.0004, 0.05, (-0.098, 0.098), "1"), "0.00 ± 0.10"),
        (parameter(0.0062, 6.2e-5, (0.00608, 0.00632), "ohm"), "0.00620 ± 0.00012 Ω"),
        # ± 1300 about 1420 would begin at 120; the interval begins at 470
        (parameter(1420.0, 650.0, (470.0, 3230.0)), "470 … 3230 J/K"),
        (parameter(0.1468, 0.00498, (0.13996, 0.1626), "K/W"), "0.1400 … 0.1626 K/W"),
        # an end above 0 is not printed as 0
        (parameter(900.0, 690.0, (4.2, 3230.0)), "4.2 … 3230 J/K"),
        (replace(parameter(0.11625, 0.0, (0.11625, 0.11625), "K/W"), fixed=True), "0.11625 K/W"),
    ],
)
def test_a_number_is_printed_with_u_or_as_its_interval(entry, text):
    assert printed(entry).text == text
    assert "e+" not in text


def test_the_places_follow_the_uncertainty():
    assert doctest.testmod(printed_module).failed == 0


def test_the_network_that_the_data_favour_is_stated(result):
    assert certificate_content(result, Certificate())["network"] == "second order"
    first = replace(result, verdict=replace(result.verdict, order="first"))
    said = certificate_content(first, Certificate())
    assert said["network"] == "first order"
    assert [row[0] for row in said["parameters"]] == ["Ceq", "Req"]
    assert said["use"] == "not usable"
    model = first.models["first"]
    close = tuple(replace(row, rmse_K=0.5) for row in model.residuals)
    near = replace(first, models={**first.models, "first": replace(model, residuals=close)})
    assert headline(near).use == "not usable"
    assert headline(near).sentence == (
        "First order. 2 of 2 parameters are not identifiable from these tests (Ceq, Req): do not "
        "use for warm-up and time to a limit and steady temperatures and continuous current."
    )


def test_identified_parameters_can_be_used(result):
    said = headline(result)
    assert said.use == "usable"
    assert said.sentence.startswith("Second order. All 4 parameters are identified")
    page = certificate_content(result, Certificate())  # said once, in the table
    assert {row[0]: row[3] for row in page["parameters"]}["Rs0"].startswith("of the motor file")
    assert not any("Rs0" in reason for reason in said.reasons)


@pytest.mark.parametrize("language", ["en", "de", "it"])
def test_page_1_states_the_continuous_current(result, language):
    """That of the permitted rise where there is one, else that of the class; a refused one stands
    in the annex.
    """
    model, say = result.models["second"], Texts(language)
    of_class, of_rise = (
        DerivedFigure(value=A, unit="A", sd=1.0, interval_95=(A - 2.0, A + 2.0), condition="")
        for A in (115.0, 100.0)
    )
    refused = DerivedFigure(refused="the tests do not tell, tested up to 81 °C")
    for found, stated in (
        (
            {"continuous_current_A": of_class, "continuous_current_by_rise_A": of_rise},
            "100.0 ± 2.0 A",
        ),
        ({"continuous_current_A": of_class}, "115.0 ± 2.0 A"),
        ({"continuous_current_A": of_class, "continuous_current_by_rise_A": refused}, None),
    ):
        rated = with_second(result, derived={**model.derived, **found})
        rows = certificate_content(rated, Certificate(), say)["figures"]
        held = [value for name, _, value, _ in rows if name == "continuous_current"]
        assert held == ([] if stated is None else [say.number(stated)])
        annex = " ".join(
            row[0] for row in sheet_content(rated, Certificate(language=language))["derived"]
        )
        assert (say("figure_continuous_current_by_rise_A") in annex) == (stated is None)
        assert not say.unknown


def test_page_1_tells_the_worst_of_several_tests(result):
    model = result.models["second"]
    fitted = next(row for row in model.residuals if row.role == "calibration")
    more = replace(fitted, test="other", rmse_K=0.25, max_K=0.3, coverage_95=0.93)
    several = with_second(result, residuals=(*model.residuals, more))
    told = [reason for reason in headline(several).reasons if reason.startswith("Fitted")]
    assert told == [
        "Fitted test other, the worst of 2: RMSE 0.25 K, maximum error 0.4 K, 93 % of the readings "
        "in the 95 % band."
    ]
    for language, words in (("de", "die schlechteste von 2"), ("it", "la peggiore di 2")):
        say = Texts(language)
        assert any(words in each for each in
                   certificate_content(several, Certificate(), say)["reasons"])  # fmt: skip
        assert not say.unknown


def test_what_is_not_identifiable_is_not_to_be_used(result):
    said = headline(judged(result, Ceq_sr="not identifiable", Req_w="weak"))
    assert said.use == "restricted"
    assert said.sentence == (
        "Second order. 1 of 4 parameters is not identifiable from these tests (Ceq_sr): do not "
        "use for warm-up and time to a limit."
    )
    # U of Req_w: 2 · 0.001624 / 0.14481 = 2.2 %
    rough = headline(judged(result, Req_w="weak"))
    assert rough.use == "restricted"
    assert "known only roughly (Req_w ± 2.2 %)" in rough.sentence


def test_a_resistance_that_effects_change_is_judged_as_it_is_printed(result):
    """The parameter of a law may be open where the resistance under load is not, and otherwise."""
    held = result.models["second"]
    law = judged(result, Req_sr="weak")

    def stated(loaded, at_rest):
        figures = {
            f"Req_sr{ending}": DerivedFigure(
                value=0.12,
                unit="K/W",
                sd=sd,
                interval_95=(0.12 - 2.0 * sd, 0.12 + 2.0 * sd),
                condition="1400 rpm",
                identifiability=grade,
            )
            for ending, sd, grade in ((LOADED, *loaded), (AT_REST, *at_rest))
        }
        return with_second(law, derived={**held.derived, **figures})

    known = stated((0.003, "identified"), (0.004, "identified"))
    assert headline(known).use == "usable"
    rough = stated((0.003, "identified"), (0.009, "weak"))
    assert "known only roughly (Req_sr ± 15 %)" in headline(rough).sentence
    rows = {row[0]: row[3] for row in certificate_content(rough, Certificate())["parameters"]}
    assert rows["Req_sr under load"] == "identified"
    assert rows["Req_sr at rest"] == "known roughly"


def test_a_fit_or_a_prediction_that_fails_is_said(result):
    assert headline(with_second(result, result="not_converged")).use == "not usable"
    model = result.models["second"]
    rows = tuple(
        replace(row, coverage_95=0.5 if row.role == "holdout" else row.coverage_95)
        for row in model.residuals
    )
    said = headline(with_second(result, residuals=rows))
    assert said.use == "restricted"
    assert any("misses too many readings of a held-out test" in each for each in said.reasons)
    doubtful = with_second(result, posterior=replace(model.posterior, is_sound=False))
    assert headline(doubtful).use == "restricted"


def test_a_network_that_does_not_follow_its_test_is_not_to_be_used(result):
    """The winding of the stored test rises from the sink by some 100 K: 15 K are not followed."""
    fitted = result.tests[0]
    rise = fitted.winding_degC[1] - fitted.sink_degC[0]
    assert 60.0 < rise < 150.0
    rows = tuple(
        replace(row, rmse_K=15.0) if row.role == "calibration" else row
        for row in result.models["second"].residuals
    )
    said = headline(with_second(result, residuals=rows))
    assert said.use == "not usable"
    assert said.sentence == (
        "Second order. The network does not follow the fitted test duty_30min (RMSE 15.0 K, "
        f"{100 * 15.0 / rise:.0f} % of the rise): do not use it."
    )


LACK = Finding("missing_effect", "warning", "the second-order network is incomplete")


def test_a_network_that_lacks_something_is_restricted(result):
    said = headline(replace(result, findings=(LACK,)))
    assert said.use == "restricted"
    assert any("lacks something that the tests show" in reason for reason in said.reasons)
    other = replace(LACK, network="first")
    assert headline(replace(result, findings=(other,))).use == "usable"


def test_which_of_several_effects_is_there_restricts_nothing_that_the_intervals_allow_for(result):
    which = Finding("effect_ambiguous", "warning", "housing or neighbour")
    said = headline(replace(result, findings=(which,)))
    assert said.use == "usable"
    assert any("do not tell which of several effects" in reason for reason in said.reasons)
    assert not any("discover" in reason for reason in said.reasons)
    assert (
        "do not tell which of several effects"
        in verdict_lines(replace(result, findings=(which,)))[-1]
    )
    said = headline(replace(result, findings=(which, LACK)))
    assert said.use == "restricted"
    assert any("lacks something that the tests show" in reason for reason in said.reasons)
    assert any("do not tell which of several effects" in reason for reason in said.reasons)
    said = headline(replace(judged(result, Req_w="weak"), findings=(which,)))
    assert said.use == "restricted"


def test_the_choice_of_the_network_is_told_as_a_chance(result):
    """A log Bayes factor of 3: 1/(1 + e³) = 4.7 %."""
    close = replace(result, verdict=replace(result.verdict, log_bayes_factor=3.0))
    assert any("4.7 %" in reason for reason in headline(close).reasons)
    assert any("below 0.1 %" in reason for reason in headline(result).reasons)


def test_the_days_are_those_of_the_records_or_as_stated(result):
    one, other = result.tests
    dated = replace(
        result, tests=(replace(one, start="2026-03-05"), replace(other, start="2026-03-04"))
    )
    assert str(days_of(dated, Certificate())) == "2026-03-04 to 2026-03-05"
    assert str(days_of(result, Certificate())) == ""
    half = replace(result, tests=(replace(one, start="2026-03-05"), other))
    assert str(days_of(half, Certificate())) == ""
    stated = days_of(dated, Certificate(test_from="2026-03-09"))
    assert str(stated) == "2026-03-09"
    assert stated.note == "By the records: 2026-03-04 to 2026-03-05."
    long = replace(dated, tests=(replace(one, start="2026-03-05", duration_s=90000.0),))
    assert str(days_of(long, Certificate())) == "2026-03-05 to 2026-03-06"


def pages(result, certificate, folder):
    figure = Figure(figsize=(6, 3))
    figure.subplots()
    drawn = save(figure, folder / "certificate.png")
    path = write_pdf(sheet_content(result, certificate), [drawn, drawn], folder / "sheet.pdf")
    return [" ".join(page.extract_text().split()) for page in PdfReader(path).pages]


def test_an_empty_block_leaves_lines_to_fill_in(result, tmp_path):
    text, *annex = pages(result, Certificate(), tmp_path)
    for label in ("Certificate number", "Laboratory", "Customer", "Serial number", "Date of test",
                  "Date of issue", "Operator", "Approved by", "Signature",
                  "Instruments"):  # fmt: skip
        assert label in text
    assert "Condition" not in text.replace("Conditions", "")
    assert f"page 1 of {len(annex) + 1}" in text
    assert annex[0].startswith("Findings")
    for heading in ("Annex", "SHA-256", "Measured less model", "Definitions"):
        assert any(heading in page for page in annex)


def test_names_stand_on_page_1_to_the_letter(result, tmp_path):
    rows = Instrument(HOSTILE[:60], HOSTILE, "0.2", HOSTILE, "2027-01-31")
    stated = Certificate(
        number=HOSTILE, laboratory=HOSTILE, customer=HOSTILE, operator="A. Ångström",
        bench="W" * 120, remarks=HOSTILE * 8, instruments=(rows,),
    )  # fmt: skip
    text, second, *_ = pages(result, stated, tmp_path)
    flat = "".join(text.split())
    for word in ("#panic()", "$a_1$", "*b*", "<script>", '"q"', "@import", "Ångström", "W" * 120):
        assert flat.count(word) >= 1
    assert second.startswith("Findings")


@pytest.mark.parametrize(("order", "own", "other"), [("first", "Ceq ", "Ceq_w"),
                                                     ("second", "Ceq_w", "Ceq ")])  # fmt: skip
def test_the_network_that_lost_is_not_on_the_pages(result, tmp_path, order, own, other):
    """One line says how sure the choice is; findings about the other network are left out."""
    lacks = [Finding("misfit", "warning", f"the {each}-order network is incomplete", network=each)
             for each in ("first", "second")]  # fmt: skip
    chosen = replace(result, verdict=replace(result.verdict, order=order), findings=tuple(lacks))
    text = " ".join(pages(chosen, Certificate(), tmp_path))
    assert own in text
    assert other not in text
    lost = {"first": "second", "second": "first"}[order]
    assert f"{order}-order network" in text
    assert f"{lost}-order network" not in text
    assert text.count(f"{lost} order") <= 1


def test_findings_stand_before_the_annex_the_worst_first(result, tmp_path):
    said = (Finding("a", "note", "Small."), Finding("b", "warning", "Larger."),
            Finding("c", "error", "Worst."))  # fmt: skip
    _, second, *_ = pages(replace(result, findings=said), Certificate(), tmp_path)
    places = [second.index(word) for word in ("Findings", "Worst.", "Larger.", "Notes: 1", "Annex")]
    assert places == sorted(places)
    assert "Small." not in second


def test_figures_and_control_tests_are_told_in_words(result):
    test = replace(result.tests[0], role="calibration")
    for num, words in ((1, "Dazu 1 Kontrollprüfung der"), (2, "Dazu 2 Kontrollprüfungen der")):
        tests = (test, *num * [replace(test, role="holdout")])
        found = sheet_content(replace(result, tests=tests), Certificate(), Texts("de"))
        assert any(words in text for _, text in found["certificate"]["statement"])
    names = [name for name, *_ in found["derived"]]
    assert names
    assert not any("Zeitkonstante" in name for name in names)  # two on page 1, all in the workbook
    assert not any("_" in name for name in names if not name.startswith("S2"))


def test_what_the_motor_file_states_is_not_called_measured(result):
    def measured(*tests):
        found = sheet_content(replace(result, tests=tests), Certificate())
        (said,) = [text for label, text in found["certificate"]["statement"] if label == "Measured"]
        (sink,) = [text for label, text in found["definitions"] if label == "T0"]
        return said, sink

    test = replace(result.tests[0], role="calibration")
    room = replace(test, notes=(*test.notes, f"ambient_degC = 22 {BY_CONSTANTS}"))
    said, sink = measured(test)
    assert "ambient temperature over time" in said
    assert "not measured" not in said
    assert "measured: ambient" in sink
    said, sink = measured(room)
    assert "ambient temperature over time" not in said
    assert "Ambient temperature as stated in the motor file, not measured." in said
    assert "as the motor file states it: ambient" in sink
    said, _ = measured(test, room)
    assert "ambient temperature over time" in said
    assert "Ambient temperature in 1 of 2 tests as stated" in said


def test_many_instruments_go_to_the_annex(result, tmp_path):
    stated = Certificate(instruments=tuple(Instrument(f"quantity {n}") for n in range(20)))
    first, *annex = pages(result, stated, tmp_path)
    assert "as listed in the annex" in first
    assert any("quantity 19" in page for page in annex)


def test_a_letter_that_no_font_has_stands_as_its_number():
    private = chr(0xE000)  # of no script: no font is right
    found = shown({"name": f"A. Ångström {private}", "rows": [[private]], "number": 3})
    assert found.content in (
        {"name": "A. Ångström [U+E000]", "rows": [["[U+E000]"]], "number": 3},
        {"name": f"A. Ångström {private}", "rows": [[private]], "number": 3},
    )
    plain = shown({"name": "A. Ångström Ω ± … שלום Привет"})
    assert plain.content == {"name": "A. Ångström Ω ± … שלום Привет"}
    assert not plain.needs_system_fonts


def test_the_json_keeps_its_keys_and_gets_the_certificate(result):
    content = json.loads(to_json(sheet_content(result, Certificate(number="7"))))
    assert {"title", "verdict", "meta", "definitions", "tests", "columns", "comparison",
            "findings", "limits", "certificate"} <= set(content)  # fmt: skip
    assert ["Certificate number", "7"] in content["certificate"]["identification"]
    assert content["certificate"]["parameters"][0][2] == "664 ± 15 J/K"


def test_the_workbook_shows_the_digits_of_the_sheet(result, tmp_path):
    times = [0.0, 20.0]
    columns = ("time_s", "measured_degC", "losses_W", "phase_current_A", "sink_degC",
               "second_winding_degC")  # fmt: skip
    table = pd.DataFrame({name: times for name in columns})
    stated = Certificate(number="=1+1", issue_date="2026-03-09", operator=HOSTILE)
    content = sheet_content(result, stated)
    book = openpyxl.load_workbook(
        write_xlsx(result, content, [("t", "calibration", table)], tmp_path / "sheet.xlsx")
    )
    assert book.sheetnames[:3] == ["Certificate", "Course 1", "Parameters"]
    rows = {row[0].value: row for row in book["Certificate"].iter_rows()}
    assert (rows["Certificate number"][1].value, rows["Certificate number"][1].data_type) == (
        "=1+1",
        "s",
    )
    assert rows["Date of issue"][1].value == "2026-03-09"
    assert rows["Operator"][1].value == HOSTILE
    heat = [cell.value for cell in rows["Ceq_w"]]
    assert heat[2:8] == [664, 15, 648.8, 677.8, "J/K", "identified"]
    flow = rows["Req_sr"]
    assert (flow[2].value, flow[2].number_format, flow[6].value) == (0.1155, "0.0000", "K/W")
    head, *rest = list(book["Parameters"].values)[3:]
    assert head[11:14] == ("prior 95 % low", "prior 95 % high", "prior from")
    ohm = next(row for row in rest if row[0] == "Rs0")
    assert ohm[2] == "Ω"


def test_inputs_in_doubt_are_said_first(result):
    name = result.tests[0].name
    doubt = Finding("losses_below_copper", "warning", "Expected more.", test=name)
    said = headline(replace(result, findings=(*result.findings, doubt)))
    assert said.use == "restricted"
    assert said.reasons[0] == (
        f"In doubt about {name}: its losses are at times below the copper loss. See Findings."
    )
    note = replace(doubt, severity="note")
    assert headline(replace(result, findings=(*result.findings, note))) == headline(result)


def test_a_simulation_gives_no_certificate_of_a_machine(result):
    name = result.tests[0].name
    virtual = Finding("simulated_by_heatrun", "warning", "Expected a measurement.", test=name)
    said = headline(replace(result, findings=(*result.findings, virtual)))
    assert said.use == "not usable"
    assert f"No measurement: {name} was simulated by heatrun." in said.sentence
    assert not any("simulated" in reason for reason in said.reasons)
