"""How far the pages of a PDF are filled, from where its texts and images stand."""

from __future__ import annotations

from pathlib import Path

from pypdf import PdfReader

TOP_PT, BOTTOM_PT = 42.5, 48.2
"""Margins of all documents (15 mm and 17 mm); what stands in the lower one is the footer."""


def fill_of_pages(pdf: Path) -> list[float]:
    """Return the share of each page's height above which nothing more stands [1]."""
    return [_fill(page) for page in PdfReader(pdf).pages]


def _fill(page) -> float:
    height = float(page.mediabox.height)
    lowest = [height - TOP_PT]

    def image(operator, _operands, cm, _tm):
        if operator == b"Do":
            # the unit square of the image, in the page's coordinates
            lowest.append(min(cm[5], cm[5] + cm[3]))

    def text(words, cm, tm, *_):
        y = cm[1] * tm[4] + cm[3] * tm[5] + cm[5]
        if words.strip() and y > BOTTOM_PT:
            lowest.append(y)

    page.extract_text(visitor_operand_before=image, visitor_text=text)
    return (height - TOP_PT - min(lowest)) / (height - TOP_PT - BOTTOM_PT)
