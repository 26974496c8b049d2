"""The Digital Calibration Certificate of a run, as XML: its elements, its results, the whole.

Reference: Physikalisch-Technische Bundesanstalt, DCC schema 3.3.0 and D-SI schema 2.2.1.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement, register_namespace

from ..errors import InputError
from ..io.quantities import clean, printed_unit, quantity, rounded
from ..record.motor import Certificate, Instrument
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


class Words(str):
    """A text in the language of the certificate."""


Content = str | Words | Mapping[str, "Content"] | Sequence["Content"]
"""A text, elements by name, or several elements of one name."""


def fill(parent: Element, content: Mapping[str, Content]) -> None:
    """Add elements of the DCC by name, in order; what is empty is left out."""
    for name, held in content.items():
        for each in [held] if isinstance(held, str | Mapping) else held:
            if isinstance(each, Mapping):
                inner = add(parent, name)
                fill(inner, each)
                if not len(inner):
                    parent.remove(inner)
            elif each:
                (add_text if isinstance(each, Words) else add)(parent, name, str(each))


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
    fill(measured, {
        "usedMethods": {"usedMethod": {
            "name": Words(name), "description": Words(how), "reference": [*references],
        }},
        # PTB's rules of good practice ask for the letter
        "usedSoftware": {"software": {"name": Words("heatrun"), "release": f"v{version}"}},
        "measuringEquipments": {"measuringEquipment": [*map(_equipment, certificate.instruments)]},
    })  # fmt: skip


def add_statements(parent: Element, use: str, certificate: Certificate) -> None:
    """Add how far a result can be used, and what the laboratory states beside it."""
    rows = (
        ("Use of the result", use), ("Scope", ENGLISH("scope")),
        ("Remarks", certificate.remarks), ("Test bench", certificate.bench),
    )  # fmt: skip
    said = [{"name": Words(name), "declaration": Words(text)} for name, text in rows if text]
    fill(parent, {"statement": said})


def _equipment(one: Instrument) -> Content:
    about = {"measures": one.quantity, "class": one.accuracy_class,
             "calibration": one.calibration, "valid until": one.valid_until}  # fmt: skip
    said = "; ".join(f"{key}: {value}" for key, value in about.items() if value)
    return {
        "name": Words(one.instrument or one.quantity or "not named"), "description": Words(said)
    }  # fmt: skip


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
        digest = f"SHA-256 of its first file: {test.sha256}" if test.sha256 else "made in memory"
        length = f"{test.duration_s / 60:.1f} min, {test.num_samples} samples"
        fill(parent, {"metaData": {"name": Words(f"Test {clean(test.name)} ({test.role})"),
                                   "declaration": Words(f"{length}. {digest}.")}})  # fmt: skip


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
    given = certificate
    # who approves it signs, else the operator
    persons = [(given.approved_by, "approved by"), (given.operator, "operator")]
    persons = [(name, role) for name, role in persons if name]
    fill(about, {
        "dccSoftware": {"software": {
            "name": Words("heatrun"), "release": f"v{version}", "type": "application",
        }},
        "coreData": {
            "countryCodeISO3166_1": given.country,
            "usedLangCodeISO639_1": LANGUAGE,
            "mandatoryLangCodeISO639_1": LANGUAGE,
            "uniqueIdentifier": given.number,
            "receiptDate": given.received,
            "beginPerformanceDate": days.first,
            "endPerformanceDate": days.last,
            "performanceLocation": given.performed_at,
            "issueDate": given.issue_date,
        },
        "items": {"item": {
            "name": Words(clean(machine)),
            "description": Words(given.condition),
            "manufacturer": {"name": Words(given.manufacturer)},
            "model": given.machine_type,
            "identifications": {"identification": {
                "issuer": "manufacturer", "value": given.serial_number,
                "name": Words("Serial number"),
            }},
        }},
        "calibrationLaboratory": {"contact": {
            "name": Words(given.laboratory),
            "location": {"countryCode": given.country, "further": Words(given.laboratory_address)},
        }},
        "respPersons": {"respPerson": [
            {"person": {"name": Words(name)}, "role": role, "mainSigner": str(not place).lower()}
            for place, (name, role) in enumerate(persons)
        ]},
        "customer": {
            "name": Words(given.customer), "location": {"further": Words(given.customer_address)},
        },
    })  # fmt: skip
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
