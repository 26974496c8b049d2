"""Page 1 of the sheet, what a customer reads: as plain text in rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ...certificate import Certificate
from ...io.printable import clean
from ...results import FitResult
from ...results.derived import AT_REST, LOADED, DerivedFigure
from ...results.model import FittedModel
from ...results.parameter import FittedParameter
from ...results.tested import DescribedTest
from ...results.values import Interval, known, number
from ...runs.verdict import favoured, headline
from .days import test_days
from .printed import RULE, printed, uncertain
from .stated import num_stated

TITLE = "Certificate of thermal parameters"

JUDGEMENTS = {
    "identified": "identified",
    "weak": "known roughly",
    "not identifiable": "not identifiable from these tests",
    "fixed": "given, not measured",
}
"""How well a parameter is known, in words."""

MOST_ON_PAGE_1, MOST_LETTERS = 6, 450
"""Instruments, and letters of all together, that page 1 has room for."""

LONGEST_FOOT = 40
"""Letters of the number of the certificate at the foot of a page."""

GIVEN = "of the motor file, not measured"

SCOPE = (
    "The results relate only to the machine named here, in the state in which it was tested, and "
    "hold within these conditions; beyond them the network is an extrapolation. No statement of "
    "conformity is made. This certificate may be passed on only as a whole."
)


def certificate_content(result: FitResult, certificate: Certificate) -> dict[str, Any]:
    """Return what page 1 says.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states; what it does not is an empty text.
    """
    model = result.models[favoured(result)]
    found = headline(result)
    return {
        "title": TITLE,
        "number": certificate.number,
        "foot": _cut(certificate.number or clean(result.motor.name)),
        "identification": _identification(result, certificate),
        "dates": _dates(result, certificate),
        "instruments": [
            [one.quantity, one.instrument, one.accuracy_class, one.calibration, one.valid_until]
            for one in certificate.instruments
        ],
        "instruments_in_annex": _is_long(certificate),
        "use": found.use,
        "headline": found.sentence,
        "reasons": [clean(reason) for reason in found.reasons],
        "network": model.title,
        "parameters": [_row(line) for line in parameter_lines(model)],
        "rule": RULE,
        "statement": _statement(result),
        "remarks": certificate.remarks,
        "signatures": [
            ["Operator", certificate.operator],
            ["Approved by", certificate.approved_by],
        ],
    }


def _identification(result: FitResult, certificate: Certificate) -> list[list[str]]:
    """Return label and value of each line; those that are seldom needed only where given."""
    days = test_days(result, certificate)
    rows = [
        ["Certificate number", certificate.number],
        ["Date of issue", certificate.issue_date],
        ["Laboratory", _with_address(certificate.laboratory, certificate.laboratory_address)],
        ["Customer", _with_address(certificate.customer, certificate.customer_address)],
        ["Machine", _joined([clean(result.motor.name), certificate.machine_type])],
        ["Manufacturer", certificate.manufacturer],
        ["Serial number", certificate.serial_number],
        ["Date of test", str(days)],
        ["Test bench", certificate.bench],
    ]
    seldom = [
        ["Place of the test", _place(certificate)],
        ["Machine received", certificate.received],
        ["Condition", certificate.condition],
    ]
    return rows + [row for row in seldom if row[1]]


def _is_long(certificate: Certificate) -> bool:
    """Return whether page 1 has no room for the instruments."""
    rows = certificate.instruments
    letters = sum(len(text) for one in rows for text in vars(one).values())
    return len(rows) > MOST_ON_PAGE_1 or letters > MOST_LETTERS


def _place(certificate: Certificate) -> str:
    places = {
        "laboratoryBranch": "branch of the laboratory",
        "customerBranch": "branch of the customer",
        "other": "other",
    }
    return places.get(certificate.performed_at, certificate.performed_at)


def _dates(result: FitResult, certificate: Certificate) -> dict[str, str]:
    days = test_days(result, certificate)
    return {
        "test_from": days.first,
        "test_until": days.last,
        "issue": certificate.issue_date,
        "note": days.note,
    }


def _with_address(name: str, address: str) -> str:
    return _joined([name, address])


def _joined(parts: Iterable[str]) -> str:
    """Return parts with commas between them; one that repeats another stands once."""
    return ", ".join(dict.fromkeys(part for part in parts if part))


def judged(entry: FittedParameter) -> str:
    """Return how well a parameter is known, in words; empty where nothing is said of it."""
    judgement = entry.identifiability or ""
    is_given = entry.unit == "ohm" and judgement == "not identifiable"
    return GIVEN if is_given else JUDGEMENTS.get(judgement, "")


@dataclass(frozen=True)
class ParameterLine:
    """A line of the table of parameters.

    Attributes:
        name: As printed.
        meaning: Likewise.
        entry: The parameter.
        figure: What it is at stated conditions, where the line is about that.
    """

    name: str
    meaning: str
    entry: FittedParameter
    figure: DerivedFigure | None = None


def parameter_lines(model: FittedModel) -> list[ParameterLine]:
    """Return the lines of the table of parameters.

    A resistance that effects change stands first as it is at stated conditions; the parameter of
    its law follows.
    """
    lines = []
    for name, entry in model.parameters.items():
        meaning = entry.meaning
        for ending, words in ((LOADED, "under load"), (AT_REST, "at rest")):
            figure = model.derived.get(f"{name}{ending}")
            if figure is not None and math.isfinite(figure.median):
                told = f"{entry.meaning}: {known(figure.condition)}"
                lines.append(ParameterLine(f"{name} {words}", told, entry, figure))
                meaning = f"{entry.meaning}, in the law of its effect"
        lines.append(ParameterLine(name, meaning, entry))
    return lines


def _row(line: ParameterLine) -> list[str]:
    entry, figure = line.entry, line.figure
    text = printed(entry).text
    if figure is not None:
        sd = number(known(figure.sd))
        text = uncertain(figure.median, sd, figure.ends, entry.unit).text
    return [clean(line.name), clean(line.meaning), text, judged(entry)]


def _statement(result: FitResult) -> list[list[str]]:
    fitted = [test for test in result.tests if test.role == "calibration"]
    return [
        ["Measured", _measured(result, fitted)],
        ["Method", _method(result)],
        ["Conditions", _conditions(result, fitted)],
        ["Scope", SCOPE],
    ]


def _measured(result: FitResult, fitted: list[DescribedTest]) -> str:
    what = {
        "winding_degC": "winding temperature",
        "losses_W": "total losses"
        if result.motor.losses == "balance"
        else "losses other than copper",
    }
    if any(test.current_A for test in fitted):
        what["phase_current_A"] = "phase current"
    if any(test.speed_rpm for test in fitted):
        what["speed_rpm"] = "speed"
    what[f"{result.motor.sink}_degC"] = f"{result.motor.sink} temperature"
    stated = {channel: num for channel in what if (num := num_stated(fitted, channel))}
    measured = [word for channel, word in what.items() if stated.get(channel, 0) < len(fitted)]
    minutes = sum(test.duration_s for test in fitted) / 60.0
    samples = sum(test.num_samples for test in fitted)
    number = "1 test" if len(fitted) == 1 else f"{len(fitted)} tests"
    names = ", ".join(clean(test.name)[:60] for test in fitted[:3])
    more = f" and {len(fitted) - 3} more" if len(fitted) > 3 else ""
    held = [test for test in result.tests if test.role == "holdout"]
    unseen = f"; {len(held)} more held out to check the prediction" if held else ""
    return (
        f"{_sentence(_listed(measured))} over time, in {number} ({names}{more}): "
        f"{minutes:.0f} min, {samples} samples{unseen}."
        + "".join(f" {_not_measured(what[c], num, len(fitted))}" for c, num in stated.items())
    )


def _not_measured(word: str, num: int, num_tests: int) -> str:
    part = "" if num == num_tests else f" in {num} of {num_tests} tests"
    return f"{_sentence(word)}{part} as stated in the motor file, not measured."


def _method(result: FitResult) -> str:
    model = result.models[favoured(result)]
    nodes = len(model.nodes) or 1
    kind = "one node" if nodes == 1 else f"{nodes} nodes"
    return (
        f"A lumped thermal network of {kind} is fitted to the records by Bayesian inference "
        f"(heatrun {result.heatrun_version}). U = k u with k = 2 contains the noise of the test "
        "(type A) and the stated uncertainties of the instruments (type B)."
    )


def _conditions(result: FitResult, fitted: list[DescribedTest]) -> str:
    sink = f"{result.motor.sink} temperature"
    rows: list[tuple[str, str, int, Callable[[DescribedTest], Interval | None]]] = [
        ("current", "A", 0, lambda test: test.current_A),
        ("losses", "W", 0, lambda test: test.losses_W),
        ("speed", "rpm", 0, lambda test: test.speed_rpm),
        ("winding", "°C", 1, lambda test: test.winding_degC),
        (sink, "°C", 1, lambda test: test.sink_degC),
    ]
    parts = []
    for word, unit, digits, of in rows:
        spans = [span for test in fitted if (span := of(test)) is not None]
        if spans:
            low, high = min(s[0] for s in spans), max(s[1] for s in spans)
            ends = (f"{low:.{digits}f}", f"{high:.{digits}f}")
            span = ends[0] if ends[0] == ends[1] else " … ".join(ends)
            parts.append(f"{word} {span} {unit}")
    return f"{_sentence('; '.join(parts))}." if parts else "Not recorded."


def _listed(words: list[str]) -> str:
    *others, last = words
    return f"{', '.join(others)} and {last}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_FOOT else f"{text[: LONGEST_FOOT - 1]}…"
