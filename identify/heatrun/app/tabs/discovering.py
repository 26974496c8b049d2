"""The tab that discovers: where model and measurement disagree, and what is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..jobs.running import JobQueue
from ..words import discovery_html
from .fitting import Fitting

if TYPE_CHECKING:
    from .page import Page


def discovering(page: Page, queue: JobQueue) -> Fitting:
    """Return the form and the results of `heatrun discover`."""
    return Fitting(
        page,
        queue,
        command="discover",
        what="discovery",
        orders={"second order": "second", "first order": "first"},
        say=discovery_html,
        intro="Looks for physical effects that the network of the chosen tests lacks.",
    )
