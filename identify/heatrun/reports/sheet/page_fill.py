"""How high the figures of a document are drawn, so that its pages are filled.

The document is set with blank figures of several heights. The one nearest to what was drawn is
taken whose last page is well filled and whose other pages have no large holes.
"""

from __future__ import annotations

import json
import math
import struct
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import typst

from .glyphs import Shown, shown
from .typeset import lay_out

HEIGHTS = tuple(sorted((k / 20 for k in range(15, 27)), key=lambda h: abs(math.log(h))))
"""Heights tried, as shares of the drawn one [1]: those near to it first."""

GOOD_LAST, GOOD_ALL = 0.65, 0.9
"""Shares of the last page and of all pages [1] from which on nothing better is looked for."""

ROOM_PT = 841.9 - 42.5 - 48.2
"""Height of a page between the margins of the templates [pt]."""

TOP_PT = 42.5

PIXELS_PER_IN = 160
"""Of the figures, as `heatrun.reports.sheet.figures.save` writes them."""


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
        content: As `heatrun.reports.sheet.typeset.typeset`.
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
