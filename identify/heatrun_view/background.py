"""Work beside the page, which goes on meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import panel as pn
from tornado.ioloop import IOLoop

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

    What is found while the browser still builds the page waits until that has, see `when_built`.

    Args:
        work: Raises nothing; touches nothing of the page.
        show: Gets what the work has returned. Without a page, at once.
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
