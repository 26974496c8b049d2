"""Sentences of the product use the terms of the field, one word for each idea."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import heatrun

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
