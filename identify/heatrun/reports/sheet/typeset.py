"""Documents set by Typst from a template and plain data; data never become markup."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import typst

from ...io.whole_files import PARTIAL, write_whole
from .glyphs import shown

SCALE = "scale.typ"
"""Sizes and tables that all documents share."""


def typeset(template: str, content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Set a document as PDF.

    Args:
        template: Name of a file among the templates; it reads `content.json`.
        content: Strings, numbers, lists and objects; `figures` is added, the file names.
        figures: PNG files, in the order in which they are to appear.
        path: Where it goes; written whole or not at all.
    """
    # beside the document, so that the next start in the folder clears it away after a kill
    beside = {"dir": path.parent, "prefix": f".{path.name}.", "suffix": PARTIAL}
    with tempfile.TemporaryDirectory(**beside) as name:
        folder = Path(name)
        templates = resources.files("heatrun.reports.sheet") / "templates"
        for each in (template, SCALE):
            text = (templates / each).read_text(encoding="utf-8")
            (folder / each).write_text(text, encoding="utf-8")
        names = []
        for number, figure in enumerate(figures):
            shutil.copyfile(figure, folder / f"figure_{number}.png")
            names.append(f"figure_{number}.png")
        # strings read from JSON are values in Typst: nothing in a name can act as markup
        found = shown(content)
        text = json.dumps({**found.content, "figures": names})
        (folder / "content.json").write_text(text, encoding="utf-8")
        document = typst.compile(
            folder / template, root=folder, ignore_system_fonts=not found.needs_system_fonts
        )
    assert isinstance(document, bytes)
    write_whole(path, document)
    return path
