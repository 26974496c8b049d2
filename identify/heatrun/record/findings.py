"""The register of findings: what each id means, and what a finding of it puts in doubt.

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
from typing import Literal, NamedTuple, TypeVar

from ..errors import InputError, UsageError
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


class Kind(NamedTuple):
    """All findings of one id."""

    meaning: str  # What was found, in a sentence.
    doubt: Doubt = ""  # What a warning puts in doubt, of `ORDER`.
    # The same said of the record, as in "To be cleared up first: …"; empty where it is not.
    said: str = ""


FINDINGS: dict[str, Kind] = {
    # files, columns, clocks
    "not_read": Kind("The file cannot be read as a test."),
    "missing_channel": Kind("A channel that every fit needs is missing."),
    "too_few_samples": Kind("Fewer samples than a fit needs."),
    "text_for_numbers": Kind("A column holds text where numbers are expected."),
    "unreadable_cells": Kind(
        "Some cells of a column are no numbers, or marked as not good; they count as missing."
    ),
    "ragged_rows": Kind("Some rows have more or fewer cells than the table."),
    "rows_missing": Kind("The file ends, or was cut, within its rows."),
    "rows_above": Kind("Lines of numbers stand above the names of the columns."),
    "logger_restarted": Kind("The header is repeated: the logger was started again."),
    "decimal_assumed": Kind("A comma may part decimals or thousands; it was read as decimal."),
    "time_assumed": Kind("The unit of the time is not stated and was assumed."),
    "recording_not_closed": Kind("The logger did not close the file; its end may be missing."),
    "sheet_chosen": Kind("The workbook has several sheets; one was read."),
    "variables_left_out": Kind("Some variables of the file are no signals and were left out."),
    "not_recorded": Kind("A column that [columns] names is empty or not in the file."),
    "column_used_twice": Kind(
        "One column stands for two channels.", "inputs", "one column stands for two channels"
    ),
    "columns_disagree": Kind(
        "Two columns of one quantity disagree.", "inputs", "two of its columns disagree"
    ),
    "resistance_conflict": Kind("File and motor file state different phase resistances."),
    "raster_joined": Kind("Channels of different rates were brought to common times."),
    "raster_not_covered": Kind("A channel has no samples for part of the common times."),
    "derived_from_means": Kind("A product was formed of averages: its factors have other rates."),
    "alignment": Kind("Two loggers were aligned; the offset is stated."),
    "alignment_uncertain": Kind("The offset between two loggers is known only roughly."),
    "alignment_rate": Kind("The clocks of two loggers run at different rates."),
    "time_backwards": Kind("The time runs backwards."),
    "time_duplicate": Kind("Samples share one time."),
    "time_gap": Kind("The record has a gap."),
    "time_jitter": Kind("The sampling is uneven."),
    "sampling": Kind("The sampling period, and what it costs."),
    # units
    "unit_assumed": Kind("The unit of a column is not stated and was assumed."),
    "unit_overridden": Kind("The motor file gives another unit than the heading of the column."),
    "unit_beside_name": Kind("A unit in the name of a column was not taken for its unit."),
    "unit_suspected": Kind(
        "Physics of the record suggest another unit.", "inputs", "a column may be in another unit"
    ),
    "units_temperature": Kind(
        "Another unit would suit a temperature better.", "inputs",
        "a temperature may be in another unit",
    ),
    "current_amplitude": Kind(
        "The current may be an amplitude, not an rms value.", "inputs",
        "its current may be an amplitude",
    ),
    "current_maybe_amplitude": Kind(
        "Nothing says whether the current is an rms value.", "inputs",
        "its current may be an amplitude",
    ),
    "current_maybe_rms": Kind(
        "Nothing says whether the d and q currents are amplitudes.", "inputs",
        "its d and q currents may be rms values",
    ),
    # load and losses
    "losses_absent": Kind("The losses are zero while current flows."),
    "losses_absurd": Kind(
        "The losses are beyond those of known machines.", "inputs",
        "its losses are beyond those of known machines",
    ),
    "losses_below_copper": Kind(
        "The losses are below the copper loss of current and resistance.", "inputs",
        "its losses are at times below the copper loss",
    ),
    "losses_negative": Kind("The losses are negative."),
    "losses_of_dc_link": Kind("The losses hold those of the inverter."),
    "losses_of_shaft": Kind(
        "The losses are the input or the shaft power.", "inputs",
        "its losses may be the power that goes in, or the shaft's",
    ),
    "load_spike": Kind("Samples of the load show no heat in the winding: a marker or a fault."),
    "load_late": Kind("The load is recorded later or earlier than the temperatures."),
    "load_stuck": Kind("A column of the load stands still: the value was held, not measured."),
    "standstill_losses": Kind("At standstill the losses are not those of the copper."),
    "resistance_coefficient": Kind("The resistance changes with temperature unlike the material."),
    "current_scale_unchecked": Kind("No test tells the scale of the current."),
    "shaft_power_disagrees": Kind("The balance of powers asks for another gain of the torque."),
    "saturation": Kind("A channel stands at one extreme value: the range of the amplifier."),
    # temperatures
    "nan_block": Kind("A channel has no readings for a while."),
    "sensors_differ": Kind("One of several sensors or phases differs from the others."),
    "sensor_stuck": Kind("A reading does not move while the load does."),
    "sensor_detached": Kind("A sensor came off, at once or slowly: no machine cools like that."),
    "temperature_jump": Kind("A reading jumps faster than any heat could move it."),
    "resolution": Kind("The resolution of the readings, and what it costs."),
    "truncation": Kind("Readings may be truncated, not rounded."),
    "ambient_implausible": Kind(
        "The sink temperature is unusual.", "inputs", "its sink temperature is unusual"
    ),
    "ambient_moving": Kind("The ambient temperature moves during the test."),
    "start_not_in_equilibrium": Kind("The machine was not at the sink temperature at the start."),
    "cut_while_warm": Kind("The test begins within its record, while the machine is warm."),
    # what the test can tell
    "no_heating": Kind("The winding does not warm, or only cools."),
    "too_short": Kind(
        "The test is too short for the slow time constant.",
        said="it is too short for the slow time constant",
    ),
    "single_step": Kind("The test holds a single load step.", said="it holds a single load step"),
    "other_test": Kind("A [tests.NAME] of the motor file is for none of the tests given."),
    "simulated_by_heatrun": Kind(
        "The record was simulated by heatrun, not measured.", "parameters",
        "it was simulated by heatrun, not measured",
    ),
    "model_refused": Kind("The test lacks what the network or its effects need."),
    # the fit
    "not_converged": Kind("The fit did not converge.", "parameters"),
    "several_optima": Kind("Several sets of parameters fit the tests about as well."),
    "instrument_beyond_prior": Kind(
        "An error of an instrument stands far from its prior.", "parameters"
    ),
    "prior_conflict": Kind("A parameter stands far from its prior.", "parameters"),
    "misfit": Kind("The residuals exceed the noise.", "network"),
    "missing_effect": Kind("The tests ask for an effect that the network lacks.", "network"),
    "effects_left_out": Kind("Effects that the tests ask for are not in the model.", "network"),
    "effect_ambiguous": Kind("The tests do not tell which of several effects is there.", "network"),
    "effects_in_model": Kind("Effects that the tests ask for are in the model."),
    "heat_overrules_tests": Kind("Unmodelled heat keeps the network from tests it could follow."),
    "heat_held_down": Kind("Unmodelled heat was held down so that the network follows the tests."),
    "tests_disagree": Kind("The tests ask for different values of a parameter."),
    "body_disagrees": Kind("A measured body is not where the model puts its node."),
    "reduction": Kind("Averaging over steps changes the simulated temperature."),
    "between_samples": Kind("The load changes between its samples."),
    "step_failed": Kind("A step of the calculation failed; its result is missing.", "judgement"),
    "output_failed": Kind("A figure or a file of the result failed and is missing."),
    "sampling_not_converged": Kind("MCMC did not converge.", "intervals"),
    "holdout_outside_band": Kind(
        "Readings of a held-out test lie outside the 95 % band.", "predictions"
    ),
    "calibration_outside_band": Kind("Readings of a fitted test lie outside the 95 % band."),
    "corrections_left_out": Kind("An export has no place for the corrections of the run."),
}  # fmt: skip
"""Id to its kind: of what a record holds first, then of the fit."""


def with_doubt(*doubts: Doubt) -> tuple[str, ...]:
    """Return the ids whose warnings put something in doubt, the gravest first."""
    return tuple(
        id
        for doubt in ORDER
        if doubt in doubts
        for id, kind in FINDINGS.items()
        if kind.doubt == doubt
    )


def page(findings: Iterable[tuple[str, Kind]]) -> str:
    """Return a table of findings in Markdown."""
    rows = [f"| `{id}` | {kind.meaning} | {ORDER[kind.doubt]} |" for id, kind in findings]
    head = "| id | what was found | what a warning puts in doubt |\n|---|---|---|"
    return "\n".join([head, *rows]) + "\n"


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


TITLE = """# Findings

<!-- Generated by `make docs` from identify/heatrun/record/findings.py: change it there. -->

What `check`, `calibrate` and `discover` find, by the `id` in their JSON. An error forbids a fit, a
warning puts a doubt on it, a note informs. Each finding says what was expected, what came, where,
and what to do.

"""

if __name__ == "__main__":
    from pathlib import Path

    write_whole(Path(sys.argv[1]), (TITLE + page(FINDINGS.items())).encode())
