"""What the sheet says, as text in tables: the same words go to PDF, XLSX and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msgspec import UNSET

from ...bench.channels.column_mapping import KNOWN_BY, assumption, grouped
from ...bench.record import Finding
from ...certificate import Certificate
from ...io.printable import clean
from ...io.quantities import plain, quantity, rounded
from ...io.without_folders import command_without_folders, without_folders
from ...results import FitResult
from ...results.derived import DerivedFigure
from ...results.model import FittedModel, FittedNoise, LoggerNoise
from ...results.parameter import FittedParameter
from ...results.tested import DescribedTest
from ...results.values import Interval, known
from .certificate import certificate_content
from .digits import format_interval, format_value, signed
from .printed import interval_ends, printed
from .stated import num_stated

DEFINITIONS = (
    ("Tw", "temperature that the winding sensor reads, taken as the mean of the winding [°C]"),
    ("Tsr", "temperature of stator and rotor as one lump; simulated, not measured [°C]"),
    ("Pjs", "Joule loss of the winding, phases · Is² · Rs0 · (B + Tw)/(B + Tref), on the "
            "simulated Tw [W]"),
)  # fmt: skip

LIMITS = (
    "Temperatures cannot fix the scale of losses: a common factor on losses, capacitances and "
    "conductances leaves them unchanged. Its uncertainty enters as type B.",
    "Expanded uncertainties hold k = 2, about 95 %; intervals are the central 95 % of the "
    "posterior. Type A is what remains with exact instruments, type B what the stated "
    "uncertainties of the instruments add.",
    "Outside the tested range of currents, speeds and temperatures the network is an "
    "extrapolation.",
)


EXPLAINED = (
    "Log Bayes factor: natural logarithm of how many times more probable the tests are under one "
    "network than under the other; 3 is 20 times, 5 is 150 times. It counts against a network what "
    "it could have described and the tests did not show."
)


def sheet_content(result: FitResult, certificate: Certificate | None = None) -> dict[str, Any]:
    """Return titles, tables and sentences of the sheet as plain text.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states; None for nothing.
    """
    motor = result.motor
    paths = [motor.path, *(test.path for test in result.tests)]
    return {
        "title": clean(motor.name),
        "certificate": certificate_content(result, certificate or Certificate()),
        "verdict": clean(result.verdict.sentence),
        "meta": [
            ["heatrun", result.heatrun_version],
            ["command", clean(command_without_folders(result.command))],
            ["seed", str(result.seed)],
        ],
        "definitions": [[name, text] for name, text in DEFINITIONS]
        + _definitions_of(result)
        + _second_sinks(result),
        "tests": [_test(test) for test in result.tests],
        "columns": [
            {"tests": clean(names), "rows": rows, "assumed": _assumed(rows)}
            for names, rows in grouped(result.tests)
        ],
        "models": [_model(order, model) for order, model in result.models.items()],
        "comparison": [clean(w) for w in (result.comparison.words if result.comparison else ())],
        "findings": [
            [f.severity, clean(without_folders(_sentence(f), paths))] for f in result.findings
        ],
        "limits": list(LIMITS),
        "files": [
            [clean(test.name), known(test.start) or "–", test.sha256 or "in memory"]
            for test in result.tests
        ],
        "explained": EXPLAINED,
    }


def _sentence(finding: Finding) -> str:
    return f"{finding.where}: {finding.message} {finding.remedy}".strip(": ")


def _definitions_of(result: FitResult) -> list[list[str]]:
    """Return symbols whose meaning depends on the motor file."""
    motor = result.motor
    if motor.losses == "balance":
        pol = ["Pol", "other losses, Pd − Pjs, where Pd is measured: electrical in minus "
                      "mechanical out [W]"]  # fmt: skip
    else:
        pol = ["Pol", "other losses, taken from a map or a model; Pjs comes on top [W]"]
    sink = {"ambient": "ambient temperature", "coolant": "coolant temperature"}[motor.sink]
    is_stated = num_stated(result.tests, f"{motor.sink}_degC") == len(result.tests)
    known = f"the {sink} that the motor file states" if is_stated else f"the measured {sink}"
    return [pol, ["T0", f"temperature of the sink: {known} [°C]"]]


def _second_sinks(result: FitResult) -> list[list[str]]:
    """Return a line on the other sink, where a network has two."""
    pairs = [known(model.sinks) for model in result.models.values()]
    names = {pair[1] for pair in pairs if pair is not None}
    return [
        [f"T {name}", f"temperature of the second sink: the measured {name} temperature [°C]; "
                      f"the resistances named after {name} lead to it"]
        for name in sorted(names)
    ]  # fmt: skip


def _test(test: DescribedTest) -> list[str]:
    def span(values: Interval | None, digits: int = 0) -> str:
        if values is None:
            return "not recorded"
        return f"{values[0]:.{digits}f} … {values[1]:.{digits}f}"

    return [
        clean(test.name),
        test.role,
        f"{test.duration_s / 60:.1f} min, {test.num_samples} samples",
        span(test.current_A),
        span(test.speed_rpm),
        span(test.winding_degC, 1),
        span(test.sink_degC, 1),
        (test.sha256 or "in memory")[:16],
    ]


def _assumed(rows: Sequence[Sequence[str]]) -> str:
    """Sentence on the units that nothing said, empty if there are none."""
    channels = [row[0] for row in rows if row[3] == KNOWN_BY["assumed"]]
    return assumption(channels) if channels else ""


def _model(order: str, model: FittedModel) -> dict[str, Any]:
    noise = model.noise
    return {
        "order": f"{model.title.capitalize()}{_with(model)}",
        "message": " ".join(
            part
            for part in (
                model.message,
                model.posterior.verdict,
                model.about_missing(),
                "" if model.replica is UNSET else model.replica.words(),
            )
            if part
        ),
        "parameters": [_parameter(n, p) for n, p in model.parameters.items()],
        "nuisances": [_parameter(clean(n), p)[:5] for n, p in model.nuisances.items()],
        "priors": [
            [clean(name), _prior(entry), entry.prior_basis]
            for name, entry in {**model.parameters, **model.nuisances}.items()
        ],
        "correlation": _correlation(model),
        "residuals": [
            [
                clean(row.test),
                row.role,
                f"{row.rmse_K:.2f}",
                f"{row.mae_K:.2f}",
                f"{row.max_K:.2f}",
                signed(row.end_K, 2),
                f"{100 * row.coverage_95:.0f} %",
            ]
            for row in model.residuals
        ],
        "bodies": [
            [
                clean(f"{row.body} in {row.test}"),
                row.role,
                f"{'fitted as' if row.fitted else 'against'} {row.node}",
                f"{row.rmse_K:.2f}",
                signed(row.mean_K, 2),
                f"{row.max_K:.2f}",
                f"{100 * row.coverage_95:.0f} %",
            ]
            for row in known(model.bodies) or ()
        ],
        "noise": f"Noise: slow part {noise.sd_K:.3f} K over "
        f"{noise.time_s:.0f} s, white part {noise.white_K:.3f} K in a 20 s mean. Heat that the "
        f"network misses: {100.0 * (known(noise.unmodelled_heat) or 0.0):.2g} % of the mean loss "
        f"(sd).{_loggers(noise)}",
        "derived": [_derived(n, d) for n, d in model.derived.items()],
    }


def _loggers(noise: FittedNoise) -> str:
    """Sentence on the loggers, empty where there is but one."""
    first, *others = known(noise.loggers) or (None,)
    if first is None:
        return ""
    parts = [f"{_sensor(row)} {row.scale:.2g} times as much" for row in others]
    return f" This is the noise of {_sensor(first)}; {', '.join(parts)}."


def _sensor(row: LoggerNoise) -> str:
    """Return a sensor with its tests as printed."""
    tests = ", ".join(row.tests)
    return clean(f"{row.sensor} in {tests}" if row.sensor else tests)


def _parameter(name: str, entry: FittedParameter) -> list[str]:
    sd = entry.sd
    value, expanded = format_value(entry.value, 2 * sd)
    shown = printed(entry)
    parts = f"{_short(entry.sd_type_a)} / {_short(entry.sd_type_b)}"
    return [
        name,
        entry.meaning,
        quantity(value, entry.unit),
        {"given": "fixed", "expanded": f"± {expanded}", "interval": "skewed"}[shown.form],
        "–" if entry.fixed else " … ".join(interval_ends(entry.interval_95, sd)),
        parts,
        entry.identifiability or "",
        entry.why or "",
    ]


def _prior(entry: FittedParameter) -> str:
    """Return the 95 % interval of the prior; its digits are those of a rough guess."""
    if entry.fixed:
        return "fixed"
    low, high = (rounded(end, 3) for end in entry.prior_95)
    return quantity(f"{low} … {high}", entry.unit)


def _short(value: float | None) -> str:
    return "–" if not value else plain(value, 2)


def _correlation(model: FittedModel) -> dict[str, Any]:
    names = model.correlation.names
    keep = [i for i, name in enumerate(names) if name in model.parameters]
    matrix = model.correlation.matrix
    return {
        "names": [names[i] for i in keep],
        "rows": [[_signed(matrix[i][j]) for j in keep] for i in keep],
    }


def _signed(value: float | None) -> str:
    return "–" if value is None else signed(value, 2)


def _derived(name: str, entry: DerivedFigure) -> list[str]:
    if entry.refused is not UNSET:
        return [name, "refused", entry.refused, ""]
    sd = known(entry.sd)
    value, _ = format_value(known(entry.value), sd)
    return [
        name,
        quantity(value, entry.unit or ""),
        entry.condition or "",
        format_interval(known(entry.interval_95), sd),
    ]


def _with(model: FittedModel) -> str:
    effects = [effect.id for effect in model.effects]
    return f" with {', '.join(effects)}" if effects else ""
