"""Steps after a fit: one that fails is a finding on its part, and costs nothing that is done.

What users wait for are the parameters. Whatever is worked out from them, such as a search for
effects, the prediction of one test or a figure, may meet numbers that nobody has seen before. That
it failed is said where its result would stand, and everything else is written.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from .errors import InputError, UsageError
from .record.record import Finding

T = TypeVar("T")

FAILED, OUTPUT_FAILED = "step_failed", "output_failed"
"""Ids of the findings: of a step that judges the result, and of a part of what is written."""

NO_FAILURE_OF_A_STEP = (UsageError, OSError, MemoryError, ImportError)
"""What ends the command: wrong use, a disk that is full, memory that has run out (which shows as a
module that cannot be loaded too)."""

MOST_LETTERS = 200
"""Of the message of an error that are told."""


class Attempts:
    """Steps that may fail, with a finding for each that did.

    Attributes:
        id: Of the findings.
        findings: In the order in which the steps failed.
    """

    def __init__(self, id: str = FAILED) -> None:
        self.id = id
        self.findings: list[Finding] = []

    def of(
        self, step: str, do: Callable[[], T], otherwise: T, *, where: str = "", test: str = ""
    ) -> T:
        """Return what a step gives, or what stands in for it where it failed.

        Args:
            step: What is done, as a noun: `"the search for missing effects"`.
            do: Does it.
            otherwise: What stands in.
            where: The network or the figure that it is done for.
            test: Name of the test, empty if it concerns none in particular.
        """
        try:
            return do()
        except NO_FAILURE_OF_A_STEP:
            raise
        except Exception as error:  # whatever it is, the parameters are worth more
            self.findings.append(_finding(self.id, step, error, where, test))
            return otherwise


def new_findings(found: Iterable[Finding], before: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings that were not there before, such as those of a sheet that is made again."""
    known = {finding.sentence() for finding in before}
    return tuple(finding for finding in found if finding.sentence() not in known)


def _finding(id: str, step: str, error: Exception, where: str, test: str) -> Finding:
    if isinstance(error, InputError):
        message, where = f"{step} failed: {error.problem}", error.where or where
        remedy = error.remedy
    else:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        told = " ".join(str(error).split())[:MOST_LETTERS] or "no message"
        message = (
            f"{step} failed ({type(error).__name__}: {told}; {Path(frame.filename).name}, line "
            f"{frame.lineno}). Its result is missing; all others are as they would be."
        )
        remedy = "This is a fault of heatrun, not of the records: report it with this line."
    return Finding(
        id=id, severity="warning", message=message, where=where, remedy=remedy, test=test
    )
