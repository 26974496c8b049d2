"""The tab on which the parameters of the network are moved by hand over a measured test."""

from collections.abc import Sequence
from html import escape

import numpy as np
import panel as pn

from heatrun.io.quantities import quantity, rounded
from heatrun.simulation import ByHand

from ..background import Latest, Soon
from ..linked import Band
from ..look import WIDE, button, on_change, stacked, text_pane
from ..reading import Reader
from ..runs import Run
from ..store import Opened
from ..words import message
from .fitting import FitFigure, error_of

REACH, NUM_STEPS = 5.0, 201
"""A slider goes from a fifth of its start to five times that, in equal ratios of 0.8 %."""


class Sliders:
    """A slider for each parameter of the network, and the curve that they move."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._tests: dict[str, Opened] = {}
        self._motor: str | None = None
        self._run: Run | None = None
        self._hand: ByHand | None = None
        self._latest, self._soon = Latest(), Soon()
        self.figure = FitFigure(self._load)
        self._about, self._error = text_pane(), text_pane()
        self._back = button("Back to the start", self._to_start, 150, visible=False)
        self._sliders: dict[str, pn.widgets.DiscreteSlider] = {}
        self._place = pn.FlexBox()
        self.view = stacked(self._about, self._place, self._error, self.figure.view, self._back)

    def offer(self, tests: Sequence[Opened], motor: str | None, run: Run | None) -> None:
        """Take other tests, another machine or another start; what was moved stays where none is.

        Args:
            tests: Those that are shown.
            motor: The motor file as the page lists it, or None.
            run: Where the parameters start; None for their priors.
        """
        given = {each.record.name: each for each in tests}
        is_same = all(given[name] is self._tests.get(name) for name in given)
        if is_same and (given.keys(), motor, run) == (self._tests.keys(), self._motor, self._run):
            return
        self._tests = given
        self._motor, self._run = motor, run
        self._latest.forget()
        before = self.figure.test
        self.figure.offer([*self._tests])
        if self.figure.test == before:
            self._load()

    def _load(self) -> None:
        """Prepare the model beside the page, and show its sliders."""
        test, name, run = self._tests.get(str(self.figure.test)), self._motor, self._run
        self._latest.forget()
        self._hand = None
        self._place[:], self._error.object, self._back.visible = [], "", False
        self.figure.show(None)
        if test is None or name is None:
            what = "tests" if test is None else "a motor file"
            self._about.object = message("note", f"Choose {what} in the side panel.")
            return
        self._about.object = "<p class='faded'>Preparing the model …</p>"

        def work() -> ByHand:
            opened = None if run is None else run.opened
            hand = ByHand.of(test.record, self._reader.motor(name), opened)
            hand.course({})  # compiled here, not at the first move
            return hand

        def show(found: ByHand | str) -> None:
            if isinstance(found, str):
                self._about.object = found
            else:
                self._show(found)

        self._latest.ask(test.record.name, work, show)

    def _show(self, hand: ByHand) -> None:
        self._hand = hand
        kinds = ", ".join(kind.card.id for kind in hand.model.effects)
        where = "the priors of this machine" if self._run is None else f"run {self._run.path.name}"
        self._about.object = (
            f"<p>Starts from {escape(where)}, {escape(hand.model.title)}. All else stays as it is"
            f"{', the effects too: ' + escape(kinds) if kinds else ''}.</p>"
        )
        ratios = REACH ** np.linspace(-1.0, 1.0, 2 * NUM_STEPS - 1)
        self._sliders = {}
        for name, unit in hand.units.items():
            steps = (hand.values[name] * ratios).tolist()
            labels = {quantity(rounded(value, 4), unit): value for value in steps}
            start = list(labels.values())[len(labels) // 2]
            slider = pn.widgets.DiscreteSlider(
                name=name, options=labels, value=start, sizing_mode=WIDE
            )
            on_change(lambda: self._soon(self._move), slider)
            self._sliders[name] = slider
        self._place[:] = [
            pn.Column(slider, styles={"flex": "1 1 150px"}, max_width=240)
            for slider in self._sliders.values()
        ]
        self._back.visible = True
        band = self._band()
        self.figure.show(band)
        self._say(band)

    def _band(self) -> Band:
        """Return the course for the sliders as they stand."""
        hand = self._hand
        assert hand is not None
        course = hand.course({name: float(s.value) for name, s in self._sliders.items()})
        time_s, measured = hand.test.time + hand.test.first_s, hand.test.measured
        return Band("start", time_s, course, course, course, hand.test.name, measured)

    def _move(self) -> None:
        if self._hand is not None:
            band = self._band()
            self.figure.move(band)
            self._say(band)

    def _say(self, band: Band) -> None:
        found = error_of(band)
        self._error.object = (
            message("note", "The winding was not measured.")
            if found is None
            else f"<h3>RMSE {found[0]:.2f} K, largest error {found[1]:.1f} K</h3>"
        )

    def _to_start(self) -> None:
        for slider in self._sliders.values():
            slider.value = slider.values[len(slider.values) // 2]
