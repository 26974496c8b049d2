"""The tab that discovers: where model and measurement disagree, and what is missing."""

from __future__ import annotations

from heatrun.results import DiscoveryResult

from ..jobs.running import JobQueue
from ..words import discovery_html
from .choices import Choices
from .fitting import Fitting


def discovering(page: Choices, queue: JobQueue) -> Fitting[DiscoveryResult]:
    """Return the form and the results of `heatrun discover`."""
    return Fitting(
        page,
        queue,
        command="discover",
        read=lambda run: run.discovery,
        orders={"second order": "second", "first order": "first"},
        verdict=lambda result: f"{result.verdict.upper()}: {result.sentence}",
        say=discovery_html,
        intro="Searches for physical effects that the network lacks on the chosen tests.",
    )
