"""Tabs that are rendered when they are first shown."""

from __future__ import annotations

from typing import Any

import panel as pn

from ..background import when_built
from ..look import TABS_CSS


class LateTabs:
    """Tabs of which each is rendered when it is first shown, and stays in the page from then on.

    Before that it is an empty place: its content keeps what it is told, and no browser has it.
    Panel's `dynamic=True` would take a tab out again whenever another is shown: what changes in it
    meanwhile, such as the progress of a command, would come to no browser before it is shown again.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, *parts: tuple[str, Any], active: int) -> None:
        """Take titles and contents, and the place of the one that is shown.

        None is rendered yet; the first one is by `render`, once the page is put together.
        """
        self._contents: list[Any] = []
        self.view = pn.Tabs(sizing_mode="stretch_width", stylesheets=[TABS_CSS])
        for title, content in parts:
            self.append(title, content)
        self.view.active = active
        self.view.param.watch(lambda _: when_built(self.render), "active")

    @property
    def shown(self) -> Any:
        """Content of the tab that is shown."""
        return self._contents[self.view.active]

    def append(self, title: str, content: Any) -> None:
        """Put a tab behind the others."""
        self._contents.append(content)
        self.view.append((title, pn.Column(sizing_mode="stretch_width")))

    def show(self, content: Any) -> None:
        """Show a tab by its content."""
        self.view.active = self._contents.index(content)

    def render(self) -> None:
        """Render the tab that is shown, unless it is already."""
        place: Any = self.view[self.view.active]
        if not place:
            place[:] = [self.shown]
