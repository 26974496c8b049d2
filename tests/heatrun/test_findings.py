"""The register of findings: every id is in it, nothing else is, and the page says the same."""

from __future__ import annotations

import ast
from pathlib import Path

import heatrun
from heatrun.record.findings import FINDINGS, TITLE, page

CORE = Path(heatrun.__file__).parent
PAGE = Path(__file__).parents[2] / "docs" / "findings.md"


def texts(node):
    """Yield the texts that an expression may be: of a conditional, both."""
    for each in ast.walk(node):
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            yield each.value


def ids():
    """Yield the ids of the findings that the code of the core makes, with their place."""
    for path in CORE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                named = [each.value for each in node.keywords if each.arg == "id"]
                (id,) = named or node.args[:1]
                if not isinstance(id, ast.Name):  # a constant of the module, or an argument
                    test = {*texts(id.test)} if isinstance(id, ast.IfExp) else set()
                    yield from ((each, path.name) for each in texts(id) if each not in test)


def test_every_finding_is_in_the_register():
    found = dict(ids())
    assert len(found) > 50
    assert not {id: place for id, place in found.items() if id not in FINDINGS}


def test_the_register_holds_no_other():
    text = "".join(path.read_text("utf-8") for path in CORE.rglob("*.py")
                   if path.name != "findings.py")  # fmt: skip
    assert not [id for id in FINDINGS if f'"{id}"' not in text]


def test_the_page_is_that_of_the_register():
    assert PAGE.read_text("utf-8") == TITLE + page(FINDINGS.items()), "run `make docs`"
