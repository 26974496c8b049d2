"""The type sheet as PDF."""

from __future__ import annotations

import tempfile
from importlib import resources
from pathlib import Path

from heatrun.reports.figures import save
from heatrun.reports.pdf import typeset

from ..results.population import PopulationResult
from .sheet_content import type_sheet_content
from .sheet_figure import shown_machines, type_figures

TEMPLATE = resources.files("heatrun_fleet.population") / "type.typ"


def write_type_sheet(result: PopulationResult, path: Path) -> Path:
    """Draw the figures of a type and set its sheet as PDF.

    Args:
        result: The population.
        path: Where it goes; written whole or not at all.
    """
    content = type_sheet_content(result)
    num = len(shown_machines(result.machines))
    thinned = "" if num == len(result.machines) else (
        f" {num} of {len(result.machines)} machines are drawn, with all that do not fit."
    )  # fmt: skip
    content["caption"] = (
        "Each machine by its own tests, and given all machines of the type. Long intervals of "
        f"short tests are truncated at the frame.{thinned}"
    )
    with tempfile.TemporaryDirectory() as name:
        figures = [
            save(figure, Path(name) / f"{number:03d}.png")
            for number, figure in enumerate(type_figures(result))
        ]
        return typeset(TEMPLATE, content, figures, path)
