"""Work beside the page, which goes on meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

import panel as pn

T = TypeVar("T")


def in_turn(work: Callable[[], None]) -> None:
    """Do at the page's next turn what changes models of Bokeh; without a page, at once.

    Panel calls the watchers of its widgets without the lock that such changes take.

    Args:
        work: Changes the models.
    """
    document = pn.state.curdoc
    if document is None:
        work()
    else:
        document.add_next_tick_callback(work)


def in_background(work: Callable[[], T], show: Callable[[T], None]) -> None:
    """Do work in a thread of its own and show what came of it in the page's turn.

    What changes while the browser still builds the page is lost to it: it gets references to
    models that it does not know, and stays empty. So what is found sooner waits until then.

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

    def when_built(act: Callable[[], None]) -> None:
        if pn.state.loaded:
            act()
        else:
            pn.state.onload(lambda: in_time(act))

    def run() -> None:
        found = work()
        in_time(lambda: when_built(lambda: show(found)))

    threading.Thread(target=run, daemon=True, name="heatrun reader").start()
