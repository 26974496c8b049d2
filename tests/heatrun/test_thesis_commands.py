"""Every command of the page on the thesis is one that the command line takes."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from heatrun.cli import _parser
from heatrun_reports.prototypes.prototype import parse_roles

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "thesis_commands.md").read_text("utf-8")
FOLDERS = {"$P": "data/synthetic/prototypes", "$D": "data/synthetic", "$O": "results/runs/thesis"}


def commands() -> list[str]:
    """The commands of the page that are written out."""
    found = [text for text in re.findall(r"`([^`\n]+)`", PAGE) if re.match(r"heatrun \S+ \S", text)]
    return [text for text in dict.fromkeys(found) if "…" not in text and "\\|" not in text]


@pytest.mark.parametrize("text", [c for c in commands() if "--help" not in c])
def test_the_command_is_taken_and_its_bundled_files_are_there(text):
    for name, folder in FOLDERS.items():
        text = text.replace(name, folder)
    words = shlex.split(text)[1:]
    options = _parser().parse_args(words)
    if getattr(options, "kind", "") == "prototypes":
        assert len(parse_roles([str(test) for test in options.tests])) == 3
    for word in words:
        path = word.partition("=")[2] or word
        if path.startswith("data/"):
            assert (ROOT / path).exists(), path


def test_every_numbered_part_of_the_three_chapters_has_its_rows():
    parts = ["Chapter 2", "Chapter 3", *(f"4.{n} " for n in range(1, 7))]
    for part in parts:
        (rows,) = re.findall(rf"^## {re.escape(part)}.*?\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M)
        assert rows.count("\n| ") >= 3, part
    assert PAGE.count("*not covered*") >= 3  # what is not is said
