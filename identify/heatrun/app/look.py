"""Colours and style of the page, light and dark."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Look:
    """Colours of a page.

    Attributes:
        is_dark: Whether light stands on dark.
        palette: Colours of the channels; told apart with the common colour blindnesses.
        paper: Background of page and plots.
        ink: Text and axes.
        faint: Grid lines.
    """

    is_dark: bool
    palette: tuple[str, ...]
    paper: str
    ink: str
    faint: str


LIGHT = Look(
    is_dark=False,
    palette=(
        "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b07d00", "#56a4d9", "#7a4ea3", "#6b6b6b",
    ),
    paper="#ffffff",
    ink="#1f2933",
    faint="#e3e7eb",
)  # fmt: skip
DARK = Look(
    is_dark=True,
    palette=(
        "#4fb0ea", "#ff8a3d", "#2fd0a2", "#e79bc6", "#f0c04a", "#9ad4ff", "#b793e6", "#b5bcc4",
    ),
    paper="#14181d",
    ink="#e4e8ec",
    faint="#2b323a",
)  # fmt: skip

DASHES = ("solid", "dashed", "dotted", "dotdash", "dashdot")
"""Dashes of the first, second, … of tests that are laid over each other."""

FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif"


def css(look: Look) -> str:
    """Return the style sheet of the page; it loads nothing from elsewhere."""
    return f"""
    :root, :host {{ --bokeh-base-font: {FONT}; --bokeh-font-size: 14px; }}
    body {{ font-family: {FONT}; background: {look.paper}; color: {look.ink}; }}
    #header {{ box-shadow: none; border-bottom: 1px solid {look.faint}; padding: 4px 12px; }}
    #sidebar {{ border-right: 1px solid {look.faint}; padding: 10px; }}
    #main {{ padding: 8px 16px; }}
    a.title {{ font-size: 1.2em; font-weight: 600; }}
    """


def tabs_css(look: Look) -> str:
    """Return the style of the tabs, whose chosen one the plain design paints for light alone."""
    return f"""
    .bk-tab {{ color: {look.ink}; }}
    .bk-tab.bk-active {{
      background: {look.paper}; color: {look.ink}; border-color: {look.faint}; font-weight: 600;
    }}
    """


def pane_css(look: Look) -> str:
    """Return the style of text and tables inside a pane."""
    return f"""
    :host {{ color: {look.ink}; }}
    h3 {{ margin: 0.2em 0 0.4em; font-size: 1.05em; }}
    p {{ margin: 0.3em 0; }}
    table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
    th, td {{ text-align: left; padding: 3px 12px 3px 0; }}
    th, td {{ border-bottom: 1px solid {look.faint}; vertical-align: top; }}
    td.number {{ text-align: right; }}
    code {{ background: {look.faint}; padding: 1px 4px; word-break: break-all; }}
    .error {{ border-left: 4px solid #c92a2a; padding: 6px 10px; background: {look.faint}; }}
    .warning {{ border-left: 4px solid #e0a100; padding: 6px 10px; background: {look.faint}; }}
    .note {{ border-left: 4px solid #4f8fca; padding: 6px 10px; background: {look.faint}; }}
    .faded {{ opacity: 0.7; }}
    """
