"""What is said of a test that is predicted only: it need not show a parameter."""

from __future__ import annotations

from dataclasses import replace

from ..record import Finding

LITTLE = (
    "The winding hardly changes: the prediction of this test says how the model holds a level, "
    "not how it follows a load."
)


def as_holdout(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return the findings of a record as they stand where nothing is fitted to it.

    A winding that does not warm forbids a fit, and is no obstacle to a prediction.

    Args:
        findings: Of the record, as `check_record` returns them.
    """
    return tuple(
        replace(each, severity="warning", message=LITTLE, remedy="")
        if each.id == "no_heating" and each.severity == "error" and "rise_K" in each.values
        else each
        for each in findings
    )
