"""The tab that discovers: where model and measurement disagree, and what is missing."""

from __future__ import annotations

from ..jobs.running import JobQueue
from ..words import discovery_html
from .choices import Choices
from .fitting import Fitting


def discovering(page: Choices, queue: JobQueue) -> Fitting:
    """Return the form and the results of `heatrun discover`."""
    return Fitting(
        page,
        queue,
        command="discover",
        what="discovery",
        orders={"second order": "second", "first order": "first"},
        say=discovery_html,
        intro="Searches for physical effects that the network lacks on the chosen tests.",
    )
