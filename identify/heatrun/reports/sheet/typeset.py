"""Documents set by Typst from a template and plain data; data never become markup."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import typst

from ...io.whole_files import PARTIAL, write_whole
from .glyphs import shown

TEMPLATES = resources.files("heatrun.reports.sheet") / "templates"
"""Of sheets and of discoveries; other documents have theirs beside their modules."""

SCALE = TEMPLATES / "scale.typ"
"""Sizes and tables that all documents share."""


def typeset(
    template: Traversable, content: Mapping[str, Any], figures: Sequence[Path], path: Path
) -> Path:
    """Set a document as PDF.

    Args:
        template: The file; it reads `content.json`.
        content: Strings, numbers, lists and objects; `figures` is added, the file names.
        figures: PNG files, in the order in which they are to appear.
        path: Where it goes; written whole or not at all.
    """
    # beside the document, so that the next start in the folder clears it away after a kill
    beside = {"dir": path.parent, "prefix": f".{path.name}.", "suffix": PARTIAL}
    with tempfile.TemporaryDirectory(**beside) as name:
        folder = Path(name)
        found = shown(content)
        lay_out(folder, template, found.content, figures)
        document = typst.compile(
            folder / template.name, root=folder, ignore_system_fonts=not found.needs_system_fonts
        )
    assert isinstance(document, bytes)
    write_whole(path, document)
    return path


def lay_out(
    folder: Path, template: Traversable, content: Mapping[str, Any], figures: Sequence[Path]
) -> None:
    """Put what a document is set from into a folder: templates, `content.json`, figures.

    Args:
        folder: Where it goes.
        template: The file.
        content: As `typeset` takes it, every character one that the fonts have.
        figures: Files of images, in their order.
    """
    for each in (template, SCALE):
        (folder / each.name).write_text(each.read_text(encoding="utf-8"), encoding="utf-8")
    names = [f"figure_{number}{figure.suffix}" for number, figure in enumerate(figures)]
    for figure, name in zip(figures, names, strict=True):
        shutil.copyfile(figure, folder / name)
    # strings read from JSON are values in Typst: nothing in a name can act as markup
    text = json.dumps({**content, "figures": names})
    (folder / "content.json").write_text(text, encoding="utf-8")
