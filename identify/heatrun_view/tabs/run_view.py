"""A run on the page: what it says, its figures, its files."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any, TypeVar

import panel as pn

from heatrun.errors import InputError

from ..look import text_pane
from ..reading import problem
from ..runs import Run, download
from ..words import error_message, message

R = TypeVar("R")

FIGURE_PX = 860

MAX_FIGURE_BYTES = 20_000_000

PNG = b"\x89PNG\r\n\x1a\n"
"""First bytes of a PNG."""


def run_view(
    run: Run,
    read: Callable[[Run], R | None],
    verdict: Callable[[R], str],
    say: Callable[[R], str],
    what: str,
    figure: Any,
) -> pn.Column:
    """Return a column with result, downloads and figures of a run.

    Args:
        run: The run folder.
        read: Returns its result, None if it has none or it is damaged.
        verdict: Returns its verdict.
        say: Turns the rest of it into HTML.
        what: `"calibration"` or `"discovery"`.
        figure: Stands below the verdict.
    """
    result = read(run)
    if result is None:
        words = message("warning", f"{run.path} holds no {what}, or it is damaged.")
        return pn.Column(text_pane(words))
    try:
        head, said = f"<h3>{escape(verdict(result))}</h3>", say(result)
    except Exception as error:  # a result of another version, or a damaged one
        head, said = "", problem(run.path.name, error)
    files = [download(path, run.root, width=155) for path in run.downloads()]
    figures = [
        pn.pane.HTML(_figure(run, path), sizing_mode="stretch_width") for path in run.figures()
    ]
    return pn.Column(
        text_pane(head),
        pn.FlexBox(*files),
        figure,
        text_pane(said),
        *figures,
        sizing_mode="stretch_width",
    )


def _figure(run: Run, path: Path) -> str:
    """Return a figure as HTML: in the page itself, so that nothing asks for its file later."""
    try:
        content = run.read(path, MAX_FIGURE_BYTES)
    except InputError as error:
        return error_message(error)
    if not content.startswith(PNG):
        return message("warning", f"{path.name} is no PNG.")
    source = f"data:image/png;base64,{b64encode(content).decode()}"
    style = f"width: 100%; max-width: {FIGURE_PX}px"
    return f'<img src="{source}" alt="{escape(path.stem)}" style="{style}">'


def typed_number(text: str, where: str, such_as: str) -> float:
    """Return a number that was typed, with a decimal point or comma.

    Args:
        text: As typed.
        where: What it is asked for.
        such_as: An example.

    Raises:
        InputError: If it is none.
    """
    try:
        return float(text.strip().replace(",", "."))
    except ValueError:
        raise InputError(
            f"Expected a number, got {text[:40]!r}.", where=where, remedy=f"Such as {such_as}."
        ) from None


def run_name(text: str, default: str) -> str:
    """Return the name of a run folder: letters, digits and `._-`, no folders.

    Args:
        text: As typed.
        default: Where nothing is left of it.
    """
    kept = "".join(c if c.isalnum() or c in "._-" else "_" for c in text.strip()).lstrip(".-")
    return kept[:80] or default
