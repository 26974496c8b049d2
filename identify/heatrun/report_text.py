"""Results as plain text for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .bench import Finding

_MARK = {"error": "ERROR  ", "warning": "warning", "note": "note   "}


def findings_text(findings: Sequence[Finding]) -> str:
    """Return findings, the gravest first, a paragraph each."""
    if not findings:
        return "No findings: the records are as a fit wants them."
    order = {"error": 0, "warning": 1, "note": 2}
    ranked = sorted(findings, key=lambda finding: order[finding.severity])
    return "\n".join(
        _printable(
            f"{_MARK[f.severity]}  {f'[{f.test}] ' if f.test else ''}{f.sentence()}  ({f.id})"
        )
        for f in ranked
    )


def result_text(result: Mapping[str, Any]) -> str:
    """Return the heart of a result: parameters with ranges, errors, verdict, findings."""
    lines = [f"Motor: {result['motor']['name']}"]
    for order, model in result["models"].items():
        lines += ["", f"{order.capitalize()} order"]
        for name, entry in model["parameters"].items():
            low, high = entry["interval_95"]
            lines.append(
                f"  {name:<7} {entry['value']:>11.5g} {entry['unit']:<4} "
                f"95 % {low:.4g} … {high:.4g}   {entry['identifiability']}: {entry['why']}"
            )
        for row in model["residuals"]:
            lines.append(
                f"  {row['role']:<11} {row['test']}: RMSE {row['rmse_K']:.2f} K, max "
                f"{row['max_K']:.1f} K, end {row['end_K']:+.2f} K, "
                f"{100 * row['coverage_95']:.0f} % inside the 95 % band"
            )
        lines.append(f"  {model['posterior']['verdict']}")
    lines += ["", result["verdict"]["sentence"]]
    if result["comparison"]:
        lines += [f"  {sentence}" for sentence in result["comparison"]["words"]]
    graver = [f for f in result["findings"] if f["severity"] != "note"]
    if graver:
        lines += ["", "Findings"]
        lines += [
            f"  {_MARK[f['severity']]} {f['where']}: {f['message']} {f['remedy']}".rstrip()
            for f in graver
        ]
    return "\n".join(_printable(line) for line in lines)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)
