"""Whether records have what a network and its known effects need, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import InputError
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.reduction import reduce
from .catalogue import known_effects, refuse_lacking
from .model import Model
from .model_parameters import parameters
from .network_text import networks_of


def check_model(
    networks: str | None, effects: str, motor: Motor, records: Sequence[Record]
) -> tuple[Finding, ...]:
    """Return what forbids to calibrate networks with known effects on records.

    Args:
        networks: As after `--model`; None to look at the channels of the effects alone.
        effects: Ids of known effects beside those of the motor file, with commas between.
        motor: The machine.
        records: Records without errors of their own.

    Returns:
        For each record the first reason, as an error; empty if there is none.

    Raises:
        InputError: If there is no such network or effect, or its file is wrong.
    """
    known = known_effects(motor, effects)
    if networks is None and not known:
        return ()
    models = [Model.of(form, motor, known) for form in networks_of(networks)] if networks else []
    findings = []
    for record in records:
        test = reduce(record, motor)
        try:
            refuse_lacking(known, [test])
            for model in models:
                parameters(model, motor, [test])
        except InputError as error:
            findings.append(_refusal(error, record))
    return tuple(findings)


def check_second_order(effects: str, motor: Motor, records: Sequence[Record]) -> dict[str, Finding]:
    """Return what the second order lacks, by the name of the record.

    Args:
        effects: As `check_model`.
        motor: The machine; where its file is for another network alone, nothing is lacking.
        records: Records without errors of their own.
    """
    try:
        found = check_model("second", effects, motor, records)
    except InputError:
        return {}
    return {finding.test: finding for finding in found}


def _refusal(error: InputError, record: Record) -> Finding:
    return Finding(
        id="model_refused",
        severity="error",
        message=f"This test cannot be used with the network and its effects: {error.problem}",
        where=error.where,
        remedy=error.remedy,
        test=record.name,
    )
