"""A run on the page: what it says, its figures, its files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import panel as pn

from .look import Look, pane_css
from .runs import Run
from .words import message

FIGURE_PX = 860


def run_view(run: Run, look: Look, say: Callable[[Mapping[str, Any]], str], what: str) -> pn.Column:
    """Return a column with result, downloads and figures of a run.

    Args:
        run: The run folder.
        look: Colours.
        say: Turns the result into HTML.
        what: `"calibration"` or `"discovery"`.
    """
    result = getattr(run, what)
    if result is None:
        words = message("warning", f"{run.path} holds no {what}, or it is damaged.")
        return pn.Column(pn.pane.HTML(words, stylesheets=[pane_css(look)]))
    files = [
        pn.widgets.FileDownload(
            file=str(path), filename=path.name, label=path.name, button_type="default", width=170
        )
        for path in run.downloads()
    ]
    figures = [
        pn.pane.PNG(str(path), alt_text=path.stem, max_width=FIGURE_PX, sizing_mode="scale_width")
        for path in run.figures()
    ]
    return pn.Column(
        pn.FlexBox(*files),
        pn.pane.HTML(say(result), stylesheets=[pane_css(look)], sizing_mode="stretch_width"),
        *figures,
        sizing_mode="stretch_width",
    )


def run_name(text: str, default: str) -> str:
    """Return the name of a run folder: letters, digits and `._-`, no folders.

    Args:
        text: As typed.
        default: Where nothing is left of it.
    """
    kept = "".join(c if c.isalnum() or c in "._-" else "_" for c in text.strip()).lstrip(".-")
    return kept[:80] or default
