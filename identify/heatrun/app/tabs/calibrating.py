"""The tab that calibrates: parameters, intervals, bands, comparison and sheet."""

from __future__ import annotations

from ..jobs.running import JobQueue
from ..words import calibration_html
from .choices import Choices
from .fitting import Fitting


def calibrating(page: Choices, queue: JobQueue) -> Fitting:
    """Return the form and the results of `heatrun calibrate`."""
    return Fitting(
        page,
        queue,
        command="calibrate",
        what="calibration",
        orders={"first and second order": "both", "second order": "second",
                "first order": "first"},
        say=calibration_html,
        intro="Fits the network to the tests that are chosen on the left.",
    )  # fmt: skip
