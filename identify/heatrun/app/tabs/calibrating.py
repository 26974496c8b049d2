"""The tab that calibrates: parameters, ranges, bands, comparison and sheet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..jobs.running import JobQueue
from ..words import calibration_html
from .fitting import Fitting

if TYPE_CHECKING:
    from .page import Page


def calibrating(page: Page, queue: JobQueue) -> Fitting:
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
