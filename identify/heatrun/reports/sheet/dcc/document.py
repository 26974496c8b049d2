"""The Digital Calibration Certificate of a run, as XML.

Reference: Physikalisch-Technische Bundesanstalt, DCC schema 3.3.0 and D-SI schema 2.2.1.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ....certificate import Certificate
from ....errors import InputError
from ....io.printable import clean
from ....results import FitResult
from ..days import TestDays, test_days
from .elements import DCC, LANGUAGE, XSI, add, add_text
from .results import add_results

VERSION = "3.3.0"

NEEDED: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("number", ("number",)),
    ("laboratory", ("laboratory",)),
    ("laboratory_address", ("laboratory_address",)),
    ("country", ("country",)),
    ("customer", ("customer",)),
    ("customer_address", ("customer_address",)),
    ("serial_number", ("serial_number",)),
    ("performed_at", ("performed_at",)),
    ("approved_by or operator", ("approved_by", "operator")),
)
"""What a DCC must say and only the laboratory knows: words for it, and the keys of which one is
needed."""


def dcc_text(result: FitResult, certificate: Certificate) -> bytes:
    """Return the Digital Calibration Certificate of a run.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states.

    Raises:
        InputError: If it does not state what such a certificate must say.
    """
    days = test_days(result, certificate)
    _require(certificate, days)
    root = Element(f"{{{DCC}}}digitalCalibrationCertificate")
    root.set("schemaVersion", VERSION)
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} {DCC}/v{VERSION}/dcc.xsd")
    about = add(root, "administrativeData")
    _software(add(about, "dccSoftware"), result)
    _core(add(about, "coreData"), certificate, days)
    _item(add(about, "items"), result, certificate)
    laboratory = add(add(about, "calibrationLaboratory"), "contact")
    add_text(laboratory, "name", certificate.laboratory)
    _location(laboratory, certificate.laboratory_address, certificate.country)
    _persons(add(about, "respPersons"), certificate)
    customer = add(about, "customer")
    add_text(customer, "name", certificate.customer)
    _location(customer, certificate.customer_address, "")
    add_results(root, about, result, certificate)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _require(certificate: Certificate, days: TestDays) -> None:
    """Refuse to write a certificate that lacks what it must say: nothing is made up for it.

    Raises:
        InputError: With the keys.
    """
    missing = [
        words for words, keys in NEEDED if not any(getattr(certificate, key) for key in keys)
    ]
    if not days.first:
        missing.append("test_from (the records have no date)")
    if missing:
        raise InputError(
            "A Digital Calibration Certificate needs more than is given. Missing: "
            f"{', '.join(missing)}.",
            where="[certificate]",
            remedy="Add them to [certificate] of the motor file, or give them by --meta FILE.",
        )


def _software(parent: Element, result: FitResult) -> None:
    software = add(parent, "software")
    add_text(software, "name", "heatrun")
    add(software, "release", result.heatrun_version)
    add(software, "type", "application")


def _core(parent: Element, certificate: Certificate, days: TestDays) -> None:
    add(parent, "countryCodeISO3166_1", certificate.country)
    add(parent, "usedLangCodeISO639_1", LANGUAGE)
    add(parent, "mandatoryLangCodeISO639_1", LANGUAGE)
    add(parent, "uniqueIdentifier", certificate.number)
    if certificate.received:
        add(parent, "receiptDate", certificate.received)
    add(parent, "beginPerformanceDate", days.first)
    add(parent, "endPerformanceDate", days.last)
    add(parent, "performanceLocation", certificate.performed_at)
    if certificate.issue_date:
        add(parent, "issueDate", certificate.issue_date)


def _item(parent: Element, result: FitResult, certificate: Certificate) -> None:
    item = add(parent, "item")
    add_text(item, "name", clean(result.motor.name))
    if certificate.condition:
        add_text(item, "description", certificate.condition)
    if certificate.manufacturer:
        add_text(add(item, "manufacturer"), "name", certificate.manufacturer)
    if certificate.machine_type:
        add(item, "model", certificate.machine_type)
    identification = add(add(item, "identifications"), "identification")
    add(identification, "issuer", "manufacturer")
    add(identification, "value", certificate.serial_number)
    add_text(identification, "name", "Serial number")


def _location(parent: Element, address: str, country: str) -> None:
    location = add(parent, "location")
    if country:
        add(location, "countryCode", country)
    add_text(location, "further", address)


def _persons(parent: Element, certificate: Certificate) -> None:
    """Add who answers for the certificate: who approves it signs, else the operator."""
    persons = [(certificate.approved_by, "approved by"), (certificate.operator, "operator")]
    for number, (name, role) in enumerate(each for each in persons if each[0]):
        person = add(parent, "respPerson")
        add_text(add(person, "person"), "name", name)
        add(person, "role", role)
        add(person, "mainSigner", "true" if number == 0 else "false")
