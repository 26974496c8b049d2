"""Two times that are marked in all plots."""

from __future__ import annotations

from typing import Any

from bokeh.models import CrosshairTool, Label, Span

from ..look import Look

NAMES = ("A", "B")


class Cursors:
    """Two cursors and the line that goes with the mouse.

    Attributes:
        times_s: Where A and B stand [s], None for one that is not set.
    """

    def __init__(self) -> None:
        self.times_s: list[float | None] = [None, None]
        self._mouse = Span(dimension="height", line_alpha=0.4, line_dash="dashed")
        self._marks: tuple[list[Span], list[Span]] = ([], [])
        self._labels: tuple[list[Label], list[Label]] = ([], [])

    def mark(self, plot: Any) -> None:
        """Let a plot show the cursors."""
        plot.add_tools(CrosshairTool(overlay=self._mouse))
        for name, marks, labels in zip(NAMES, self._marks, self._labels, strict=True):
            marks.append(Span(dimension="height", line_width=1.5, visible=False))
            labels.append(
                Label(
                    x=0, y=2, y_units="screen", text=name, x_offset=3, visible=False,
                    text_font_size="12px", text_font_style="bold",
                )
            )  # fmt: skip
            plot.add_layout(marks[-1])
            plot.add_layout(labels[-1])

    def set(self, number: int, time_s: float | None) -> None:
        """Put a cursor somewhere, or take it away.

        Args:
            number: 0 for A, 1 for B.
            time_s: Where [s]; None for nowhere.
        """
        self.times_s[number] = time_s
        for mark, label in zip(self._marks[number], self._labels[number], strict=True):
            if time_s is not None:
                mark.location, label.x = time_s, time_s
            mark.visible = label.visible = time_s is not None

    def paint(self, look: Look) -> None:
        """Show them in other colours."""
        self._mouse.line_color = look.ink
        for marks, labels, colour in zip(self._marks, self._labels, look.cursors, strict=True):
            for mark, label in zip(marks, labels, strict=True):
                mark.line_color = label.text_color = colour
