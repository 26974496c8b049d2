"""Measured and modelled winding of a test, with the residual below."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import panel as pn

from ..background import Soon, in_order
from ..frame import Screen
from ..plotting.band import Band
from ..plotting.linked import Plots, Told
from ..plotting.readout import LOOK_AT
from ..plotting.styles import MEASURED, MODEL, RESIDUAL
from ..plotting.trace import Trace

HEIGHT_PX = 420


class FitFigure:
    """A choice of a test, and its figure.

    Attributes:
        view: What goes on the page.
        test: Name of the test that is chosen, or None.
    """

    def __init__(self, choose: Callable[[], None]) -> None:
        """Take whom to tell that another test is chosen."""
        self._screen = Screen()
        self._plots: Plots | None = None
        self._soon = Soon()
        self._tests = pn.widgets.Select(name="Test", width=280)
        self._tests.param.watch(lambda _: choose(), "value")
        self._place = pn.Column(sizing_mode="stretch_width")
        self.view = pn.Column(self._tests, self._place, sizing_mode="stretch_width", visible=False)

    @property
    def test(self) -> str | None:
        """Name of the test that is chosen, or None."""
        return self._tests.value  # pyright: ignore[reportReturnType]

    def offer(self, tests: Sequence[str]) -> None:
        """Offer tests; the one that is chosen and still there stays chosen."""
        kept = self.test
        self.view.visible = bool(tests)
        self._tests.visible = len(tests) > 1
        self._tests.options = [*tests]
        self._tests.value = kept if kept in tests else next(iter(tests), None)

    def look_like(self, screen: Screen) -> None:
        """Show the figure in the browser's colours."""
        self._screen = screen
        if self._plots is not None:
            with in_order():
                self._plots.paint(screen.look)

    def show(self, band: Band | None) -> None:
        """Draw a course with its measurement and its residual; None draws nothing."""
        self._plots, self._place[:] = None, []
        traces = [] if band is None else _traces(band)
        if band is None or not traces:
            return
        told = Told(self._soon, lambda *_: None, lambda *_: None, LOOK_AT)
        plots = self._plots = Plots(traces, [band], self._screen.look, HEIGHT_PX, told)
        self._place[:] = [
            pn.pane.Bokeh(each, sizing_mode="stretch_width")
            for each in (plots.layout, plots.readout)
        ]

    def move(self, band: Band) -> None:
        """Show another course of the model over the same measurement."""
        if self._plots is not None:
            with in_order():
                self._plots.grow(_traces(band))


def _traces(band: Band) -> list[Trace]:
    """Return what is drawn, each with a reading."""
    residual = band.measured - band.median
    lines = ((MEASURED, band.measured, "degC"), (MODEL, band.median, "degC"),
             (RESIDUAL, residual, "K"))  # fmt: skip
    found = [Trace.of(band.test, name, band.time_s, value, unit) for name, value, unit in lines]
    return [trace for trace in found if trace.time_s.size]


def error_of(band: Band) -> tuple[float, float] | None:
    """Return RMSE and largest residual by magnitude [K]; None where nothing was measured."""
    residual = (band.measured - band.median)[np.isfinite(band.measured)]
    if not residual.size:
        return None
    return float(np.sqrt(np.mean(residual**2))), float(np.max(np.abs(residual)))
