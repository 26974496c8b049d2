"""The register of findings: what they put in doubt; what each id means is a text of `heatrun.io`.

    python -m heatrun.record.findings PAGE.md

writes the page. What came, where, and what to do is in the finding itself; its severity too, which
may hang on how much came.

Steps after a fit that fail are findings too. What users wait for are the parameters. Whatever is
worked out from them, such as a search for effects, the prediction of one test or a figure, may meet
numbers that nobody has seen before. That it failed is a finding on its part, said where its result
would stand (`Attempts`), and everything else is written.
"""

import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal, TypeVar

from ..errors import InputError, UsageError
from ..io.texts import table
from ..io.whole_files import write_whole
from .record import Finding

Doubt = Literal["parameters", "inputs", "judgement", "network", "intervals", "predictions", ""]

ORDER: dict[Doubt, str] = {
    "parameters": "no parameter can be used",
    "inputs": "the result, until an input is cleared up",
    "judgement": "the verdict: a step that judges the result failed",
    "network": "whether the network is complete; its intervals are wider for it",
    "intervals": "the intervals",
    "predictions": "predictions of other tests",
    "": "nothing else",
}
"""What a warning puts in doubt, the gravest first."""


IN_DOUBT: dict[Doubt, tuple[str, ...]] = {
    "parameters": ("simulated_by_heatrun", "not_converged", "instrument_beyond_prior",
                   "prior_conflict"),
    "inputs": ("column_used_twice", "columns_disagree", "unit_suspected", "units_temperature",
               "current_amplitude", "current_maybe_amplitude", "current_maybe_rms",
               "losses_absurd", "losses_below_copper", "losses_of_shaft",
               "load_of_another", "ambient_implausible"),
    "judgement": ("step_failed",),
    "network": ("misfit", "missing_effect", "effects_left_out"),
    "intervals": ("sampling_not_converged",),
    "predictions": ("holdout_outside_band",),
}  # fmt: skip
"""Ids whose warnings put something in doubt; those of all others put nothing."""

SAID = {
    "simulated_by_heatrun": "it was simulated by heatrun, not measured",
    "column_used_twice": "one column stands for two channels",
    "columns_disagree": "two of its columns disagree",
    "unit_suspected": "a column may be in another unit",
    "units_temperature": "a temperature may be in another unit",
    "current_amplitude": "its current may be an amplitude",
    "current_maybe_amplitude": "its current may be an amplitude",
    "current_maybe_rms": "its d and q currents may be rms values",
    "losses_absurd": "its losses are beyond those of known machines",
    "losses_below_copper": "its losses are at times below the copper loss",
    "losses_of_shaft": "its losses may be the power that goes in, or the shaft's",
    "load_of_another": "its load may be that of another test",
    "ambient_implausible": "its sink temperature is unusual",
    "too_short": "it is too short for the slow time constant",
    "single_step": "it holds a single load step",
}
"""What some of them say of the record, as in "To be cleared up first: …"."""


OF_ID = "finding_"
"""Before the id in the key of a meaning."""


def with_doubt(*doubts: Doubt) -> tuple[str, ...]:
    """Return the ids whose warnings put something in doubt, the gravest first."""
    return tuple(id for doubt in ORDER if doubt in doubts for id in IN_DOUBT[doubt])


def meanings() -> dict[str, str]:
    """Return what all findings of an id mean, of what a record holds first, then of the fit."""
    rows = table().items()
    return {key[len(OF_ID) :]: row[0] for key, row in rows if key.startswith(OF_ID)}


def page() -> str:
    """Return the table of findings in Markdown."""
    doubts = {id: ORDER[doubt] for doubt, ids in IN_DOUBT.items() for id in ids}
    rows = [f"| `{id}` | {meaning} | {doubts.get(id, ORDER[''])} |"
            for id, meaning in meanings().items()]  # fmt: skip
    head = "| id | what was found | what a warning puts in doubt |\n|---|---|---|"
    return "\n".join([head, *rows]) + "\n"


T = TypeVar("T")

FAILED, OUTPUT_FAILED = "step_failed", "output_failed"
"""Ids of the findings: of a step that judges the result, and of a part of what is written."""

NO_FAILURE_OF_A_STEP = (UsageError, OSError, MemoryError, ImportError)
"""What ends the command: wrong use, a disk that is full, memory that has run out (which shows as a
module that cannot be loaded too)."""

HOUSE = Path(__file__).parents[1]
"""Where our own code lies."""

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

        The step is a noun, as `"the search for missing effects"`, done for a network or a figure,
        and for a test or none in particular.
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
        frames = traceback.extract_tb(error.__traceback__)
        own = [each for each in frames if Path(each.filename).is_relative_to(HOUSE)][-1]
        # where it came out, and which of our lines asked for it
        lines = dict.fromkeys(
            f"{Path(f.filename).name}, line {f.lineno}" for f in (frames[-1], own)
        )
        told = " ".join(str(error).split())[:MOST_LETTERS] or "no message"
        message = (
            f"{step} failed ({type(error).__name__}: {told}; "
            f"{', for '.join(lines)}). Its result is missing; all others are as they would be."
        )
        remedy = "This is a fault of heatrun, not of the records: report it with this line."
    return Finding(id, "warning", message, where, remedy, test)


TITLE = """# Findings

<!-- Generated by `make docs`: meanings from identify/heatrun/io/texts.toml, what is in doubt from
identify/heatrun/record/findings.py. -->

What `check`, `calibrate` and `discover` find, by the `id` in their JSON. An error forbids a fit, a
warning puts a doubt on it, a note informs. Each finding says what was expected, what came, where,
and what to do.

"""

if __name__ == "__main__":
    write_whole(Path(sys.argv[1]), (TITLE + page()).encode())
