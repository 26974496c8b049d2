"""A report as plain content: what stands in its JSON, and what `--json` prints."""

from __future__ import annotations

from typing import Any

from .report import Report, Table
from .report_name import DateOfTest


def report_content(report: Report, when: DateOfTest | None) -> dict[str, Any]:
    """Return all that a report says, as numbers and texts.

    Args:
        report: Any report.
        when: Date of the test and how it is known; None where it is not.
    """
    return {
        "format": "heatrun-report/1",
        "type": report.kind,
        "title": report.title,
        "test": report.test,
        "motor": report.motor,
        "date": when.day.isoformat() if when else None,
        "date_from": when.basis if when else None,
        "summary": report.summary,
        "table": [
            {"name": r.name, "label": r.label, "value": r.value, "unit": r.unit, "note": r.note}
            for r in report.rows
        ],
        "tables": [_table(table) for table in report.tables],
        "findings": list(report.findings),
        "definitions": [{"name": name, "text": text} for name, text in report.definitions],
        "channels": list(report.channels),
        "sources": [
            {"path": s.path, "sha256": s.sha256, "reader": s.reader} for s in report.sources
        ],
    }


def _table(table: Table) -> dict[str, Any]:
    return {
        "title": table.title,
        "note": table.note,
        "lines": [
            {
                "name": line.name,
                "note": line.note,
                "cells": [
                    {
                        "quantity": column.label,
                        "value": cell,
                        "unit": line.unit if column.unit is None else column.unit,
                    }
                    for column, cell in zip(table.columns, line.cells, strict=True)
                ],
            }
            for line in table.lines
        ],
    }
