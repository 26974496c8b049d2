"""The reference page of the motor file: complete, and generated from the one text."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from heatrun.errors import InputError
from heatrun.motor import keys as motor_page
from heatrun.motor.file import UNITS, parse_motor
from heatrun.motor.keys import BODY_PARTS, PARAMETER_MEANINGS, SECTIONS

PAGE = Path(__file__).parents[2] / "docs" / "motor_file.md"
HEAD = '[motor]\nname = "M"\n'


def accepted(text: str) -> set[str]:
    """What the reader of motor files says that it knows, where it meets a key that it does not."""
    with pytest.raises(InputError, match="is not known") as error:
        parse_motor(text.encode(), "motor.toml")
    return set(re.sub(r"^(Known|Channels) are: |\.$", "", error.value.remedy).split(", "))


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == motor_page.page(), "run `make docs`"


def test_every_section_that_is_accepted_is_explained():
    names = {section.name.partition(".")[0] for section in SECTIONS}
    assert names == accepted(f"{HEAD}[nonsense]\n")


@pytest.mark.parametrize("section", [one for one in SECTIONS if one.keys], ids=lambda one: one.name)
def test_every_key_that_is_accepted_is_explained(section):
    name = section.name.replace("NAME", "Req")
    text = f"[{name}]\nnonsense = 1\n" if name == "motor" else f"{HEAD}[{name}]\nnonsense = 1\n"
    assert {key.name for key in section.keys} == accepted(text)


@pytest.mark.parametrize("section", ["columns", "constants", "sensors"])
def test_every_channel_that_is_accepted_stands_on_the_page(section):
    text = PAGE.read_text(encoding="utf-8")
    named = {f"`{name}`" for name in accepted(f'{HEAD}[{section}]\nnonsense = "1"\n')}
    assert all(name in text for name in named)


@pytest.mark.parametrize("section", [one for one in SECTIONS if one.keys], ids=lambda one: one.name)
def test_every_example_is_accepted(section, tmp_path):
    said = {"Req_sr": {"next_median": 0.1, "next_log_sd": 0.05}}
    for folder in ("fleet", "bench"):
        (tmp_path / folder).mkdir()
    (tmp_path / "fleet" / "population.json").write_text(json.dumps({"parameters": said}))
    where = str(tmp_path / "bench" / "motor.toml")
    name = section.name.replace("NAME", "Req")
    for key in section.keys:
        head = "" if key.name == "name" else HEAD
        lines = f"[{name}]\n" if name != "motor" or not head else ""
        parse_motor(f"{head}{lines}{key.name} = {key.example}\n".encode(), where)


def test_every_parameter_with_a_range_is_explained():
    bodies = {name for name in UNITS if name.rpartition("_")[2] in BODY_PARTS}
    bodies -= set(PARAMETER_MEANINGS)
    assert set(UNITS) - bodies == set(PARAMETER_MEANINGS)
