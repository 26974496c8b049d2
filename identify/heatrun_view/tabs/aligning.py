"""Prototypes laid over each other on one clock: each test is moved to where its signals fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape

import panel as pn

from heatrun.bench import Record
from heatrun.errors import InputError
from heatrun_reports.analysis.offset import find_offset

from ..background import in_background
from ..pane import text_pane
from ..store import Opened
from ..words import error_message


class Aligning:
    """The switch and what it found.

    Attributes:
        view: What goes on the page.
        shifts_s: By name of the test, what is added to its times [s]; 0 for one that is not there.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        """Take whom to tell that the shifts are others."""
        self.shifts_s: Mapping[str, float] = {}
        self._records: tuple[Record, ...] = ()
        self._changed = changed
        self._switch = pn.widgets.Toggle(name="Align clocks", width=120)
        self._said = text_pane()
        self._switch.param.watch(lambda _: self._find(), "value")
        self.view = pn.Column(self._switch, self._said, sizing_mode="stretch_width", visible=False)

    def offer(self, tests: Sequence[Opened]) -> None:
        """Take the tests that are shown.

        Args:
            tests: As they were read; the first keeps its clock.
        """
        names = [record.name for record in self._records]
        self._records = tuple(each.record for each in tests)
        self.view.visible = len(self._records) > 1
        if names != [record.name for record in self._records]:
            self.shifts_s, self._said.object = {}, ""
            self._switch.value = False

    def _find(self) -> None:
        if not self._switch.value:
            self.shifts_s, self._said.object = {}, ""
            self._changed()
            return
        records = self._records
        self._said.object = "<p class='faded'>Looking for the offsets …</p>"

        def show(found: tuple[dict[str, float], str]) -> None:
            if records == self._records and self._switch.value:
                self.shifts_s, self._said.object = found
                self._changed()

        in_background(lambda: shifts_of(records), show)


def shifts_of(records: Sequence[Record]) -> tuple[dict[str, float], str]:
    """Return what is added to the times of each test [s], and what is to be said of it as HTML.

    Args:
        records: The first keeps its clock.
    """
    first, *others = records
    shifts: dict[str, float] = {}
    said = []
    for other in others:
        channels = [name for name in first.channels if name in other and name != "time_s"]
        try:
            found = find_offset(first, other, channels)
        except InputError as error:
            said.append(error_message(error))
            continue
        shifts[other.name] = found.offset_s
        said.append(
            f"<p><b>{escape(other.name)}</b> {found.offset_s:+.2f} s ± {found.sd_s:.2f} s on the "
            f"clock of {escape(first.name)} ({escape(found.method)})</p>"
        )
        said += [f"<p class='warning'>{escape(each.sentence())}</p>" for each in found.findings]
    return shifts, "".join(said)
