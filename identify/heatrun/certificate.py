"""What a certificate says beside the results: who, what, when, with which instruments.

It stands in `[certificate]` of the motor file or in a file of its own (`--meta`). All of it may be
left out; what is not given is a blank line on the certificate.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

PLACES = ("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
"""Where a test can have been made, by the words of the Digital Calibration Certificate."""

INSTRUMENT_KEYS = ("quantity", "instrument", "class", "calibration", "valid_until")


@dataclass(frozen=True)
class Instrument:
    """A measuring instrument.

    Attributes:
        quantity: What it measured.
        instrument: Its name, with type and number.
        accuracy_class: Its class or uncertainty.
        calibration: Reference of its own calibration.
        valid_until: Day until which that is valid, ISO 8601.
    """

    quantity: str = ""
    instrument: str = ""
    accuracy_class: str = ""
    calibration: str = ""
    valid_until: str = ""


@dataclass(frozen=True)
class Certificate:
    """What `[certificate]` says; what is not given is empty. Days are ISO 8601.

    Attributes:
        number: Number of the certificate.
        laboratory: Who made the test.
        laboratory_address: Where the laboratory is.
        customer: For whom.
        customer_address: Where the customer is.
        machine_type: Type of the machine.
        manufacturer: Of the machine.
        serial_number: Of the machine.
        condition: State in which the machine was tested.
        operator: Who ran the test.
        approved_by: Who answers for the certificate.
        bench: The test bench.
        remarks: Whatever else is to stand there.
        received: Day on which the machine came.
        test_from: First day of the test.
        test_until: Last day of the test.
        issue_date: Day on which the certificate was issued.
        performed_at: One of `PLACES`.
        country: Of the laboratory, two letters of ISO 3166-1.
        language: Of the sheet, by `heatrun.reports.texts.LANGUAGES`; empty for English.
        instruments: What was measured with.
    """

    number: str = ""
    laboratory: str = ""
    laboratory_address: str = ""
    customer: str = ""
    customer_address: str = ""
    machine_type: str = ""
    manufacturer: str = ""
    serial_number: str = ""
    condition: str = ""
    operator: str = ""
    approved_by: str = ""
    bench: str = ""
    remarks: str = ""
    received: str = ""
    test_from: str = ""
    test_until: str = ""
    issue_date: str = ""
    performed_at: str = ""
    country: str = ""
    language: str = ""
    instruments: tuple[Instrument, ...] = ()

    def beneath(self, other: Certificate) -> Certificate:
        """Return this one with whatever another one says in the place of its own."""
        names = [field.name for field in fields(self)]
        given = {name: value for name in names if (value := getattr(other, name))}
        return replace(self, **given)

    def lost_to(self, other: Certificate) -> dict[str, tuple[Any, Any]]:
        """Return what this one says and another one does not: by key, here and there."""
        names = [field.name for field in fields(self) if field.name != "language"]
        pairs = {name: (getattr(self, name), getattr(other, name)) for name in names}
        return {name: pair for name, pair in pairs.items() if pair[0] and pair[0] != pair[1]}

    def as_section(self) -> dict[str, Any]:
        """Return what the section would hold; it reads back to the same."""
        content = {key: value for key, value in asdict(self).items() if value}
        if self.instruments:
            content["instruments"] = [_as_table(one) for one in self.instruments]
        return content


def _as_table(instrument: Instrument) -> dict[str, str]:
    values = dict(zip(INSTRUMENT_KEYS, asdict(instrument).values(), strict=True))
    return {key: value for key, value in values.items() if value}
