"""Cutting by mouse: the windows of a test that count, as text for the motor file, and into it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Protocol

import panel as pn

from heatrun.errors import InputError

from ..motor_file import read_motor_file, refuse_sent, write_motor_file
from ..motor_windows import (
    Window,
    windows_of,
    windows_text,
    with_window,
    without_window,
    write_windows,
)
from ..pane import text_pane
from ..store import Opened
from ..words import error_message, message

STEP_S = 0.1
"""Windows are rounded to it [s]: finer than a mouse can choose."""


class MotorChoice(Protocol):
    """The motor file that is chosen."""

    @property
    def motor_path(self) -> Path | None:
        """The motor file, or None."""
        ...

    @property
    def root(self) -> Path:
        """The folder outside of which nothing is written."""
        ...


class Cutting:
    """A form with the windows of a test.

    Attributes:
        view: What goes on the page; hidden until a window is selected.
    """

    def __init__(self, page: MotorChoice) -> None:
        self._page = page
        self._spans: dict[str, Window] = {}
        self._shifts_s: Mapping[str, float] = {}
        self._selected: Window | None = None
        self._windows: list[Window] = []
        self._in_file: list[Window] = []
        self._test = pn.widgets.Select(name="Test", sizing_mode="stretch_width")
        self._keep = pn.widgets.Button(name="Use it", width=90)
        self._leave = pn.widgets.Button(name="Leave it out", width=110)
        self._clear = pn.widgets.Button(name="Start again", width=100)
        self._write = pn.widgets.Button(
            name="Write into the motor file", button_type="primary", width=200
        )
        self._said = text_pane()
        self._text = text_pane()
        self._result = text_pane()
        self.view = pn.Column(
            text_pane("<h3>Part of the test that counts</h3>"),
            self._test,
            self._said,
            pn.FlexBox(self._keep, self._leave, self._clear),
            self._text,
            self._write,
            self._result,
            sizing_mode="stretch_width",
            visible=False,
        )
        self._test.param.watch(lambda _: self._begin(), "value")
        self._keep.on_click(lambda _: self._change(with_window))
        self._leave.on_click(lambda _: self._change(without_window))
        self._clear.on_click(lambda _: self._start_again())
        self._write.on_click(lambda _: self._write_file())

    def offer(self, tests: Sequence[Opened], shifts_s: Mapping[str, float]) -> None:
        """Take the tests that are shown.

        Args:
            tests: As they were read.
            shifts_s: By name of the test, by how much later than in its own time it is shown [s].
        """
        self._shifts_s = shifts_s
        self._spans = {
            each.record.name: (float(each.record.time_s[0]), float(each.record.time_s[-1]))
            for each in tests
        }
        names = list(self._spans)
        if names != self._test.options:
            chosen = self._test.value
            self._test.options = names
            self._test.value = chosen if chosen in names else (names[0] if names else None)

    def select(self, start_s: float, end_s: float) -> None:
        """Take a window that was selected with the mouse, in the times of the plots.

        Args:
            start_s: Its begin [s]; before its end or behind it.
            end_s: Its end [s].
        """
        first, last = self._spans.get(str(self._test.value), (0.0, 0.0))
        shift_s = self._shifts_s.get(str(self._test.value), 0.0)
        low, high = sorted((start_s - shift_s, end_s - shift_s))
        window = tuple(round(round(min(max(at, first), last) / STEP_S) * STEP_S, 1)
                       for at in (low, high))  # fmt: skip
        if window[1] <= window[0]:
            return
        self._selected = (window[0], window[1])
        if not self.view.visible:
            self._begin()
        self.view.visible = True
        self._result.object = ""
        self._show()

    def _begin(self) -> None:
        """Start from what the motor file says of the test."""
        self._windows, self._in_file = [], []
        try:
            if self._page.motor_path is not None and self._test.value is not None:
                motor = self._page.motor_path
                data = read_motor_file(motor)
                self._in_file = windows_of(data, str(self._test.value), motor.name)
                self._windows = self._in_file
        except InputError as error:
            self._result.object = error_message(error)
        self._show()

    def _start_again(self) -> None:
        self._windows = []
        self._result.object = ""
        self._show()

    def _change(self, how) -> None:
        if self._selected is None:
            return
        whole = [self._spans[str(self._test.value)]] if how is without_window else []
        self._windows = how(self._windows or whole, self._selected)
        self._result.object = ""
        self._show()

    def _show(self) -> None:
        name = str(self._test.value)
        if self._selected is not None:
            start, end = self._selected
            self._said.object = (
                f"<p>Selected: <b>{start:.1f} … {end:.1f} s</b> ({(end - start) / 60:.2f} min)</p>"
            )
        else:
            self._said.object = "<p>Select a window: “Select” in the bar, then drag.</p>"
        lines = windows_text(name, self._windows) if self._windows else ""
        self._text.object = (
            f"<pre>{escape(lines)}</pre>"
            if lines
            else message("note", "No window is chosen: all of the test counts.")
        )
        self._write.disabled = not self._windows

    def _write_file(self) -> None:
        try:
            self._result.object = message("note", self._written())
        except InputError as error:
            self._result.object = error_message(error)

    def _written(self) -> str:
        motor, name = self._page.motor_path, str(self._test.value)
        if motor is None:
            raise InputError("Expected a motor file.", remedy="Choose one on the left.")
        root = self._page.root
        refuse_sent(root, motor)
        before = read_motor_file(motor)
        if windows_of(before, name, motor.name) != self._in_file:
            self._begin()
            raise InputError(
                f"The parts of '{name}' have changed in the motor file; nothing was written.",
                where=motor.name,
                remedy="Above stands what it says now: choose again, and write that.",
            )
        after = write_windows(before, name, self._windows, motor.name)
        write_motor_file(root, motor, before, after)
        self._in_file = windows_of(after, name, motor.name)
        return f"Written into {motor.name}; the rest of the file is as it was."
