"""The tab that calibrates: parameters, intervals, bands, comparison and sheet."""

from __future__ import annotations

from heatrun.reports.terminal import verdict_lines
from heatrun.results import FitResult

from ..jobs.running import JobQueue
from ..words import calibration_html
from .choices import Choices
from .fitting import Fitting


def calibrating(page: Choices, queue: JobQueue) -> Fitting[FitResult]:
    """Return the form and the results of `heatrun calibrate`."""
    return Fitting(
        page,
        queue,
        command="calibrate",
        read=lambda run: run.calibration,
        orders={"first and second order": "both", "second order": "second",
                "first order": "first"},
        verdict=lambda result: verdict_lines(result)[0],
        say=calibration_html,
        intro="Fits the network to the tests that are chosen on the left.",
    )  # fmt: skip
