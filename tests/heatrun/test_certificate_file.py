"""What `[certificate]` and `--meta` may say, and what is refused with a sentence."""

from __future__ import annotations

import re

import pytest

from heatrun.errors import InputError
from heatrun.motor.certificate import load_meta, parse_meta
from heatrun.motor.file import parse_motor
from heatrun.record.motor import Certificate, Instrument, Motor
from heatrun.runs.motor_text import motor_text

FULL = """
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
    found = parsed(FULL)
    assert (found.number, found.operator, found.approved_by) == ("2026-0147", "A. Ångström", "李")
    assert (found.test_from, found.test_until) == ("2026-03-04", "2026-03-05")
    assert found.country == "IT"
    assert found.instruments == (
        Instrument(quantity="current", accuracy_class="0.2", valid_until="2027-01-31"),
        Instrument(instrument="PT100"),
    )
    assert found.customer == ""


def test_the_keys_may_stand_below_their_heading_or_not():
    sections = FULL.replace("[[instruments]]", "[[certificate.instruments]]")
    assert parsed(f"[certificate]\n{sections}") == parsed(FULL)


def test_the_motor_file_has_the_same_section_and_the_run_keeps_it():
    sections = FULL.replace("[[instruments]]", "[[certificate.instruments]]")
    text = f'[motor]\nname = "M"\n[certificate]\n{sections}'
    motor = parse_motor(text.encode(), "motor.toml")
    assert motor.certificate == parsed(FULL)
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
