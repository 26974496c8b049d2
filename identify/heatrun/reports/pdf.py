"""The parameter sheet as PDF, set by Typst from a template and plain data that never become markup.

Letters that no font here can draw stand on paper as their numbers, not as empty boxes.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import typst

from ..io.quantities import with_breaks
from ..io.whole_files import PARTIAL, write_whole

ALWAYS_THERE = 0x250
"""Letters below this number, Latin ones with their accents, are in the font that typst brings."""

PROBE = b"""#let letters = json(bytes(sys.inputs.letters))
#set document(title: "probe")
#set text(font: "Libertinus Serif")
#text(letters)"""


@dataclass(frozen=True)
class Shown:
    """What can be set."""

    content: dict[str, Any]  # With each letter that no font has as `[U+674E]`.
    # Some letters are not in the fonts that typst brings. Only then are those of the machine asked,
    # so that a document is the same on all machines where it can be.
    needs_system_fonts: bool


def shown(content: Mapping[str, Any]) -> Shown:
    """Return the content of a document as the fonts of this machine can show it."""
    letters = {c for c in json.dumps(content, ensure_ascii=False) if ord(c) >= ALWAYS_THERE}
    foreign = _lost(frozenset(letters), brought_alone=True)
    lost = _lost(foreign, brought_alone=False)
    if not lost:
        return Shown(dict(content), bool(foreign))
    table = str.maketrans({c: f"[U+{ord(c):04X}]" for c in lost})
    return Shown(in_texts(content, lambda text: text.translate(table)), bool(foreign))


@cache
def _lost(letters: frozenset[str], *, brought_alone: bool) -> frozenset[str]:
    """Return those of some letters that no font has."""
    if not letters or _can_draw("".join(sorted(letters)), brought_alone):
        return frozenset()
    if len(letters) == 1:
        return letters
    ordered = sorted(letters)
    middle = len(ordered) // 2
    halves = (frozenset(ordered[:middle]), frozenset(ordered[middle:]))
    return frozenset().union(*(_lost(half, brought_alone=brought_alone) for half in halves))


def _can_draw(letters: str, brought_alone: bool) -> bool:
    """Return whether there is a picture for each letter: PDF/A allows no document without."""
    try:
        typst.compile(
            PROBE,
            format="pdf",
            sys_inputs={"letters": json.dumps(letters)},
            pdf_standards=["a-2b"],
            ignore_system_fonts=brought_alone,
        )
    except RuntimeError:
        return False
    return True


def in_texts(value: Any, change: Callable[[str], str]) -> Any:
    """Return a value with every text changed, at any depth of lists and objects."""
    if isinstance(value, str):
        return change(value)
    if isinstance(value, Mapping):
        return {key: in_texts(item, change) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [in_texts(item, change) for item in value]
    return value


TEMPLATES = resources.files("heatrun.reports") / "templates"
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


BREAKS_EVERY = 15
"""Letters of a long word after which it may break in a narrow cell."""

TEMPLATE = TEMPLATES / "sheet.typ"

MOST_COURSES = 4
"""Courses of tests in the annex; those of further tests lie among the files alone."""

FLATTEST, HIGHEST = 0.3, 1.2
"""Height over width of the figure of page 1 [1], whatever room is left."""

TOO_FLAT, ON_PAGE_2 = 0.22, 0.45
"""Height over width of that room below which `sheet.typ` puts the figure on page 2, and there."""


def write_pdf(content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        content: From `sheet_content`.
        figures: PNG files: that of page 1, then the courses of the tests.
        path: Where it goes; written whole or not at all.
    """
    return typeset(TEMPLATE, _texts(content), figures[: 1 + MOST_COURSES], path)


def aspect_on_page_1(content: Mapping[str, Any]) -> float:
    """Return height over width of the room that page 1 has for its figure [1]; where it is too low,
    as on page 2.
    """
    found = shown(_texts(content))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lay_out(folder, TEMPLATE, found.content, [])
        (room,) = json.loads(
            typst.query(
                folder / TEMPLATE.name, "<room>", field="value", root=folder,
                ignore_system_fonts=not found.needs_system_fonts,
            )
        )  # fmt: skip
    aspect = room["height"] / room["width"]
    return ON_PAGE_2 if aspect < TOO_FLAT else min(HIGHEST, max(FLATTEST, aspect))


def _texts(content: Mapping[str, Any]) -> dict[str, Any]:
    certificate = breakable(content["certificate"])
    return {**content, "certificate": certificate, "too_flat": TOO_FLAT}


def breakable(value: Any) -> Any:
    """Return texts whose long words may break."""
    return in_texts(value, lambda text: with_breaks(text, BREAKS_EVERY))
