"""What `[certificate]` and `--meta` may say, and the Digital Calibration Certificate made of it."""

import copy
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from dcc_structure import DCC, SI, against_practice, violations

from heatrun.errors import InputError
from heatrun.motor.certificate import load_meta, parse_meta
from heatrun.motor.file import parse_motor
from heatrun.record.motor import Certificate, Instrument, Motor
from heatrun.reports.dcc import dcc_text
from heatrun.reports.dcc_schema import validate
from heatrun.results import FitResult, from_json
from heatrun.runs.write import motor_text
from lptn.effects import EFFECTS

META = """
number = "2026-0147"
laboratory = "Bench 3"
operator = "A. Ångström"
approved_by = "李"
test_from = 2026-03-04
test_until = "2026-03-05"
country = "it"
performed_at = "laboratory"

[[instruments]]
quantity = "current"
class = "0.2"
valid_until = 2027-01-31

[[instruments]]
instrument = "PT100"
"""


def parsed(text: str) -> Certificate:
    return parse_meta(text.encode(), "meta.toml")


def test_names_days_and_instruments_are_read():
    found = parsed(META)
    assert (found.number, found.operator, found.approved_by) == ("2026-0147", "A. Ångström", "李")
    assert (found.test_from, found.test_until) == ("2026-03-04", "2026-03-05")
    assert found.country == "IT"
    assert found.instruments == (
        Instrument(quantity="current", accuracy_class="0.2", valid_until="2027-01-31"),
        Instrument(instrument="PT100"),
    )
    assert found.customer == ""


def test_the_keys_may_stand_below_their_heading_or_not():
    sections = META.replace("[[instruments]]", "[[certificate.instruments]]")
    assert parsed(f"[certificate]\n{sections}") == parsed(META)


def test_the_motor_file_has_the_same_section_and_the_run_keeps_it():
    sections = META.replace("[[instruments]]", "[[certificate.instruments]]")
    text = f'[motor]\nname = "M"\n[certificate]\n{sections}'
    motor = parse_motor(text.encode(), "motor.toml")
    assert motor.certificate == parsed(META)
    assert parse_motor(motor_text(motor), "run").certificate == motor.certificate


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[certificate]\n",
        'customer = ""\noperator = "  "\nissue_date = ""\ncountry = ""\nperformed_at = ""',
        '[[instruments]]\nquantity = ""\nvalid_until = ""',
    ],
)
def test_an_empty_block_states_nothing(text):
    assert parsed(text) == Certificate()
    assert b"certificate" not in motor_text(Motor("M", certificate=parsed(text)))


def test_an_empty_cell_of_an_instrument_stays_empty():
    (one,) = parsed('[[instruments]]\nquantity = "current"\ninstrument = ""').instruments
    assert one == Instrument(quantity="current")


def test_an_empty_text_leaves_that_of_the_motor_file():
    assert Certificate(customer="C").beneath(parsed('customer = ""')).customer == "C"


def test_a_file_goes_before_the_motor_file_key_by_key():
    below = Certificate(number="1", customer="C", instruments=(Instrument("current"),))
    above = Certificate(number="2", laboratory="L")
    expected = Certificate(
        number="2", laboratory="L", customer="C", instruments=(Instrument("current"),)
    )
    assert below.beneath(above) == expected


def test_a_name_is_kept_to_the_letter_on_one_line():
    name = "#panic() $a_1$ *b* <script> & \\\\ ]]> שלום می\u200cخواهم"
    assert parsed(f'customer = "{name}"').customer == name.replace("\\\\", "\\")
    assert parsed('customer = """Line one\n  line\ttwo"""').customer == "Line one line two"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nummer = 1", "The key 'nummer' is not known. Did you mean 'number'"),
        ("number = 17", "Expected a text for number, got the number 17."),
        (f'operator = "{"x" * 121}"', "Expected at most 120 letters for operator, got 121."),
        ('operator = "a\\u001Bb"', "characters that can be printed for operator, got U+001B"),
        ('operator = "a\\u202Eb"', "got U+202E"),
        ('issue_date = "9.3.2026"', "Expected a day for issue_date, got the text '9.3.2026'."),
        ('issue_date = "2026-02-30"', "Expected a day for issue_date"),
        ("issue_date = 2026-03-09T10:00:00", "Expected a day for issue_date"),
        ('test_from = "2026-03-04"\ntest_until = "2026-03-03"', "lies before test_from"),
        ('country = "Italy"', "two letters of a country"),
        ('performed_at = "labratory"', "Did you mean 'laboratory'"),
        ("instruments = 3", "Expected a table for each instrument, got the number 3."),
        ('[[instruments]]\nclas = "1"', "The key 'clas' is not known. Did you mean 'class'?"),
        ("[[instruments]]\nclass = 0.2", "Expected a text for class, got the number 0.2."),
        ("certificate = 3", "Expected a section, got the number 3."),
        ("[certificate]\n[motor]", "The section 'motor' is not known."),
        ("number = ", "no valid TOML"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(text, message):
    with pytest.raises(InputError, match=re.escape(message)) as error:
        parsed(text)
    assert "meta.toml" in str(error.value)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml"):
        load_meta(tmp_path / "none.toml")


STORED = Path(__file__).parents[1] / "stored" / "fit-1.json"

STATED = Certificate(
    number="2026-0147", laboratory="Bench 3", laboratory_address="Corso Duca 24, Torino",
    customer="Example Motors", customer_address="Via Roma 1, Torino", serial_number="SN 0042",
    operator="A. Ångström", approved_by="李", performed_at="laboratory", country="IT",
    test_from="2026-03-04", test_until="2026-03-05",
    instruments=(Instrument("current", "IT 400", "0.2", "LAT 139", "2027-01-31"),),
)  # fmt: skip

HOSTILE = '#panic() $a_1$ <script> & "q" ]]> <?xml?> --> Ångström 李 שלום'


@pytest.fixture(scope="module")
def result():
    return from_json(STORED.read_bytes(), FitResult, "fit.json", str(STORED))


def tree_of(result, certificate=STATED):
    return ElementTree.fromstring(dcc_text(result, certificate))


def texts(root, name):
    return [each.text for each in root.iter(f"{DCC}{name}")]


def test_it_has_the_structure_of_the_schema(result):
    root = tree_of(result)
    assert (violations(root), against_practice(root)) == ([], [])
    assert root.get("schemaVersion") == "3.3.0"


def test_the_structure_would_be_missed(result):
    """The table of the schema finds an element that is gone, added, moved or empty."""
    whole = tree_of(result)
    core = f"{DCC}administrativeData/{DCC}coreData"
    for change in (
        lambda at: at.remove(at.find(f"{DCC}uniqueIdentifier")),
        lambda at: at.append(copy.deepcopy(at.find(f"{DCC}uniqueIdentifier"))),
        lambda at: at.insert(0, at[-1]),
        lambda at: setattr(at.find(f"{DCC}uniqueIdentifier"), "text", ""),
        lambda at: setattr(at.find(f"{DCC}countryCodeISO3166_1"), "text", "Italy"),
    ):
        broken = copy.deepcopy(whole)
        change(broken.find(core))
        assert violations(broken) != []


def test_the_results_are_those_of_the_sheet(result):
    """Value 663.61 with u 7.4963: U = 15, so 664 ± 15 J/K; by hand from the stored result."""
    reals = {each.findtext(f"{SI}label"): each for each in tree_of(result).iter(f"{SI}real")}
    heat = reals["Ceq_w"]
    assert (heat.findtext(f"{SI}value"), heat.findtext(f"{SI}unit")) == (
        "664",
        "\\joule\\per\\kelvin",
    )
    stated = heat.find(f"{SI}measurementUncertaintyUnivariate/{SI}expandedMU")
    assert [each.text for each in stated] == ["15", "2", "0.95"]
    assert reals["Req_sr"].findtext(f"{SI}unit") == "\\kelvin\\per\\watt"
    assert reals["Req_sr"].findtext(f"{SI}value") == "0.1155"
    of_types = "standard uncertainty 7.5 J/K: type A 6.9 J/K, type B (stated instruments) 2.9 J/K"
    assert any(of_types in (text or "") for text in texts(tree_of(result), "content"))


def test_a_parameter_of_any_effect_can_stand_in_it(result):
    """D-SI: each unit a word with a backslash, powers as tothe{2}, what follows per divides."""
    network = result.models["second"]
    base = network.parameters["Ceq_w"]
    effects = {
        f"{kind.card.id}.{name}": replace(base, unit=quantity.unit, meaning=quantity.meaning)
        for kind in EFFECTS
        for name, quantity in kind.card.parameters.items()
    }
    grown = replace(network, parameters={**network.parameters, **effects})
    root = tree_of(replace(result, models={**result.models, "second": grown}))
    assert (violations(root), against_practice(root)) == ([], [])
    units = {each.findtext(f"{SI}label"): each.findtext(f"{SI}unit")
             for each in root.iter(f"{SI}real")}  # fmt: skip
    assert units["radiation.eA"] == r"\metre\tothe{2}"
    assert units["ambient_drift.d"] == r"\kelvin\per\hour"
    assert units["contact_drift.d"] == r"\per\hour"


def test_a_skewed_quantity_carries_its_interval(result):
    first = replace(result, verdict=replace(result.verdict, order="first"))
    reals = {each.findtext(f"{SI}label"): each for each in tree_of(first).iter(f"{SI}real")}
    held = reals["Ceq"].find(f"{SI}measurementUncertaintyUnivariate/{SI}coverageIntervalMU")
    assert [each.text for each in held] == ["2200", "2200", "10600", "0.95"]


def test_names_stand_there_to_the_letter(result):
    hostile = replace(STATED, customer=HOSTILE, operator=HOSTILE, number=HOSTILE)
    named = replace(result, motor=replace(result.motor, name=HOSTILE + "\x1b[31m\udcff"))
    root = tree_of(named, hostile)
    assert violations(root) == []
    assert root.find(f".//{DCC}customer/{DCC}name/{DCC}content").text == HOSTILE
    assert texts(root, "uniqueIdentifier") == [HOSTILE]
    assert root.find(f".//{DCC}item/{DCC}name/{DCC}content").text.startswith(HOSTILE)


def test_who_approves_it_signs(result):
    assert texts(tree_of(result), "role") == ["approved by", "operator"]
    assert texts(tree_of(result), "mainSigner") == ["true", "false"]
    alone = tree_of(result, replace(STATED, approved_by=""))
    assert (texts(alone, "role"), texts(alone, "mainSigner")) == (["operator"], ["true"])


def test_what_is_missing_is_named_and_not_made_up(result):
    with pytest.raises(InputError) as error:
        dcc_text(result, Certificate())
    for key in ("number", "laboratory_address", "country", "serial_number", "performed_at",
                "approved_by or operator", "test_from"):  # fmt: skip
        assert key in error.value.problem
    with pytest.raises(InputError, match=r"Missing: country\."):
        dcc_text(result, replace(STATED, country=""))


def test_the_days_of_the_records_do_for_those_of_the_certificate(result):
    dated = tuple(replace(test, start=f"2026-03-0{n}") for n, test in enumerate(result.tests, 4))
    root = tree_of(replace(result, tests=dated), replace(STATED, test_from="", test_until=""))
    assert texts(root, "beginPerformanceDate") == ["2026-03-04"]
    assert texts(root, "endPerformanceDate") == ["2026-03-05"]


def test_it_is_validated_by_the_copy_of_the_user(result, tmp_path):
    """A schema of the same names that asks for version 3.3.0 and imports another from afar."""
    pytest.importorskip("xmlschema")
    head = '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" elementFormDefault="qualified"'
    (tmp_path / "SI_Format.xsd").write_text(
        f'{head} targetNamespace="https://ptb.de/si"><xs:element name="real"/></xs:schema>'
    )
    schema = tmp_path / "dcc.xsd"

    def write(version):
        schema.write_text(f"""{head} xmlns:si="https://ptb.de/si"
            targetNamespace="https://ptb.de/dcc">
          <xs:import namespace="https://ptb.de/si"
            schemaLocation="https://ptb.de/si/v2.2.1/SI_Format.xsd"/>
          <xs:element name="digitalCalibrationCertificate"><xs:complexType><xs:sequence>
            <xs:any namespace="##any" processContents="skip" maxOccurs="unbounded"/></xs:sequence>
            <xs:attribute name="schemaVersion" type="xs:string" fixed="{version}"/>
          </xs:complexType></xs:element>
          <xs:element name="uses"><xs:complexType><xs:sequence><xs:element ref="si:real"/>
          </xs:sequence></xs:complexType></xs:element>
        </xs:schema>""")

    document = dcc_text(result, STATED)
    write("3.3.0")
    validate(document, schema)
    write("3.2.1")
    with pytest.raises(InputError, match=r"does not follow the schema.*3\.2\.1"):
        validate(document, schema)
    (tmp_path / "SI_Format.xsd").unlink()
    with pytest.raises(InputError, match="schema cannot be read"):
        validate(document, schema)
