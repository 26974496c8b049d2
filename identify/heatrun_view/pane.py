"""Text on the page."""

from __future__ import annotations

from typing import Any

import panel as pn

from .look import PANE_CSS


def text_pane(html: str = "", **options: Any) -> pn.pane.HTML:
    """Return a pane of text in the page's style.

    Args:
        html: What stands in it; what comes from files must be escaped.
        options: Of Panel's pane.
    """
    options = {"sizing_mode": "stretch_width", "min_height": 0, **options}
    return pn.pane.HTML(html, stylesheets=[PANE_CSS], **options)
