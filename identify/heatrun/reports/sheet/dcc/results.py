"""What was found, as elements of the DCC: statements, method, instruments, conditions, results."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element

from ....certificate import Certificate
from ....io.printable import clean
from ....io.quantities import rounded
from ....results import FitResult
from ....results.parameter import FittedParameter
from ....results.tested import DescribedTest
from ....runs.verdict import favoured, headline
from ..certificate import ENGLISH, judged
from ..digits import format_value
from ..printed import COVERAGE_FACTOR, interval_ends, printed
from .elements import add, add_real, add_text

METHOD = "Identification of a lumped thermal network"

HOW = (
    "The parameters of the network are fitted to the course of the winding's temperature over time "
    "by Bayesian inference. The expanded uncertainty is twice the standard uncertainty (k = 2) and "
    "contains the noise of the test and the stated uncertainties of the instruments. A quantity "
    "whose 95 % interval is skewed carries that interval."
)


def add_results(root: Element, about: Element, result: FitResult, certificate: Certificate) -> None:
    """Add the statements and the results to a certificate.

    Args:
        root: The certificate.
        about: Its administrative data.
        result: What stands in `fit.json`.
        certificate: What the laboratory states.
    """
    _statements(add(about, "statements"), result, certificate)
    measured = add(add(root, "measurementResults"), "measurementResult")
    network = result.models[favoured(result)]
    add_text(measured, "name", f"Thermal network, {network.title}")
    method = add(add(measured, "usedMethods"), "usedMethod")
    add_text(method, "name", METHOD)
    add_text(method, "description", HOW)
    add(method, "reference", "JCGM 100:2008")
    software = add(add(measured, "usedSoftware"), "software")
    add_text(software, "name", "heatrun")
    add(software, "release", result.heatrun_version)
    if certificate.instruments:
        _instruments(add(measured, "measuringEquipments"), certificate)
    fitted = [test for test in result.tests if test.role == "calibration"]
    conditions = list(_conditions(result, fitted))
    if conditions:
        held = add(measured, "influenceConditions")
        for name, unit, (low, high) in conditions:
            _condition(held, name, unit, low, high)
    found = add(add(measured, "results"), "result")
    add_text(found, "name", f"Parameters of the {network.title} network")
    data = add(found, "data")
    for name, entry in network.parameters.items():
        _parameter(data, name, entry)
    _tests(add(measured, "measurementMetaData"), result)


def _statements(parent: Element, result: FitResult, certificate: Certificate) -> None:
    said = headline(result)
    rows = [
        ("Use of the result", " ".join((said.sentence, *map(clean, said.reasons)))),
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


def _condition(parent: Element, name: str, unit: str, low: float, high: float) -> None:
    held = add(parent, "influenceCondition")
    add_text(held, "name", name)
    data = add(held, "data")
    for word, value in (("smallest", low), ("largest", high)):
        quantity = add(data, "quantity")
        add_text(quantity, "name", f"{word} {name}")
        add_real(quantity, f"{value:.1f}", unit)


def _parameter(parent: Element, name: str, entry: FittedParameter) -> None:
    """Add a parameter with the digits of the sheet."""
    quantity = add(parent, "quantity")
    add_text(quantity, "name", f"{name}: {entry.meaning}")
    words = "; ".join(text for text in (judged(entry), entry.why or "") if text)
    if words:
        add_text(quantity, "description", words)
    form = printed(entry).form
    if form == "given":
        add_real(quantity, rounded(entry.value, 5), entry.unit, label=name)
    elif form == "expanded":
        value, expanded = format_value(entry.value, COVERAGE_FACTOR * entry.sd)
        add_real(quantity, value, entry.unit, label=name, expanded=expanded)
    else:
        value, standard = format_value(entry.value, entry.sd)
        interval = (standard, *interval_ends(entry.interval_95, entry.sd))
        add_real(quantity, value, entry.unit, label=name, interval=interval)


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
