"""Sentences of the product use the terms of the field; sheets and reports in three languages."""

import ast
import json
import re
from collections import Counter
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader

import heatrun
from heatrun.checks import check_record
from heatrun.checks.suitability import DOUBTS
from heatrun.discovery.proposed_test import DUTIES
from heatrun.io import texts
from heatrun.io.texts import FIELD, LANGUAGES, SENTENCES, Texts, table
from heatrun.model.network_text import SHIPPED, network_named
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_test
from heatrun.record.findings import meanings
from heatrun.record.motor import Certificate, Motor
from heatrun.record.record import Finding, Record
from heatrun.reports import discovery
from heatrun.reports.content import LABELS, sheet_content
from heatrun.reports.figures import again, pairs
from heatrun.reports.pdf import write_pdf
from heatrun.reports.printed import told
from heatrun.results import DiscoveryResult, FitResult, from_json
from heatrun.results.discovery import ProposedTest
from heatrun.results.model import EffectInModel, MaybeMissing
from heatrun.runs.verdict import USES, favoured, headline
from heatrun_reports import job, make_report
from heatrun_reports.document import document_content, report_content
from heatrun_reports.job import build_report
from heatrun_reports.plot import SYMBOLS
from heatrun_reports.prototypes import read_prototypes
from heatrun_reports.prototypes_report import prototypes_report
from lptn.effects import EFFECTS

DATA = Path(__file__).parents[2] / "data" / "synthetic"
ROOT = Path(heatrun.__file__).parents[1]
ROOMS = (
    "heatrun/checks", "heatrun/commands", "heatrun/discovery", "heatrun/export", "heatrun/fit",
    "heatrun/init", "heatrun/model", "heatrun/posterior", "heatrun/readers", "heatrun/record",
    "heatrun/reports", "heatrun/runs",
    "heatrun_reports", "heatrun_view",
)  # fmt: skip

OTHER_TERMS = {
    r"(?<!tested )\branges?\b(?! of the amplifier)": "95 % intervals",
    r"weighted draws|draws that count": "importance sampling",
    r"effective draws": "effective sample size",
    r"sampling has (not )?converged": "MCMC converged",
    r"\berrs?\b": "RMSE, maximum error",
    r"prior stands|say nothing about": "not informed by the data (posterior = prior)",
    r"borne out|parts left out": "passes cross-validation",
    r"told (apart|from)|cannot tell": "is not identifiable, distinguishable, significant",
    r"\bcalls? for\b": "the data favour",
    r"misses something|more than noise would": "exceed the noise: the model is incomplete",
    r"straight lines": "interpolated linearly",
    r"held flat": "clipped",
    r"cut[- ]off\b": "truncated",
    r"everything that is drawn": "random seed",
    r"speaks of": "mentions",
}
"""What the glossary replaces, and by what."""


def sentences(path: Path) -> list[tuple[int, str]]:
    """Return the texts of a file that are no docstrings, with their lines; values as `{}`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    no_text = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [p.value if isinstance(p, ast.Constant) else "{}" for p in node.values]
            no_text |= {id(part) for part in ast.walk(node)}
            found.append((node.lineno, "".join(map(str, parts))))
    found += [
        (node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in no_text
    ]
    return [(line, text) for line, text in found if " " in text.strip()]


@pytest.mark.parametrize("room", ROOMS)
def test_sentences_use_the_terms_of_the_glossary(room):
    files = sorted((ROOT / room).rglob("*.py"))
    texts = [(path, line, text) for path in files for line, text in sentences(path)]
    assert len(texts) > 20  # a room without sentences would pass unread
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {text!r} (write: {term})"
        for path, line, text in texts
        for pattern, term in OTHER_TERMS.items()
        if re.search(pattern, text)
    ]
    assert wrong == []


def test_the_words_are_found_where_they_stand(tmp_path):
    file = tmp_path / "said.py"
    file.write_text('"""The ranges."""\nsaid = f"the {2} ranges "  \\\n    "are wide"\n')
    assert sentences(file) == [(2, "the {} ranges are wide")]


HEATRUN = Path(str(resources.files("heatrun")))
STORED = Path(__file__).parents[1] / "stored" / "fit-1.json"
DISCOVERY = STORED.with_name("discovery-2.json")
STATES_ENGLISH = (
    "runs/verdict.py", "runs/duties.py", "runs/machine.py", "runs/ratings_figures.py",
    "runs/figures_of_draws.py",
)  # fmt: skip
"""Where the sentences are made that a run states in English."""
SAYS_FINDINGS = (
    "posterior/fit_checks.py", "checks/excitation.py", "effects/found.py", "fit/fit.py",
)  # fmt: skip
"""Where all sentences of findings are in the table."""


@pytest.fixture(scope="module")
def result():
    text = STORED.read_text(encoding="utf-8").replace(" degC", " °C")  # as conditions are now
    return from_json(text.encode(), FitResult, "fit.json", str(STORED))


def test_every_text_stands_in_all_languages_with_the_same_fields():
    for key, row in table().items():
        assert len(row) == len(LANGUAGES), key
        fields = [set(re.findall(r"\{(\w+)", text)) for text in row]
        assert fields[0] == fields[1] == fields[2], key
        assert all(row) or key in ("findings_in_english", "rest_in_english"), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_text_can_be_said(language):
    """Whatever its fields are called: one of them is `key`."""
    say = Texts(language)
    for key, row in table().items():
        fields = {name: "1.5" for name, _ in FIELD.findall(row[0])}
        assert not FIELD.search(say(key, **fields)), key


def test_every_text_that_a_page_asks_for_is_in_the_table():
    asked = set()
    modules = (*HEATRUN.glob("reports/**/*.py"), *HEATRUN.parent.glob("heatrun_reports/**/*.py"))
    for path in modules:
        asked |= set(re.findall(r"\bsay\(\s*\"(\w+)\"", path.read_text(encoding="utf-8")))
    for name, labels in (("sheet", LABELS), ("discovery", discovery.LABELS)):
        text = (HEATRUN / f"reports/templates/{name}.typ").read_text(encoding="utf-8")
        assert set(re.findall(r"\bt\.([a-zA-Z]\w+)", text)) <= set(labels)
        asked |= set(labels)
    assert len(asked) > 80
    assert asked <= set(table())


def _words(path: Path) -> set[str]:
    """Return what stands between the fields of the texts of a module.

    Docstrings, what is raised, and shapes of arrays are left out.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    raised = {id(n) for node in ast.walk(tree) if isinstance(node, ast.Raise | ast.Subscript)
              for n in ast.walk(node)}  # fmt: skip
    said = [node for node in ast.walk(tree)
            if id(node) not in raised and not isinstance(node, ast.Expr)]  # fmt: skip
    texts = [each for node in said for each in ast.iter_child_nodes(node)
             if isinstance(each, ast.Constant) and isinstance(each.value, str)]  # fmt: skip
    found = {text.value.strip(" .,:;()") for text in texts}
    return {text for text in found if text.count(" ") >= 2}


@pytest.mark.parametrize("module", STATES_ENGLISH + SAYS_FINDINGS)
def test_what_a_run_states_and_its_findings_say_is_in_the_table(module):
    english = [FIELD.sub("{}", row[0]) for row in table().values()]
    parted = SENTENCES if module in SAYS_FINDINGS else re.compile(", ")
    words = _words(HEATRUN / module)
    pieces = {piece.strip(" .") for text in words for piece in parted.split(text)}
    assert pieces
    assert not {text for text in pieces if not any(text in row for row in english)}


def test_keys_of_the_table_are_those_of_one_section():
    keys = Counter(key for section in texts._sections().values() for key in section)
    assert [key for key, times in keys.items() if times > 1] == []


SAID_AGAIN = {
    "sampling", "time_jitter", "time_gap", "no_heating", "start_not_in_equilibrium",
    "ambient_moving", "single_step", "too_short", "resolution", "truncation",
}  # fmt: skip
"""Findings of records that are said again whole."""


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_findings_of_a_record_are_said_again(language):
    say, seen = Texts(language), set()
    for record in _odd_records():
        for finding in check_record(record, load_motor(DATA / "motor.toml")):
            if finding.id in SAID_AGAIN:
                line, is_whole = told(finding, say)
                assert is_whole, finding.message
                assert not re.search(r"\d\.\d|\b(the|and|is)\b", line), line
                seen.add(finding.id)
    assert seen == SAID_AGAIN
    assert not say.unknown


def _odd_records():
    """A staircase of one level that starts warm, coarse readings, and a cool-down."""
    time_s = np.arange(0.0, 3600.0, 20.0)
    time_s = np.delete(time_s, slice(60, 69)) + 4.0 * np.arange(171) % 12.0
    warms = 80.0 * (1.0 - np.exp(-time_s / 4000.0))
    one = np.ones(time_s.size)
    load = {"phase_current_A": 100.0 * one, "losses_W": 500.0 * one, "speed_rpm": 3000.0 * one}
    base = {"time_s": time_s, "ambient_degC": 20.0 + 3.0 * time_s / 3600.0}
    yield Record("warms", {**base, **load, "winding_degC": np.floor(28.0 + warms)})
    yield Record("level", {**base, **load, "ambient_degC": 20.25 * one,
                           "winding_degC": np.floor(20.25 + warms)})  # fmt: skip
    cools = 20.0 + 40.0 * np.exp(-time_s / 90.0) + 40.0 * np.exp(-time_s / 1500.0)
    idle = {key: 0.0 * values for key, values in load.items()}
    yield Record("cools", {**base, **idle, "winding_degC": cools})


def test_meanings_and_names_of_the_networks_and_effects_are_in_the_table():
    forms = [network_named(name) for name in SHIPPED]
    stated = [*USES.values(), *DOUBTS.values(), *(form.title for form in forms)]
    stated += meanings().values()
    stated += [p.meaning for form in forms for p in form.parameters]
    stated += [q.meaning for kind in EFFECTS for q in kind.card.parameters.values()]
    stated += [kind.card.separating_test for kind in EFFECTS]
    for language in LANGUAGES[1:]:
        say = Texts(language)
        for text in stated:
            assert say.again(text) != text, text
        assert not say.unknown


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_laws_of_effects_have_no_english_words(language):
    say = Texts(language)
    for kind in EFFECTS:
        law = say("law_words", law=kind.card.law)
        assert not re.search(r"\b(the|speed|heats?|splits|for|over|under|adds)\b|\d\.\d", law)


def test_figures_have_decimal_commas():
    say = Texts("it")
    figure = pairs({"Req_w": np.linspace(0.11, 0.19, 9)}, {"Req_w": "K/W"}, say)
    figure.draw_without_rendering()
    assert all("," in label.get_text() for label in figure.axes[0].get_xticklabels())


def variants(result):
    """Results whose pages say what pages can say."""
    model = result.models["second"]
    name = result.tests[0].name

    def with_model(**changes):
        models = {**result.models, "second": replace(model, **changes)}
        return replace(result, models=models)

    def told(*findings):
        return replace(result, findings=findings)

    weak = {n: replace(p, identifiability="weak") for n, p in model.parameters.items()}
    lost = {n: replace(p, identifiability="not identifiable") for n, p in model.parameters.items()}
    yield result
    yield replace(result, verdict=replace(result.verdict, order="first"))
    yield replace(result, verdict=replace(result.verdict, order="undecided"))
    yield replace(result, verdict=replace(result.verdict, log_bayes_factor=3.0))
    yield with_model(result="not_converged")
    yield with_model(parameters=weak)
    yield with_model(parameters={**model.parameters, "Ceq_w": lost["Ceq_w"]})
    yield with_model(parameters=lost)
    missed = [MaybeMissing(id=id, test=test, probability=0.3, with_effect={}, without={})
              for id, test in (("radiation", None), ("cooling_step", name))]  # fmt: skip
    yield with_model(maybe_missing=tuple(missed))
    yield with_model(posterior=replace(model.posterior, is_sound=False))
    yield with_model(residuals=tuple(replace(row, rmse_K=15.0) for row in model.residuals))
    yield with_model(residuals=tuple(replace(row, coverage_95=0.5) for row in model.residuals))
    yield told(Finding("simulated_by_heatrun", "warning", "It was.", test=name))
    yield told(*(Finding(id, "warning", "Odd.", test=name) for id in DOUBTS))
    yield told(Finding("missing_effect", "warning", "It lacks one."),
               Finding("step_failed", "error", "It failed."))  # fmt: skip
    yield told(Finding("prior_conflict", "warning", "Far.", values={"Rs0": 1.0, "prior_sd": 5.0}))


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_a_page_says_nothing_in_english(result, language):
    say = Texts(language)
    for each in variants(result):
        sheet_content(each, Certificate(), say)
    assert not say.unknown


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_a_report_of_a_discovery_says_nothing_in_english(language):
    say = Texts(language)
    first = from_json(DISCOVERY.read_bytes(), DiscoveryResult, "discovery.json", str(DISCOVERY))
    better = tuple(
        replace(effect, rivals=tuple(replace(r, reason=f"{effect.id} explains the tests better")
                                     for r in effect.rivals))
        for effect in first.effects
    )  # fmt: skip
    test = ProposedTest(
        separates=("radiation", "cooling_step"), what=next(iter(DUTIES)), profile=(),
        start="cold: at the temperature of the room", expected_log_bayes_factor=4.0,
    )  # fmt: skip
    left = (
        "a slow misfit of 0.52 K (means over 20 min, less what noise leaves in them) in an RMSE of "
        "0.61 K"
    )
    sentences = (
        "Missing: radiation and cooling_step. So extended, the network leaves 0.05 K in a fit by "
        "least squares, no more than noise.",
        "Missing was radiation and cooling_step; with it only noise is left.",
        "Missing: radiation, allowing for sensor_lag and ambient_drift. So extended, the network "
        "leaves 0.05 K in a fit by least squares, no more than noise.",
        f"The network leaves {left} that no effect of the catalogue accounts for. Next: heatrun "
        "discover motor.toml a.csv --model three",
        f"radiation and cooling_step explain 0.30 of 0.82 K of slow misfit and stay in the model; "
        f"{left} of housing_degC is left that no effect of the catalogue accounts for. Next: "
        "heatrun discover motor.toml a.csv --model three",
    )
    reasons = (
        "", "in the place of radiation it has a probability of 12 %",
        "in the place of radiation it has a probability of below 0.1 %",
        "at its usual size these tests would show 0.013 K of it, 0.4 standard deviations of a "
        "noise of 0.05 K",
        "needs the channel speed_rpm in every test",
    )  # fmt: skip
    for sentence in sentences:
        candidates = tuple(replace(first.candidates[0], reason=reason) for reason in reasons)
        result = replace(first, sentence=sentence, effects=better, next_test=test,
                         candidates=candidates)  # fmt: skip
        content = discovery.report_content(result, say)
        content["labels"] = list(content["labels"].values())
        told = json.dumps({**content, "version": ""}, ensure_ascii=False)
        assert not re.search(r"\d\.\d|\b(the|and|is|of)\b", told), told
    assert not say.unknown


@pytest.mark.parametrize(
    ("language", "expected"),
    [
        ("de", "Zweite Ordnung mit rotor_node, sensor_lag und speed_cooling, zugelassen auch "
         "radiation und ambient_drift. "),
        ("it", "Secondo ordine con rotor_node, sensor_lag e speed_cooling, ammettendo anche "
         "radiation e ambient_drift. "),
    ],
)  # fmt: skip
def test_a_headline_tells_what_is_named_from_what_is_allowed_for(result, language, expected):
    name = favoured(result)
    ids = ("rotor_node", "radiation", "sensor_lag", "ambient_drift", "speed_cooling")
    effects = tuple(EffectInModel(id=each, law="", parameters=()) for each in ids)
    model = replace(result.models[name], title="second order", effects=effects)
    model = model.allowing_for(["radiation", "ambient_drift"])
    allowing = replace(result, models={**result.models, name: model})
    said = headline(allowing).sentence
    assert said.startswith("Second order with rotor_node, sensor_lag and speed_cooling, allowing "
                           "for radiation and ambient_drift. ")  # fmt: skip
    assert Texts(language).again(said).startswith(expected)


def test_numbers_have_the_decimal_sign_of_the_language(result, tmp_path):
    stated = Certificate(number="7.5", language="de")
    content = sheet_content(result, stated)
    page = content["certificate"]
    assert page["parameters"][2][2] == "0,1448 ± 0,0032 K/W"
    assert ["Zertifikat Nr.", "7.5"] in page["identification"]
    assert not re.search(r"\d\.\d", json.dumps([content["tests"], content["residuals"],
                                              content["derived"], page["reasons"]]))  # fmt: skip
    text = PdfReader(write_pdf(content, [], tmp_path / "sheet.pdf")).pages[0].extract_text()
    assert "Wärmekapazität der Wicklung" in text
    assert "Seite 1 von" in text
    italian = sheet_content(result, replace(stated, language="it"))
    assert "0,1448 ± 0,0032 K/W" in json.dumps(italian, ensure_ascii=False)


@pytest.mark.parametrize(
    ("language", "started"),
    [("en", "150A cold, 300Ax5@0 hot"), ("de", "150A kalt, 300Ax5@0 warm"),
     ("it", "150A a freddo, 300Ax5@0 a caldo")],
)  # fmt: skip
def test_a_rating_from_cold_or_hot_says_so_in_the_language_of_the_sheet(result, language, started):
    model = result.models["second"]
    entry = model.derived["tau_winding_s"]
    names = ("time_to_limit_150A_cold_s", "starts_300Ax5@0_hot")
    derived = {**model.derived, **dict.fromkeys(names, entry)}
    models = {**result.models, "second": replace(model, derived=derived)}
    content = sheet_content(replace(result, models=models), Certificate(language=language))
    named = [row[0].partition(", ")[2] for row in content["derived"]]
    assert ", ".join(named[-2:]) == started


def test_what_the_sheet_was_made_by_is_said_in_its_language(result):
    labels = [
        [label for label, _ in sheet_content(result, Certificate(language=each))["meta"]]
        for each in LANGUAGES
    ]
    assert labels == [
        ["heatrun", "command", "seed"],
        ["heatrun", "Befehl", "Startwert"],
        ["heatrun", "comando", "seme"],
    ]


def test_findings_in_english_are_called_so_in_the_language(result):
    finding = Finding("odd", "warning", "Something is odd.")
    odd = replace(result, findings=(finding,))
    assert "englischer Sprache" in sheet_content(odd, Certificate(language="de"))["after_findings"]
    assert sheet_content(odd, Certificate())["after_findings"] == ""
    assert sheet_content(odd, Certificate(language="it"))["graver"] == [
        ["avviso", "Something is odd."]
    ]


def test_a_finding_that_is_known_is_said_again_sentence_by_sentence(result):
    finding = Finding(
        "misfit", "warning", "the second-order network is incomplete: its residuals are correlated "
        "over more than 600 s; its slow residuals have 3.5 times the variance of noise. The 95 % "
        "intervals allow for slow heat of this size, not for every cause.", "duty, 0.0 s to 9.5 s",
        "Search for the missing effect with `heatrun discover`.",
    )  # fmt: skip
    content = sheet_content(replace(result, findings=(finding,)), Certificate(language="de"))
    assert content["after_findings"] == ""
    assert content["graver"][0][1] == (
        "duty, 0,0 s bis 9,5 s: Das Netzwerk zweiter Ordnung ist unvollständig: seine Residuen "
        "hängen über mehr als 600 s zusammen; seine langsamen Residuen haben die 3,5-fache Varianz "
        "des Rauschens. Die 95-%-Intervalle berücksichtigen langsame Wärme dieser Größe, nicht "
        "jede Ursache. Den fehlenden Effekt mit `heatrun discover` suchen."
    )


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_what_small_effects_would_move_is_said_in_the_language(language):
    say = Texts(language)
    told = say.sentences(
        "the residuals of the second-order network hold more than noise (p < 4.1e-05, the share of "
        "clean records that would look so), too little for a name. The 95 % intervals allow for "
        "radiation (50 %), cooling_step in a (26 %). With them, on the mean: Req_sr 13 % higher, "
        "Ceq_w 5.2 % lower."
    )
    assert told is not None
    assert "Req_sr 13 % " in told
    assert "Ceq_w 5,2 % " in told
    assert not re.search(r"\b(higher|lower|the|with)\b", told)
    assert not say.unknown


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_the_workbook_says_in_the_language_where_priors_come_from(result, language):
    say, model = Texts(language), result.models["second"]
    entries = [*model.parameters.values(), *model.nuisances.values()]
    told = [text for one in entries for text in (one.prior_basis, *SENTENCES.split(one.why or ""))]
    told += [f"{node} temperature at the start" for node in ("winding", "stator", "rotor")]
    told += ["hardly distinguishable from rotor_node.P (correlation -0.84).",
             "Extending the last load to 2 h would give ±51.5 % (95 %).",
             "plausible from 171 to 4.56e+03 s", "plausible from -0.3 to 1.5"]  # fmt: skip
    assert all(say.again(text) != text for text in told if text)
    assert not say.unknown


def test_a_finding_stands_under_what_it_means_in_the_language(result):
    gap = replace(result, findings=(Finding("time_gap", "warning", "It has a gap."),))
    for language, said in (
        ("en", "It has a gap."),
        ("de", "Die Aufzeichnung hat eine Lücke. It has a gap."),
    ):
        content = sheet_content(gap, Certificate(language=language))
        assert content["graver"][0][1] == said


ROAD = [DATA / "prototypes" / f"{name}_2024_03_05_001.csv.gz" for name in ("Test", "Road")]


@pytest.mark.parametrize("kind", ["general", "energy", "thermal", "real", "energy of a pump"])
def test_titles_labels_heads_and_captions_of_reports_are_in_the_table(kind, tmp_path, monkeypatch):
    if kind != "general":  # one page is set, that of the others is not
        monkeypatch.setattr(job, "write_pdf", lambda _, __, path, ___: path.write_bytes(b"%PDF"))
    motor = load_motor(DATA / "prototypes" / "motor.toml")
    reference = ROAD[1] if kind == "real" else None
    tests = ROAD[:1]
    if "pump" in kind:  # no vehicle
        tests = [tmp_path / "pump.csv"]
        table = pd.read_csv(ROAD[0]).drop(columns="vehicle_speed_km_per_h")
        table.to_csv(tests[0], index=False)
        motor = replace(motor, gear_ratio=None, wheel_radius_m=None)
    asked = kind.split(" ")[0]
    (made,) = make_report(asked, motor, tests, tmp_path, reference=reference, language="it")
    english, said = (
        document_content(made.report, made.content, Texts(each)) for each in ("en", "it")
    )
    pairs = [(english[key], said[key]) for key in ("title", "heading")]
    pairs += [(one[0], other[0]) for one, other in zip(english["rows"], said["rows"], strict=True)]
    pairs += zip(english["captions"], said["captions"], strict=True)
    for one, other in zip(english["tables"], said["tables"], strict=True):
        heads = zip([one["title"], *one["head"]], [other["title"], *other["head"]], strict=True)
        lines = zip(one["lines"], other["lines"], strict=True)
        pairs += [*heads, *((a[0], b[0]) for a, b in lines)]
    pairs += zip([english["summary"]], [said["summary"]], strict=True)
    pairs += [(a[1], b[1]) for a, b in zip(english["definitions"], said["definitions"], strict=True)
              if not re.match("P_Js = |v = ", a[1])]  # fmt: skip
    same = {a for a, b in pairs if a == b and not re.fullmatch(r"\d+ … \d+ %", a)}
    assert same <= {"", "RMSE"}
    say = Texts("it")
    for drawing in made.report.drawings:
        figure = again(drawing.draw(), say)
        figure.draw_without_rendering()
        for axes in figure.axes:
            assert axes.yaxis.label.get_window_extent().x0 >= 0.0, axes.get_ylabel()
    assert say.unknown <= {*SYMBOLS}
    if kind == "general":
        text = "".join(page.extract_text() for page in PdfReader(made.pdf).pages)
        assert "pagina 1 di" in text
        assert "senza traduzione" not in " ".join(text.split())
    assert said["remark"] == ""


def test_a_report_is_in_the_language_of_the_certificate_and_no_range_of_load_breaks(tmp_path):
    motor = Motor("Pumpe", certificate=Certificate(language="de"))
    file, time_s = tmp_path / "Pumpe.csv", np.arange(400)
    torque = np.repeat([0, 20, 60, 100], 100)
    lines = ["time_s;speed_rpm;torque_Nm;electrical_power_W"]
    lines += [f"{t};955,5;{M},0;{125 * M},5" for t, M in zip(time_s, torque, strict=True)]
    file.write_text("\n".join(lines))
    (made,) = make_report("energy", motor, [file], tmp_path / "out")
    text = "".join(page.extract_text() for page in PdfReader(made.pdf).pages)
    assert "Wirkungsgrad als Motor" in text
    assert "Text, ';', Dezimalkomma, UTF-8" in text
    assert "50 … 75 %" in text
    (made,) = make_report("energy", motor, [file], tmp_path / "out", language="en")
    assert "decimal comma" in "".join(page.extract_text() for page in PdfReader(made.pdf).pages)


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_a_report_on_prototypes_says_nothing_in_english(language):
    motor = load_motor(DATA / "prototypes" / "motor.toml")
    roles = dict(zip(("semi-real", "real"), ROAD, strict=True))
    report = prototypes_report(motor, read_prototypes(list(roles.items()), motor))
    say = Texts(language)
    content = document_content(report, report_content(report, None), say)
    for drawing in report.drawings:
        again(drawing.draw(), say)
    names = {path.name.removesuffix(".csv.gz") for path in ROAD}
    assert say.unknown == {*roles, *names, "real − semi-real"}
    assert content["remark"] == ""
    lines = {line[0]: line[1:] for line in content["tables"][0]["lines"]}
    assert lines[say("came_about")] == [say("came_measured")] * 2
    assert lines[say("num_of_samples")] == ["5321", "1064"]


def test_a_report_says_that_texts_stay_in_english_and_the_worst_finding_first():
    motor = load_motor(DATA / "prototypes" / "motor.toml")
    report = build_report("general", motor, read_test(ROAD[0], motor))
    odd = [Finding("odd", each, "Something is odd.") for each in ("note", "warning", "error")]
    content = document_content(replace(report, findings=tuple(odd)), {}, Texts("de"))
    assert [line[0] for line in content["findings"]] == ["Fehler", "Warnung", "Hinweis"]
    assert "englischer Sprache" in content["remark"]
