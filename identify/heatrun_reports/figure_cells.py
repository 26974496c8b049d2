"""How a figure of two prototypes stands in a table."""

from __future__ import annotations

from .analysis.validation import FigureComparison


def is_judged(figure: FigureComparison) -> bool:
    """Return whether the figure has a verdict on agreement."""
    return figure.verdict in ("agrees", "differs")


def figure_cells(figure: FigureComparison) -> tuple[float | str | None, ...]:
    """Return the test's value, the reference's, their difference [%], tolerance and verdict.

    A tolerance that judged nothing is left out.
    """
    return (
        figure.test,
        figure.reference,
        figure.difference_percent,
        figure.tolerance.value if is_judged(figure) else None,
        figure.verdict,
    )
