"""The Digital Calibration Certificate of a run, as XML: its elements, its results, the whole.

Reference: Physikalisch-Technische Bundesanstalt, DCC schema 3.3.0 and D-SI schema 2.2.1.
"""

import re
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement, register_namespace

from ..errors import InputError
from ..io.quantities import clean, printed_unit, quantity, rounded
from ..record.motor import Certificate
from ..results import FitResult
from ..results.model import DescribedTest, FittedParameter
from ..results.values import BudgetRow, Interval, combined
from ..runs.verdict import favoured, headline
from ..version import __version__
from .certificate import ENGLISH, ParameterLine, figure_lines, judged, parameter_lines
from .printed import (
    COVERAGE_FACTOR,
    TestDays,
    format_value,
    interval_ends,
    printed,
    test_days,
    uncertain,
)

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
XSI = "http://www.w3.org/2001/XMLSchema-instance"

for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
    register_namespace(prefix, space)

LANGUAGE = "en"
"""In which heatrun writes."""

NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 has no way to write (section 2.2)."""

UNITS: dict[str, str] = {
    "1": r"\one",
    "%": r"\percent",
    "K": r"\kelvin",
    "degC": r"\degreecelsius",
    "W": r"\watt",
    "A": r"\ampere",
    "V": r"\volt",
    "s": r"\second",
    "ohm": r"\ohm",
    "J/K": r"\joule\per\kelvin",
    "K/W": r"\kelvin\per\watt",
    "W/K": r"\watt\per\kelvin",
    "1/K": r"\per\kelvin",
    "K/h": r"\kelvin\per\hour",
    "h": r"\hour",
    "1/h": r"\per\hour",
    "m^2": r"\metre\tothe{2}",
    "N m": r"\newton\metre",
    "rpm": r"\per\minute",
}
"""Units as D-SI writes them, by the way heatrun does."""


def add(parent: Element, name: str, text: str | None = None) -> Element:
    """Add an element of the DCC to another one."""
    return _add(parent, DCC, name, text)


def add_text(parent: Element, name: str, text: str) -> Element:
    """Add an element that holds a text in the language of the certificate."""
    element = add(parent, name)
    add(element, "content", text).set("lang", LANGUAGE)
    return element


def add_real(
    parent: Element,
    value: str,
    unit: str,
    *,
    label: str = "",
    expanded: str = "",
    interval: tuple[str, str, str] | None = None,
) -> Element:
    """Add a quantity as D-SI.

    Args:
        parent: What it belongs to.
        value: The number as it is printed.
        unit: As heatrun writes it.
        label: Its name, or empty.
        expanded: Expanded uncertainty with k = 2 for 95 %, or empty.
        interval: Standard uncertainty and both ends of the 95 % interval, where that is not value
            ± expanded.

    Raises:
        InputError: If D-SI has no word for the unit.
    """
    if unit not in UNITS:
        raise InputError(
            f"The unit {unit} has no form in the Digital Calibration Certificate.",
            remedy="Write the sheet without --dcc.",
        )
    real = _add(parent, SI, "real")
    if label:
        _add(real, SI, "label", label)
    _add(real, SI, "value", value)
    _add(real, SI, "unit", UNITS[unit])
    if expanded:
        held = _add(_add(real, SI, "measurementUncertaintyUnivariate"), SI, "expandedMU")
        parts = (("valueExpandedMU", expanded), ("coverageFactor", "2"))
    elif interval is not None:
        held = _add(_add(real, SI, "measurementUncertaintyUnivariate"), SI, "coverageIntervalMU")
        names = ("valueStandardMU", "intervalMin", "intervalMax")
        parts = tuple(zip(names, interval, strict=True))
    else:
        return real
    for name, text in (*parts, ("coverageProbability", "0.95")):
        _add(held, SI, name, text)
    return real


def add_uncertain(
    parent: Element, value: float, sd: float, interval: Interval, unit: str, *, label: str = ""
) -> Element:
    """Add a quantity as it is printed: with its expanded uncertainty, or skewed with its interval.

    Args:
        parent: What it belongs to.
        value: The value.
        sd: Its standard uncertainty.
        interval: Its 95 % interval.
        unit: As heatrun writes it.
        label: Its name, or empty.
    """
    if uncertain(value, sd, interval, unit).form == "expanded":
        text, expanded = format_value(value, COVERAGE_FACTOR * sd)
        return add_real(parent, text, unit, label=label, expanded=expanded)
    text, standard = format_value(value, sd)
    ends = interval_ends(interval, sd)
    return add_real(parent, text, unit, label=label, interval=(standard, *ends))


def _add(parent: Element, space: str, name: str, text: str | None = None) -> Element:
    element = SubElement(parent, f"{{{space}}}{name}")
    if text is not None:
        element.text = " ".join(NOT_IN_XML.sub("\ufffd", text).split())
    return element


METHOD = "Identification of a lumped thermal network"

HOW = (
    "The parameters of the network are fitted to the course of the winding's temperature over time "
    "by Bayesian inference. The expanded uncertainty is twice the standard uncertainty (k = 2) and "
    "contains the noise of the test and the stated uncertainties of the instruments. A quantity "
    "whose 95 % interval is skewed carries that interval."
)


def add_results(root: Element, about: Element, result: FitResult, certificate: Certificate) -> None:
    """Add the statements and the results to a certificate."""
    said = headline(result)
    use = " ".join((said.sentence, *map(clean, said.reasons)))
    add_statements(add(about, "statements"), use, certificate)
    measured = add(add(root, "measurementResults"), "measurementResult")
    network = result.models[favoured(result)]
    add_text(measured, "name", f"Thermal network, {network.title}")
    add_method(measured, METHOD, HOW, ("JCGM 100:2008",), result.heatrun_version, certificate)
    fitted = [test for test in result.tests if test.role == "calibration"]
    conditions = list(_conditions(result, fitted))
    if conditions:
        held = add(measured, "influenceConditions")
        for name, unit, (low, high) in conditions:
            add_condition(held, name, unit, low, high)
    found = add(measured, "results")
    data = add_result(found, f"Parameters of the {network.title} network")
    lines = [line for line in parameter_lines(network) if line.figure is None or line.sd > 0]
    for line in lines:
        _parameter(data, line)
    following = [line for line in figure_lines(network) if line.sd > 0]
    if following:
        data = add_result(found, "What follows from the parameters")
    for line in following:
        _parameter(data, line)
    for line in (*lines, *following):
        if line.budget:
            add_budget(found, line.name, line.budget, line.unit)
    _tests(add(measured, "measurementMetaData"), result)


def add_method(
    measured: Element,
    name: str,
    how: str,
    references: Iterable[str],
    version: str,
    certificate: Certificate,
) -> None:
    """Add method, software and instruments to a result."""
    method = add(add(measured, "usedMethods"), "usedMethod")
    add_text(method, "name", name)
    add_text(method, "description", how)
    for each in references:
        add(method, "reference", each)
    software = add(add(measured, "usedSoftware"), "software")
    add_text(software, "name", "heatrun")
    add(software, "release", f"v{version}")  # PTB's rules of good practice ask for the letter
    if certificate.instruments:
        _instruments(add(measured, "measuringEquipments"), certificate)


def add_statements(parent: Element, use: str, certificate: Certificate) -> None:
    """Add how far a result can be used, and what the laboratory states beside it."""
    rows = [
        ("Use of the result", use),
        ("Scope", ENGLISH("scope")),
        ("Remarks", certificate.remarks),
        ("Test bench", certificate.bench),
    ]
    for name, text in rows:
        if text:
            statement = add(parent, "statement")
            add_text(statement, "name", name)
            add_text(statement, "declaration", text)


def _instruments(parent: Element, certificate: Certificate) -> None:
    for one in certificate.instruments:
        held = add(parent, "measuringEquipment")
        add_text(held, "name", one.instrument or one.quantity or "not named")
        about = {
            "measures": one.quantity,
            "class": one.accuracy_class,
            "calibration": one.calibration,
            "valid until": one.valid_until,
        }
        words = "; ".join(f"{key}: {value}" for key, value in about.items() if value)
        if words:
            add_text(held, "description", words)


def _conditions(
    result: FitResult, fitted: list[DescribedTest]
) -> Iterable[tuple[str, str, tuple[float, float]]]:
    """Yield name, unit and range over the fitted tests of each condition that was recorded."""
    sink = f"temperature of the sink ({result.motor.sink})"
    for name, unit, spans in (
        ("phase current, rms", "A", [test.current_A for test in fitted]),
        ("losses", "W", [test.losses_W for test in fitted]),
        ("speed", "rpm", [test.speed_rpm for test in fitted]),
        ("temperature of the winding", "degC", [test.winding_degC for test in fitted]),
        (sink, "degC", [test.sink_degC for test in fitted]),
    ):
        known = [span for span in spans if span is not None]
        if known:
            yield name, unit, (min(s[0] for s in known), max(s[1] for s in known))


def add_condition(parent: Element, name: str, unit: str, *values: float) -> None:
    """Add a condition by its value, or by its smallest and largest."""
    held = add(parent, "influenceCondition")
    add_text(held, "name", name)
    data = add(held, "data")
    words = ("smallest ", "largest ")[: len(values)] if len(values) > 1 else ("",)
    for word, value in zip(words, values, strict=True):
        add_real(add_named(data, f"{word}{name}"), f"{value:.1f}", unit)


def add_result(parent: Element, name: str) -> Element:
    """Add a result, and return what holds its quantities."""
    found = add(parent, "result")
    add_text(found, "name", name)
    return add(found, "data")


def add_named(data: Element, name: str, words: str = "") -> Element:
    """Add a quantity with its name, described by `words`."""
    held = add(data, "quantity")
    add_text(held, "name", name)
    if words:
        add_text(held, "description", words)
    return held


def add_budget(
    parent: Element, name: str, rows: Sequence[BudgetRow], unit: str, *, label: str = ""
) -> None:
    """Add where an uncertainty comes from: what each source brings, and how, in words.

    Args:
        parent: The results.
        name: Whose uncertainty it is.
        rows: The budget.
        unit: Of the answer, as heatrun writes it.
        label: Name of the combined standard uncertainty, or empty.
    """
    data = add_result(parent, f"Uncertainty budget of {name} (JCGM 100, first order)")
    for row in rows:
        words = f"type {row.type}; share of the variance {100.0 * row.share:.2f} %"
        if row.standard_uncertainty is not None and row.sensitivity is not None:
            words = (
                f"standard uncertainty {quantity(f'{row.standard_uncertainty:.3g}', row.unit)}; "
                f"sensitivity {row.sensitivity:.4g} {printed_unit(unit)} per "
                f"{quantity('1', row.unit)}; {words}"
            )
        add_real(add_named(data, row.source, words), f"{row.contribution:.3g}", unit)
    total = add_named(data, "combined standard uncertainty, first order")
    add_real(total, f"{combined(rows):.3g}", unit, label=label)


def _parameter(data: Element, line: ParameterLine) -> None:
    """Add a parameter with the digits of the sheet, or what it is at stated conditions."""
    entry, figure = line.entry, line.figure
    if figure is not None:
        held = add_named(data, f"{line.name}: {line.meaning}")
        add_uncertain(held, figure.median, line.sd, figure.ends, line.unit)
        return
    assert entry is not None  # a line is of the one or the other
    words = "; ".join(text for text in (judged(entry), _types(entry), entry.why or "") if text)
    held = add_named(data, f"{line.name}: {line.meaning}", words)
    if printed(entry).form == "given":
        add_real(held, rounded(entry.value, 5), entry.unit, label=line.name)
    else:
        add_uncertain(held, entry.value, entry.sd, entry.interval_95, entry.unit, label=line.name)


def _types(entry: FittedParameter) -> str:
    """Return the two parts of the standard uncertainty in words; nothing where they are unknown."""
    if entry.sd_type_a is None or entry.sd_type_b is None or printed(entry).form == "given":
        return ""
    whole, a, b = (format_value(each, entry.sd)[0]
                   for each in (entry.sd, entry.sd_type_a, entry.sd_type_b))  # fmt: skip
    return (
        f"standard uncertainty {quantity(whole, entry.unit)}: type A {quantity(a, entry.unit)}, "
        f"type B (stated instruments) {quantity(b, entry.unit)}"
    )


def _tests(parent: Element, result: FitResult) -> None:
    for test in result.tests:
        held = add(parent, "metaData")
        add_text(held, "name", f"Test {clean(test.name)} ({test.role})")
        digest = f"SHA-256 of its first file: {test.sha256}" if test.sha256 else "made in memory"
        add_text(
            held,
            "declaration",
            f"{test.duration_s / 60:.1f} min, {test.num_samples} samples. {digest}.",
        )


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

    Raises:
        InputError: If it does not state what such a certificate must say.
    """
    days = test_days(result, certificate)
    root, about = begun(certificate, days, result.motor.name, result.heatrun_version)
    add_results(root, about, result, certificate)
    return as_bytes(root)


def begun(
    certificate: Certificate, days: TestDays, machine: str, version: str = __version__
) -> tuple[Element, Element]:
    """Return a certificate with its administrative data, and these.

    Raises:
        InputError: As `dcc_text`.
    """
    _require(certificate, days)
    root = Element(f"{{{DCC}}}digitalCalibrationCertificate")
    root.set("schemaVersion", VERSION)
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} {DCC}/v{VERSION}/dcc.xsd")
    about = add(root, "administrativeData")
    _software(add(about, "dccSoftware"), version)
    _core(add(about, "coreData"), certificate, days)
    _item(add(about, "items"), machine, certificate)
    laboratory = add(add(about, "calibrationLaboratory"), "contact")
    add_text(laboratory, "name", certificate.laboratory)
    _location(laboratory, certificate.laboratory_address, certificate.country)
    _persons(add(about, "respPersons"), certificate)
    customer = add(about, "customer")
    add_text(customer, "name", certificate.customer)
    _location(customer, certificate.customer_address, "")
    return root, about


def as_bytes(root: Element) -> bytes:
    """Return a certificate as the bytes of its file."""
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


def _software(parent: Element, version: str) -> None:
    software = add(parent, "software")
    add_text(software, "name", "heatrun")
    add(software, "release", f"v{version}")
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


def _item(parent: Element, machine: str, certificate: Certificate) -> None:
    item = add(parent, "item")
    add_text(item, "name", clean(machine))
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
