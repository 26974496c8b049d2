"""The parameter sheet as PDF, set by Typst from a template; data never become markup."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import typst

from ..checkpoint import write_whole
from .content import sheet_content

TEMPLATE = "sheet.typ"


def write_pdf(result: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        result: What stands in `fit.json`.
        figures: PNG files, in the order in which they are to appear.
        path: Where it goes; written whole or not at all.
    """
    content = sheet_content(result)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        template = resources.files("heatrun.sheet") / "templates" / TEMPLATE
        (folder / TEMPLATE).write_text(template.read_text(encoding="utf-8"), encoding="utf-8")
        content["figures"] = []
        for number, figure in enumerate(figures):
            shutil.copyfile(figure, folder / f"figure_{number}.png")
            content["figures"].append(f"figure_{number}.png")
        # strings read from JSON are values in Typst: nothing in a name can act as markup
        (folder / "sheet.json").write_text(json.dumps(content), encoding="utf-8")
        document = typst.compile(folder / TEMPLATE, root=folder, ignore_system_fonts=True)
    assert isinstance(document, bytes)
    write_whole(path, document)
    return path
