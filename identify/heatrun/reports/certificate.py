"""Page 1 of the sheet, what a customer reads: as plain text in rows."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ..io.quantities import clean, quantity, rounded
from ..io.texts import Texts
from ..record.motor import EQUILIBRIA, Certificate
from ..results import FitResult
from ..results.model import (
    AT_REST,
    LOADED,
    DerivedFigure,
    DescribedTest,
    FittedModel,
    FittedParameter,
)
from ..results.values import BudgetRow, Interval, known, number
from ..runs.verdict import favoured, headline
from .printed import COVERAGE_FACTOR, fixed, format_value, num_stated, printed, test_days, uncertain

MOST_ON_PAGE_1, MOST_LETTERS = 6, 450
"""Instruments, and letters of all together, that page 1 has room for."""

LONGEST_FOOT = 40
"""Letters of the number of the certificate at the foot of a page."""

ON_PAGE_1 = ("tau_s", "tau_fast_s", "tau_slow_s", "steady_rise_K", "rise_margin_K")
"""Figures that follow from the parameters and stand beside them."""

RATED_BY = ("continuous_current_by_rise_A", "continuous_current_A")
"""The first of these that a run has stands there too, where it is not refused."""

ENGLISH = Texts()


def certificate_content(
    result: FitResult, certificate: Certificate, say: Texts = ENGLISH
) -> dict[str, Any]:
    """Return what page 1 says.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states; what it does not is an empty text.
        say: The texts in the language of the sheet.
    """
    model = result.models[favoured(result)]
    found = headline(result)
    return {
        "title": say("title"),
        "number": certificate.number,
        "foot": _cut(certificate.number or clean(result.motor.name)),
        "identification": _identification(result, certificate, say),
        "dates": _dates(result, certificate, say),
        "instruments": [
            [one.quantity, one.instrument, one.accuracy_class, one.calibration, one.valid_until]
            for one in certificate.instruments
        ],
        "instruments_in_annex": _is_long(certificate),
        "use": found.use,
        "headline": say.again(found.sentence),
        "reasons": [clean(say.again(reason)) for reason in found.reasons],
        "network": say.again(model.title),
        "parameter_of": say("parameter_of", network=model.title),
        "parameters": [_row(line, say) for line in stated_lines(model, say)],
        "figures": [_row(line, say) for line in figure_lines(model, say, result.tests)],
        "rule": say("rule"),
        "statement": _statement(result, say),
        "remarks": certificate.remarks,
        "signatures": [
            [say("operator"), certificate.operator],
            [say("approved_by"), certificate.approved_by],
        ],
    }


def _identification(result: FitResult, certificate: Certificate, say: Texts) -> list[list[str]]:
    """Return label and value of each line; those that are seldom needed only where given."""
    days = test_days(result, certificate)
    rows = [
        [say("number"), certificate.number],
        [say("issue_date"), certificate.issue_date],
        [say("laboratory"), joined([certificate.laboratory, certificate.laboratory_address])],
        [say("customer"), joined([certificate.customer, certificate.customer_address])],
        [say("machine"), joined([clean(result.motor.name), certificate.machine_type])],
        [say("manufacturer"), certificate.manufacturer],
        [say("serial_number"), certificate.serial_number],
        [say("test_date"), str(days) if days.first == days.last else say.again(str(days))],
        [say("bench"), certificate.bench],
    ]
    place = certificate.performed_at
    seldom = [
        [say("place"), say(f"at_{place}") if place else ""],
        [say("received"), certificate.received],
        [say("condition"), certificate.condition],
    ]
    return rows + [row for row in seldom if row[1]]


def _is_long(certificate: Certificate) -> bool:
    """Return whether page 1 has no room for the instruments."""
    rows = certificate.instruments
    letters = sum(len(text) for one in rows for text in vars(one).values())
    return len(rows) > MOST_ON_PAGE_1 or letters > MOST_LETTERS


def _dates(result: FitResult, certificate: Certificate, say: Texts) -> dict[str, str]:
    days = test_days(result, certificate)
    return {
        "test_from": days.first,
        "test_until": days.last,
        "issue": certificate.issue_date,
        "note": say.again(days.note) if " to " in days.note else days.note,
    }


def joined(parts: Iterable[str]) -> str:
    """Return parts with commas between them; one that repeats another stands once."""
    return ", ".join(dict.fromkeys(part for part in parts if part))


def judged(entry: FittedParameter | DerivedFigure, say: Texts = ENGLISH) -> str:
    """Return how well a parameter is known, in words; empty where nothing is said of it."""
    judgement = known(entry.identifiability) or ""
    is_given = entry.unit == "ohm" and judgement == "not identifiable"
    if not judgement:
        return ""
    return say("of_motor_file" if is_given else judgement.replace(" ", "_"))


@dataclass(frozen=True)
class ParameterLine:
    """A line of the table of parameters, or of what follows from them."""

    name: str  # As printed.
    meaning: str  # Likewise.
    entry: FittedParameter | None  # The parameter; None for a figure that follows.
    # What it is at stated conditions, where the line is about that.
    figure: DerivedFigure | None = None
    # It is the parameter of a law that stands at stated conditions in other lines.
    is_law: bool = False

    @property
    def budget(self) -> tuple[BudgetRow, ...]:
        """Where its uncertainty comes from; empty where that is not known."""
        return known(self._stated.budget) or ()

    @property
    def sd(self) -> float:
        """Its standard uncertainty [its unit]; NaN where it has none."""
        return number(known(self._stated.sd))

    @property
    def unit(self) -> str:
        """Its unit."""
        return known((self.entry or self._stated).unit) or ""

    @property
    def _stated(self) -> FittedParameter | DerivedFigure:
        found = self.figure or self.entry
        assert found is not None
        return found


def parameter_lines(model: FittedModel, say: Texts = ENGLISH) -> list[ParameterLine]:
    """Return the lines of the table of parameters.

    A resistance that effects change stands first as it is at stated conditions; the parameter of
    its law follows.
    """
    lines = []
    for name, entry in model.parameters.items():
        meaning, is_law = say.again(entry.meaning), False
        for ending, key in ((LOADED, "under_load"), (AT_REST, "at_rest")):
            figure = model.derived.get(f"{name}{ending}")
            if figure is not None and math.isfinite(figure.median):
                told = say("at", what=say.again(entry.meaning), condition=known(figure.condition))
                lines.append(ParameterLine(say(key, name=name), told, entry, figure))
                meaning, is_law = say("in_law", meaning=entry.meaning), True
        lines.append(ParameterLine(name, meaning, entry, is_law=is_law))
    return lines


def stated_lines(model: FittedModel, say: Texts = ENGLISH) -> list[ParameterLine]:
    """Return the lines that a page has room for: a resistance stands at stated conditions or in its
    law; the workbook and the DCC hold both.
    """
    return [line for line in parameter_lines(model, say) if not line.is_law]


def _row(line: ParameterLine, say: Texts) -> list[str]:
    entry, figure = line.entry, line.figure
    if figure is not None and not math.isfinite(figure.median):
        return [clean(line.name), clean(line.meaning), say("not_stated"), ""]
    text = _of_figure(figure) if figure is not None else printed(entry).text if entry else ""
    graded = figure if figure is not None and known(figure.identifiability) else entry
    known_by = say("calculated") if entry is None or graded is None else judged(graded, say)
    return [clean(line.name), clean(line.meaning), say.number(text), known_by]


def at_end(test: DescribedTest, say: Texts = ENGLISH) -> str:
    """Return whether the winding had settled when a test ended; empty where no load was held."""
    found = known(test.equilibrium)
    if found is None:
        return ""
    U = COVERAGE_FACTOR * found.gradient_se_K_per_h
    key = {True: "settled", False: "not_settled", None: "maybe_settled"}[found.is_reached]
    by = known(found.criterion) or next(iter(EQUILIBRIA))
    return say(
        key,
        test=clean(test.name)[:60],
        n=say.number(" ± ".join(format_value(found.gradient_K_per_h, U))),
        most=f"{EQUILIBRIA[by].K_per_h:g}",
        by=by,
    )


def page_figures(model: FittedModel) -> dict[str, DerivedFigure]:
    """Return the figures by name that stand beside the parameters."""
    found = {name: model.derived[name] for name in ON_PAGE_1 if name in model.derived}
    rated = next((name for name in RATED_BY if name in model.derived), "")
    if rated and not known(model.derived[rated].refused):
        found[rated] = model.derived[rated]
    return found


def figure_lines(
    model: FittedModel, say: Texts = ENGLISH, tests: Sequence[DescribedTest] = ()
) -> list[ParameterLine]:
    """Return the lines of the time constants, the steady rise and the continuous current.

    Beside the steady rise stands how near to it the fitted test came that came nearest.
    """
    lines = []
    held = {test.name: at for test in tests if (at := known(test.equilibrium)) is not None}
    nearest = min(
        (test for test in tests if test.name in held and test.role == "calibration"),
        key=lambda test: abs(held[test.name].gradient_K_per_h),
        default=None,
    )
    for name, figure in page_figures(model).items():
        symbol = name.rpartition("_")[0].removesuffix("_by_rise")
        what, why = say(symbol), known(figure.refused) or known(figure.condition) or ""
        why = why.removeprefix("eigenvalue of the network, ")  # as every time constant is
        told = say("at", what=what, condition=why)
        if name == "steady_rise_K" and nearest is not None and math.isfinite(figure.median):
            told = f"{told}; {at_end(nearest, say)}"
        lines.append(ParameterLine(symbol, told, None, figure))
    return lines


def _of_figure(figure: DerivedFigure) -> str:
    """Return a figure that follows from the parameters as it is printed."""
    sd, unit = number(known(figure.sd)), known(figure.unit) or ""
    if math.isfinite(sd) and sd > 0:
        return uncertain(figure.median, sd, figure.ends, unit).text
    # too many draws have no such figure for a standard deviation: the lower end is all there is
    return quantity(f"> {rounded(figure.ends[0])}", unit)


def _statement(result: FitResult, say: Texts) -> list[list[str]]:
    fitted = [test for test in result.tests if test.role == "calibration"]
    return [
        [say("measured_label"), _measured(result, fitted, say)],
        [say("method_label"), _method(result, say)],
        [say("conditions_label"), _conditions(result, fitted, say)],
        [say("scope_label"), say("scope")],
    ]


def _measured(result: FitResult, fitted: list[DescribedTest], say: Texts) -> str:
    is_balance = result.motor.losses == "balance"
    what = {
        "winding_degC": say("winding_temperature"),
        "losses_W": say("total_losses" if is_balance else "other_than_copper"),
    }
    if any(test.current_A for test in fitted):
        what["phase_current_A"] = say("phase_current")
    if any(test.speed_rpm for test in fitted):
        what["speed_rpm"] = say("speed")
    what[f"{result.motor.sink}_degC"] = say(f"{result.motor.sink}_temperature")
    stated = {channel: num for channel in what if (num := num_stated(fitted, channel))}
    measured = [word for channel, word in what.items() if stated.get(channel, 0) < len(fitted)]
    names = ", ".join(clean(test.name)[:60] for test in fitted[:3])
    if len(fitted) > 3:
        names = say("and_more", names=names, num=len(fitted) - 3)
    *others, last = measured
    sentences = [
        say(
            "over_time",
            what=_sentence(f" {say('and')} ".join(filter(None, [", ".join(others), last]))),
            tests=say("one_test" if len(fitted) == 1 else "num_tests", names=names,
                      num=len(fitted)),
            minutes=f"{sum(test.duration_s for test in fitted) / 60.0:.0f}",
            samples=sum(test.num_samples for test in fitted),
        )
    ]  # fmt: skip
    if held := len([test for test in result.tests if test.role == "holdout"]):
        sentences.append(say("held_out_one" if held == 1 else "held_out", num=held))
    for channel, num in stated.items():
        key = "as_stated" if num == len(fitted) else "as_stated_in"
        sentences.append(say(key, what=_sentence(what[channel]), num=num, all=len(fitted)))
    return " ".join(sentences)


def _method(result: FitResult, say: Texts) -> str:
    nodes = len(result.models[favoured(result)].nodes) or 1
    kind = say("one_node") if nodes == 1 else say("num_nodes", num=nodes)
    return say("method", nodes=kind, version=result.heatrun_version)


def _conditions(result: FitResult, fitted: list[DescribedTest], say: Texts) -> str:
    rows: list[tuple[str, str, int, Callable[[DescribedTest], Interval | None]]] = [
        ("current", "A", 0, lambda test: test.current_A),
        ("losses", "W", 0, lambda test: test.losses_W),
        ("speed", say("unit_rpm"), 0, lambda test: test.speed_rpm),
        ("winding", "°C", 1, lambda test: test.winding_degC),
        (f"{result.motor.sink}_temperature", "°C", 1, lambda test: test.sink_degC),
    ]
    parts = []
    for key, unit, digits, of in rows:
        spans = [span for test in fitted if (span := of(test)) is not None]
        if spans:
            low, high = min(s[0] for s in spans), max(s[1] for s in spans)
            digits = places_of_current((low, high)) if key == "current" else digits
            ends = (fixed(low, digits), fixed(high, digits))
            span = ends[0] if ends[0] == ends[1] else " … ".join(ends)
            parts.append(f"{say(key)} {say.number(span)} {unit}")
    tested = f"{_sentence('; '.join(parts) or say('not_recorded'))}."
    scales = (
        (result.motor.rated_speed_rpm, 0, say("unit_rpm")),
        (
            result.motor.rated_current_A,
            places_of_current((0.0, result.motor.rated_current_A or 0)),
            "A",
        ),
    )
    at = [f"{say.number(f'{each:.{digits}f}')} {unit}" for each, digits, unit in scales if each]
    if not at or not result.models[favoured(result)].effects:
        return tested
    joined = f" {say('and')} ".join(at)
    return f"{tested} {say('effects_rated', at=joined)}"


def places_of_current(span: Interval | None) -> int:
    """Return the decimal places that a range of currents [A] needs."""
    return int(span is not None and span[1] < 100.0)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_FOOT else f"{text[: LONGEST_FOOT - 1]}…"
