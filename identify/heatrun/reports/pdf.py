"""The parameter sheet as PDF.

Letters that no font here can draw stand on paper as their numbers, not as empty boxes.

Documents set by Typst from a template and plain data; data never become markup.

How high the figures of a document are drawn, so that its pages are filled.

The document is set with blank figures of several heights. The one nearest to what was drawn is
taken whose last page is well filled and whose other pages have no large holes.
"""

from __future__ import annotations

import json
import math
import shutil
import struct
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType
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
    """What can be set.

    Attributes:
        content: With each letter that no font has as `[U+674E]`.
        needs_system_fonts: Some letters are not in the fonts that typst brings. Only then are those
            of the machine asked, so that a document is the same on all machines where it can be.
    """

    content: dict[str, Any]
    needs_system_fonts: bool


def shown(content: Mapping[str, Any]) -> Shown:
    """Return the content of a document as the fonts of this machine can show it.

    Args:
        content: Strings, numbers, lists and objects.
    """
    letters = {c for c in json.dumps(content, ensure_ascii=False) if ord(c) >= ALWAYS_THERE}
    foreign = _lost(frozenset(letters), brought_alone=True)
    lost = _lost(foreign, brought_alone=False)
    if not lost:
        return Shown(dict(content), bool(foreign))
    table = str.maketrans({c: f"[U+{ord(c):04X}]" for c in lost})
    return Shown({key: _translated(each, table) for key, each in content.items()}, bool(foreign))


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


def _translated(value: Any, table: Mapping[int, str]) -> Any:
    if isinstance(value, str):
        return value.translate(table)
    if isinstance(value, Mapping):
        return {key: _translated(item, table) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_translated(item, table) for item in value]
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


HEIGHTS = tuple(sorted((k / 20 for k in range(15, 27)), key=lambda h: abs(math.log(h))))
"""Heights tried, as shares of the drawn one [1]: those near to it first."""

GOOD_LAST, GOOD_ALL = 0.65, 0.9
"""Shares of the last page and of all pages [1] from which on nothing better is looked for."""

ROOM_PT = 841.9 - 42.5 - 48.2
"""Height of a page between the margins of the templates [pt]."""

TOP_PT = 42.5

PIXELS_PER_IN = 160
"""Of the figures, as `heatrun.reports.figures.save` writes them."""


@dataclass(frozen=True)
class Fill:
    """How far the pages of a document are filled.

    Attributes:
        last: Share of the last page above which nothing more stands [1].
        all: Share of all pages that what is set would take without breaks [1].
    """

    last: float
    all: float

    @property
    def quality(self) -> float:
        """1 where it is good, less where a page is empty [1]."""
        return min(1.0, self.last / GOOD_LAST, self.all / GOOD_ALL)


def filling_height(
    template: Traversable,
    content: Mapping[str, Any],
    sizes_in: Sequence[tuple[float, float]],
    largest: float = max(HEIGHTS),
) -> float:
    """Return the share of their drawn height at which figures fill the pages best.

    Args:
        template: The file; it marks its figures and its end.
        content: As `heatrun.reports.pdf.typeset`.
        sizes_in: Width and height of each figure as it is drawn.
        largest: Share above which nothing is tried.
    """
    found = shown(content)
    best, best_quality = 1.0, 0.0
    for height in (each for each in HEIGHTS if each <= largest):
        sizes = [(width, height * drawn) for width, drawn in sizes_in]
        quality = _fill(template, found, sizes).quality
        if quality > best_quality:
            best, best_quality = height, quality
        if quality >= 1.0 or not sizes:
            break
    return best


def _fill(template: Traversable, found: Shown, sizes_in: Sequence[tuple[float, float]]) -> Fill:
    pages = _lengths(asked(template, found, "<bottom>", sizes_in))
    endless = asked(template, found, "<bottom>", sizes_in, {"endless": "yes"})
    return Fill(pages[-1], sum(_lengths(endless)) / len(pages))


def asked(
    template: Traversable,
    found: Shown,
    mark: str,
    sizes_in: Sequence[tuple[float, float]] = (),
    inputs: Mapping[str, str] = MappingProxyType({}),
) -> list[Any]:
    """Return what a template says at its marks, where its figures are blank.

    Args:
        template: The file.
        found: Its content as the fonts of this machine can show it.
        mark: Selector of the marks.
        sizes_in: Width and height of each figure.
        inputs: Of the template.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = [_blank(folder / f"{n}.svg", size) for n, size in enumerate(sizes_in)]
        lay_out(folder, template, found.content, figures)
        return json.loads(
            typst.query(
                folder / template.name, mark, field="value", root=folder, sys_inputs=dict(inputs),
                ignore_system_fonts=not found.needs_system_fonts,
            )
        )  # fmt: skip


def _lengths(marks: Sequence[Mapping[str, float]]) -> list[float]:
    """Return how long each page is to its last mark, in pages; one without marks is full."""
    lengths = [1.0] * int(max(mark["page"] for mark in marks))
    for page in {int(mark["page"]) for mark in marks}:
        lowest = max(mark["y"] for mark in marks if mark["page"] == page)
        lengths[page - 1] = (lowest - TOP_PT) / ROOM_PT
    return lengths


def size_in(png: Path) -> tuple[float, float]:
    """Return width and height of an image as its header states them, at 160 per inch.

    Args:
        png: A file in PNG.
    """
    with png.open("rb") as file:
        width, height = struct.unpack(">II", file.read(24)[16:])
    return width / PIXELS_PER_IN, height / PIXELS_PER_IN


def _blank(path: Path, size_in: tuple[float, float]) -> Path:
    """An image of a size, with nothing on it."""
    width, height = size_in
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}in" height="{height:.3f}in"/>',
        encoding="utf-8",
    )
    return path


BREAKS_EVERY = 15
"""Letters of a long word after which it may break in the narrow cells of page 1."""

TEMPLATE = TEMPLATES / "sheet.typ"

WIDE = 82
"""Width of the figures in the annex [% of the line]."""

WIDEST = 100
"""Width to which a figure grows where a page would stay empty [% of the line]."""

MOST_COURSES = 4
"""Courses of tests in the annex; those of further tests lie among the files alone."""

FLATTEST, HIGHEST = 0.3, 1.2
"""Height over width of the figure of page 1 [1], whatever room is left."""


def write_pdf(content: Mapping[str, Any], figures: Sequence[Path], path: Path) -> Path:
    """Write the sheet as PDF.

    Args:
        content: From `sheet_content`.
        figures: PNG files: that of page 1, then the courses of the tests.
        path: Where it goes; written whole or not at all.
    """
    shown = figures[: 1 + MOST_COURSES]
    texts = _texts(content, [WIDE] * len(shown))
    # an image whose width grows with its height keeps its proportions
    share = filling_height(TEMPLATE, texts, [size_in(each) for each in shown], WIDEST / WIDE)
    return typeset(TEMPLATE, _texts(content, [share * WIDE] * len(shown)), shown, path)


def aspect_on_page_1(content: Mapping[str, Any]) -> float:
    """Return height over width of the room that page 1 has for its figure [1].

    Args:
        content: From `sheet_content`.
    """
    (room,) = asked(TEMPLATE, shown(_texts(content, [])), "<room>")
    return min(HIGHEST, max(FLATTEST, room["height"] / room["width"]))


def _texts(content: Mapping[str, Any], widths: Sequence[float]) -> dict[str, Any]:
    return {**content, "certificate": _breakable(content["certificate"]), "widths": list(widths)}


def _breakable(value: Any) -> Any:
    """Return texts whose long words may break, at any depth of lists and objects."""
    if isinstance(value, str):
        return with_breaks(value, BREAKS_EVERY)
    if isinstance(value, Mapping):
        return {key: _breakable(item) for key, item in value.items()}
    return [_breakable(item) for item in value] if isinstance(value, list) else value
