"""The page's frame: header, sidebar and style, loaded from this machine alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import panel as pn
from bokeh.models import CustomJS, Div

from .look import DARK, LIGHT, Look, css

TELL = """
const query = window.matchMedia("(prefers-color-scheme: dark)");
const root = document.documentElement;
const tell = () => {
  const chosen = root.dataset.theme;
  const dark = chosen ? chosen === "dark" : query.matches;
  root.style.colorScheme = chosen ? chosen : "light dark";
  browser.tags = [dark ? 1 : 0, window.innerWidth, window.innerHeight, chosen ? 1 : 0];
};
if (asked) root.dataset.theme = asked;
let timer = null;
query.addEventListener("change", tell);
window.addEventListener("resize", () => { clearTimeout(timer); timer = setTimeout(tell, 200); });
window.heatrun_theme = () => {
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : query.matches;
  root.dataset.theme = dark ? "light" : "dark";
  tell();
};
tell();
"""
"""Tells the server what the browser looks like, now and whenever that changes."""

SMALLEST_PX, LARGEST_PX = 200, 10_000


@dataclass(frozen=True)
class Screen:
    """What the browser looks like.

    Attributes:
        look: Colours.
        width: Of its window [px].
        height: Of its window [px].
        is_chosen: The colours were chosen with the page's button.
    """

    look: Look = LIGHT
    width: int = 1366
    height: int = 800
    is_chosen: bool = False

    @classmethod
    def of(cls, told: object) -> Screen | None:
        """Return what the page has told, None if that is nothing it would tell.

        Args:
            told: Whatever came.
        """
        if not isinstance(told, list) or len(told) != 4:
            return None
        if not all(isinstance(each, int) and 0 <= each <= LARGEST_PX for each in told):
            return None
        width, height = (max(each, SMALLEST_PX) for each in told[1:3])
        return cls(DARK if told[0] else LIGHT, width, height, bool(told[3]))


class LocalTemplate(pn.template.VanillaTemplate):
    """The plain template without fonts from elsewhere."""

    _resources: dict[str, Any] = {}  # noqa: RUF012


def asked(name: str) -> list[str]:
    """Return the values of a word in the page's address."""
    found = (pn.state.session_args or {}).get(name, [])
    return [value.decode("utf-8", "replace") for value in found]


def asked_theme() -> str:
    """Return the colours that the page's address asks for, empty for those of the browser."""
    found = asked("theme")[:1]
    return {"dark": "dark", "light": "light", "default": "light"}.get(found[0] if found else "", "")


def framed(
    sidebar: Sequence[Any], main: Sequence[Any], changed: Callable[[Screen], None]
) -> LocalTemplate:
    """Return the page.

    Args:
        sidebar: What is chosen from, top to bottom.
        main: What comes of it.
        changed: Told what the browser looks like, once it is known and when it changes.
    """
    template = LocalTemplate(
        title="heatrun",
        theme="default",
        sidebar_width=300,
        header_background="var(--hr-paper)",
        header_color="var(--hr-ink)",
        busy_indicator=None,
        raw_css=[css()],
    )
    switch = pn.widgets.Button(name="Dark or light", width=110)
    switch.js_on_click(code="window.heatrun_theme();")
    browser = Div(text="", visible=False, name="browser")

    def told(attr: str, old: object, new: object) -> None:
        screen = Screen.of(new)
        if screen is not None:
            changed(screen)

    browser.on_change("tags", told)
    if pn.state.curdoc is not None:
        tell = CustomJS(args={"browser": browser, "asked": asked_theme()}, code=TELL)
        pn.state.curdoc.js_on_event("document_ready", tell)
    places: Any = template
    places.header.append(switch)
    places.header.append(pn.pane.Bokeh(browser, width=0, height=0))
    places.sidebar.extend(sidebar)
    places.main.extend(main)
    return template
