"""Style and frame of the page, light and dark, as the browser asks for or the user has chosen.

All of it is loaded from this machine alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import panel as pn
from bokeh.models import CustomJS, Div


@dataclass(frozen=True)
class Look:
    """Colours of a page: background, text and axes, grid lines, cursors A and B."""

    is_dark: bool
    # Colours of the channels; the first eight are told apart with the common colour blindnesses,
    # the others are darker or lighter ones of them.
    palette: tuple[str, ...]
    paper: str
    ink: str
    faint: str
    cursors: tuple[str, str]

    def colour(self, number: int) -> str:
        """Return a colour of the palette; that of the text for `INK`."""
        return self.ink if number == INK else self.palette[number]


INK = -1
"""Number of the colour of what belongs to no signal."""

LIGHT = Look(
    is_dark=False,
    palette=(
        "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b07d00", "#56a4d9", "#7a4ea3", "#6b6b6b",
        "#003f63", "#8a3d00", "#005c43", "#8c3f68", "#6a4b00", "#4a2a6b",
    ),
    paper="#ffffff",
    ink="#1f2933",
    faint="#e3e7eb",
    cursors=("#b3005a", "#00708a"),
)  # fmt: skip
DARK = Look(
    is_dark=True,
    palette=(
        "#4fb0ea", "#ff8a3d", "#2fd0a2", "#e79bc6", "#f0c04a", "#9ad4ff", "#b793e6", "#b5bcc4",
        "#2c7fb8", "#c9621c", "#1d9a77", "#b9618f", "#b88d1e", "#8766b8",
    ),
    paper="#14181d",
    ink="#e4e8ec",
    faint="#2b323a",
    cursors=("#ff6fae", "#4fd6ee"),
)  # fmt: skip

DASHES = ("solid", "dashed", "dotted", "dotdash", "dashdot")
"""Dashes of the first, second, … of signals in one plot, where colours tell tests apart."""

WIDE: Any = "stretch_width"
"""How parts take all the width that there is."""

FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif"

NARROW_PX = 1100
"""Width of the browser below which the readings go under the plots."""

PHONE_PX = 700
"""Width below which the choices go above everything, and tables scroll within themselves. All of
the page scrolls as one: parts that do each for themselves would be cut."""


def _either(light: str, dark: str) -> str:
    return f"light-dark({light}, {dark})"


SCHEME = f"""
    --hr-paper: {_either(LIGHT.paper, DARK.paper)} !important;
    --hr-ink: {_either(LIGHT.ink, DARK.ink)} !important;
    --hr-faint: {_either(LIGHT.faint, DARK.faint)} !important;
    --panel-background-color: var(--hr-paper) !important;
    --panel-on-background-color: var(--hr-ink) !important;
    --panel-surface-color: {_either("#f3f4f6", "#20262d")} !important;
    --panel-on-surface-color: var(--hr-ink) !important;
    --panel-secondary-color: {_either("#e1e4e8", "#323a43")} !important;
    --panel-on-secondary-color: var(--hr-ink) !important;
    --panel-border-color: {_either("#d5dade", "#3a434d")} !important;
    --panel-shadow-color: {_either("rgba(60, 64, 67, 0.18)", "rgba(10, 14, 18, 0.6)")} !important;
"""
"""The colours as the browser's `prefers-color-scheme` has them; the page's button sets
`color-scheme` on the root, which all of them follow without a reload."""


def css() -> str:
    """Return the style sheet of the page; it loads nothing from elsewhere."""
    return f"""
    :root {{ color-scheme: light dark; {SCHEME} }}
    :root, :host {{ --bokeh-base-font: {FONT}; --bokeh-font-size: 14px; }}
    body {{ font-family: {FONT}; background: var(--hr-paper); color: var(--hr-ink); }}
    #header {{ box-shadow: none; border-bottom: 1px solid var(--hr-faint); padding: 2px 12px; }}
    #sidebar {{ border-right: 1px solid var(--hr-faint); padding: 10px; }}
    #main {{ padding: 4px 12px; }}
    a.title {{ font-size: 1.2em; font-weight: 600; }}
    @media (max-width: {NARROW_PX}px) {{
      :root {{ --sidebar-width: 240px !important; }}
      #main {{ padding: 4px 6px; }}
    }}
    @media (max-width: {PHONE_PX}px) {{
      #content {{ display: block; overflow-y: auto; }}
      #sidebar {{ width: 100%; height: auto; overflow: visible; }}
      #sidebar {{ border-bottom: 2px solid var(--hr-faint); border-right: none; }}
      #sidebar.hidden {{ display: none; }}
      #sidebar-button {{ font-size: 10px; line-height: 1; white-space: nowrap; }}
      #sidebar-button::after {{ content: "side panel"; }}
      #main {{ height: auto; overflow: visible; width: 100%; }}
    }}
    """


PART_CSS = f"""
    :host {{ {SCHEME} }}
    select.bk-input:not([multiple]) {{ appearance: auto; background-image: none;
      padding-inline: 6px; text-overflow: ellipsis; }}
    .filepond--drop-label label {{ font-size: 13px; }}
"""
"""Style of each part of the page, to which the plain design gives colours for light alone."""

NAMES_CSS = """
    label { display: flex; align-items: flex-start; max-width: 100%; }
    label > input { flex: none; }
    label > span { overflow-wrap: anywhere; white-space: normal; min-width: 0; }
"""
"""Style of a list of names: a long one goes on in the next line, for its end tells it apart."""

TABS_CSS = """
    .bk-headers-wrapper { flex-wrap: wrap; }
    .bk-tab { color: var(--hr-ink); }
    .bk-tab.bk-active {
      background: var(--hr-paper); color: var(--hr-ink); border-color: var(--hr-faint);
      font-weight: 600;
    }
    [style*="visibility: hidden"] { max-height: 0; overflow: hidden; }
"""
"""Style of the tabs, whose chosen one the plain design paints for light alone; in two rows where
there is no room for one. What is not shown takes no room: the page is as long as what is."""

PANE_CSS = (
    f"""
    @media (max-width: {PHONE_PX}px) {{
      table {{ display: block; overflow-x: auto; }}
      td:last-child {{ min-width: 14em; }}
    }}
"""
    """
    :host { color: var(--hr-ink); }
    h3 { margin: 0.2em 0 0.4em; font-size: 1.05em; }
    p { margin: 0.3em 0; }
    table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
    th, td { text-align: left; padding: 3px 10px 3px 0; }
    th, td { border-bottom: 1px solid var(--hr-faint); vertical-align: top; }
    td.number { text-align: right; }
    code, pre { background: var(--hr-faint); padding: 1px 4px; word-break: break-all; }
    pre { white-space: pre-wrap; word-break: normal; padding: 6px; margin: 0.3em 0; }
    .error { border-left: 4px solid #c92a2a; padding: 6px 10px; background: var(--hr-faint); }
    .warning { border-left: 4px solid #e0a100; padding: 6px 10px; background: var(--hr-faint); }
    .note { border-left: 4px solid #4f8fca; padding: 6px 10px; background: var(--hr-faint); }
    .faded { opacity: 0.7; }
"""
)
"""Style of text and tables inside a pane."""


def text_pane(html: str = "", **options: Any) -> pn.pane.HTML:
    """Return a pane of text in the page's style; what comes from files must be escaped."""
    options = {"sizing_mode": WIDE, "min_height": 0, **options}
    return pn.pane.HTML(html, stylesheets=[PANE_CSS], **options)


def stacked(*parts: Any, **options: Any) -> pn.Column:
    """Return parts below each other, as wide as the page."""
    return pn.Column(*parts, sizing_mode=WIDE, **options)


def button(name: str, act: Callable[[], Any], width: int | None = None, **options: Any) -> Any:
    """Return a button that does something."""
    made = pn.widgets.Button(name=name, width=width, **options)
    made.on_click(lambda _: act())
    return made


def on_change(act: Callable[[], Any], *widgets: Any) -> None:
    """Do something when the value of a widget changes."""
    for widget in widgets:
        widget.param.watch(lambda _: act(), "value")


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
// what a bookmark has chosen is shown, not chosen again
if (window.innerWidth < phone && new URLSearchParams(location.search).has("test")) closeNav();
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
    """What the browser looks like: colours, width and height of its window [px]."""

    look: Look = LIGHT
    width: int = 1366
    height: int = 800
    is_chosen: bool = False  # The colours were chosen with the page's button.

    @classmethod
    def of(cls, told: object) -> Screen | None:
        """Return what the page has told, None if that is nothing it would tell."""
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
        meta_viewport="width=device-width, initial-scale=1",  # else a phone lays out 980 px
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
        tell = CustomJS(
            args={"browser": browser, "asked": asked_theme(), "phone": PHONE_PX}, code=TELL
        )
        pn.state.curdoc.js_on_event("document_ready", tell)
    places: Any = template
    places.header.append(switch)
    places.header.append(pn.pane.Bokeh(browser, width=0, height=0))
    places.sidebar.extend(sidebar)
    places.main.extend(main)
    return template
