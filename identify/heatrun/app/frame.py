"""The page's frame: header, sidebar and style, loaded from this machine alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import panel as pn

from .look import DARK, LIGHT, Look, css

SWITCH = """
const url = new URL(window.location);
url.searchParams.set("theme", theme);
window.location = url;
"""
"""Loads the page again in the other colours; what is chosen stands in its address."""


class LocalTemplate(pn.template.VanillaTemplate):
    """The plain template without fonts from elsewhere."""

    _resources: dict[str, Any] = {}  # noqa: RUF012


def asked(name: str) -> list[str]:
    """Return the values of a word in the page's address."""
    found = (pn.state.session_args or {}).get(name, [])
    return [value.decode("utf-8", "replace") for value in found]


def asked_look() -> Look:
    """Return the colours that the page's address asks for."""
    return DARK if asked("theme")[:1] == ["dark"] else LIGHT


def framed(look: Look, sidebar: Sequence[Any], main: Sequence[Any]) -> LocalTemplate:
    """Return the page.

    Args:
        look: Colours.
        sidebar: What is chosen from, top to bottom.
        main: What comes of it.
    """
    template = LocalTemplate(
        title="heatrun",
        theme="dark" if look.is_dark else "default",
        sidebar_width=330,
        header_background=look.paper,
        header_color=look.ink,
        busy_indicator=None,
        raw_css=[css(look)],
    )
    switch = pn.widgets.Button(name="Light" if look.is_dark else "Dark", width=70)
    switch.js_on_click(args={"theme": "default" if look.is_dark else "dark"}, code=SWITCH)
    places: Any = template
    places.header.append(switch)
    places.sidebar.extend(sidebar)
    places.main.extend(main)
    return template
