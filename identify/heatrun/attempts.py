"""Steps after a fit: one that fails is a finding on its part, and costs nothing that is done.

What users wait for are the parameters. Whatever is worked out from them, such as a search for
effects, the prediction of one test or a figure, may meet numbers that nobody has seen before. That
it failed is said where its result would stand, and everything else is written.

Whether compiled sums are right on this machine: NumPy adds the same numbers, once per process.

jaxlib 0.10.2 on CPUs joins a small matrix product with the sum behind it. Of more than 16 384 rows
in float64, those behind them come out wrong, in silence: with the options of `runtime` and without,
on one core and several, with wide and narrow vectors (jax-ml/jax, issue 39103). `pyproject.toml`
excludes that version; this is for environments that have it all the same, and for others that err
alike.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .errors import InputError, UsageError
from .io.programs import compiled
from .record.record import Finding

NUM_ROWS = 20_000
"""Rows of the check: of so many, 3616 come out wrong. Of 16 384 or fewer, and of 48 000 or more,
none were seen to."""

SIZE = 3
"""Rows and columns of its matrix: sums were wrong with 2 to 6 rows and 3, 5 or 6 columns."""

BELOW = 64
"""The numbers are whole and below this: no sum of theirs is rounded, in whatever order it is taken,
in float32 either."""


@cache
def refuse_wrong_sums() -> None:
    """Refuse to go on where sums are wrong; at the start of all that fits, in some 50 ms, once.

    Raises:
        InputError: If compiled sums are not those of NumPy.
    """
    rng = np.random.default_rng(0)
    rows = rng.integers(BELOW, size=(NUM_ROWS, SIZE)).astype(float)
    matrix = np.tri(SIZE)
    found = np.asarray(sums_of_squares(matrix, rows))
    num_wrong = int(np.sum(found != np.sum((rows @ matrix.T) ** 2, axis=1)))
    if num_wrong:
        here = version("jaxlib")
        raise InputError(
            f"jaxlib {here} computes wrong sums on this machine: {num_wrong} of {NUM_ROWS} sums "
            "of squares are not those of NumPy, so no fit could be relied on.",
            remedy=f'Install another version: pip install "jax!={here}" "jaxlib!={here}"',
        )


@compiled()
def sums_of_squares(
    matrix: Float[Array, "sum column"], rows: Float[Array, "row column"]
) -> Float[Array, " row"]:
    """Return, of each row, the sum of squares of a matrix times the row."""
    return jax.vmap(lambda row: jnp.sum((matrix @ row) ** 2))(rows)


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
