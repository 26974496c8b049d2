"""Work beside the page, which goes on meanwhile, and tabs that are rendered when first shown."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import panel as pn
from tornado.ioloop import IOLoop

from .look import TABS_CSS, WIDE, stacked
from .words import problem

T = TypeVar("T")


def in_order() -> AbstractContextManager[Any]:
    """Change models of Bokeh so that the browser hears of it behind what it was to hear before.

    Panel sends what changes in its panes by itself, and keeps it back while the connection is busy.
    What changes in a model besides would go past that, also to models that the browser is yet to
    get, and is lost there. Within this context it goes the same way. It takes no lock: Panel calls
    the watchers of its widgets without the one that Bokeh asks for.
    """
    return pn.io.unlocked()


class Soon:
    """Does what it is asked for a little later, and once for many requests in a row."""

    WAIT_MS = 30

    def __init__(self) -> None:
        self._is_waiting = False

    def __call__(self, act: Callable[[], None]) -> None:
        """Take a request; without a page nothing is done."""
        if self._is_waiting or pn.state.curdoc is None:
            return
        self._is_waiting = True

        def settle() -> None:
            self._is_waiting = False
            with in_order():
                act()

        pn.state.curdoc.add_timeout_callback(settle, self.WAIT_MS)


def when_built(act: Callable[[], None]) -> None:
    """Do something once the browser has built the page: at once where it has.

    What changes while the browser still builds the page is lost to it: it gets references to
    models that it does not know, and stays empty.
    """
    document = pn.state.curdoc
    if document is None or pn.state.loaded:
        act()
        return

    def soon() -> None:
        document.add_next_tick_callback(act)

    pn.state.onload(soon)


def in_background(work: Callable[[], T], show: Callable[[T], None]) -> None:
    """Do work in a thread of its own and show what came of it in the page's turn.

    What is found while the browser still builds the page waits until that has, see `when_built`;
    without a page it is shown at once. The work raises nothing and touches nothing of the page.
    """
    document = pn.state.curdoc
    if document is None:
        show(work())
        return

    def in_time(act: Callable[[], None]) -> None:
        document.add_next_tick_callback(act)

    loop = IOLoop.current()

    def run() -> None:
        found = work()
        # not from this thread: Bokeh keeps one list of current documents for all threads, and the
        # page of another tab would take this one's for its own
        loop.add_callback(in_time, lambda: when_built(lambda: show(found)))

    threading.Thread(target=run, daemon=True, name="heatrun reader").start()


class Latest:
    """Work beside the page of which only what was asked for last is shown."""

    def __init__(self) -> None:
        self._asked = 0

    def forget(self) -> None:
        """Show nothing of what is being worked out."""
        self._asked += 1

    def ask(self, what: str, work: Callable[[], T], show: Callable[[T | str], None]) -> None:
        """Do work beside the page; where it fails, why is shown as HTML."""
        self.forget()
        asked = self._asked

        def done() -> T | str:
            try:
                return work()
            except Exception as error:
                return problem(what, error)

        def show_latest(found: T | str) -> None:
            if asked == self._asked:
                show(found)

        in_background(done, show_latest)


class LateTabs:
    """Tabs of which each is rendered when it is first shown, and stays in the page from then on.

    Before that it is an empty place: its content keeps what it is told, and no browser has it.
    Panel's `dynamic=True` would take a tab out again whenever another is shown: what changes in it
    meanwhile, such as the progress of a command, would come to no browser before it is shown again.
    """

    def __init__(self, *parts: tuple[str, Any], active: int) -> None:
        """Take titles and contents, and the place of the one that is shown.

        None is rendered yet; the first one is by `render`, once the page is put together.
        """
        self._contents: list[Any] = []
        self.view = pn.Tabs(sizing_mode=WIDE, stylesheets=[TABS_CSS])
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
        self.view.append((title, stacked()))

    def show(self, content: Any) -> None:
        """Show a tab by its content."""
        self.view.active = self._contents.index(content)

    def render(self) -> None:
        """Render the tab that is shown, unless it is already."""
        place: Any = self.view[self.view.active]
        if not place:
            place[:] = [self.shown]
