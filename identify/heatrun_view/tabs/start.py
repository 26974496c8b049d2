"""The tab that leads from files to a calibration: tests, their columns, a motor file, the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path

import panel as pn

from heatrun.commands.init import UNITS, name_of
from heatrun.errors import InputError
from heatrun.init.draft import NONE, Choice, choices, draft
from heatrun.init.gaps import Gap, gaps
from heatrun.init.survey import Survey

from ..background import in_background
from ..look import text_pane
from ..motor_text import create_motor_file
from ..reading import Reader, problem
from ..words import error_message, message
from .run_view import run_name, typed_number

LONGEST_LABEL = 90
WIDE = "stretch_width"


class Row:
    """A channel: ticked where it is read, with the columns that it may be.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, choice: Choice) -> None:
        self._choice = choice
        options = {f"{side} · {held}"[:LONGEST_LABEL]: side for side, held in choice.sides.items()}
        name = [choice.channel]
        self._read = pn.widgets.CheckBoxGroup(
            options=name, value=name if choice.is_proposed else [], width=190, align="center"
        )
        self._side = pn.widgets.Select(options=options, sizing_mode=WIDE, max_width=620)
        self._side.param.watch(lambda _: self._read.param.update(value=name), "value")
        self.view = pn.FlexBox(self._read, self._side)

    @property
    def said(self) -> dict[str, str]:
        """What differs from the proposal: right-hand side by channel."""
        proposed = next(iter(self._choice.sides)) if self._choice.is_proposed else NONE
        side = str(self._side.value) if self._read.value else NONE
        return {} if side == proposed else {self._choice.channel: side}


class Start:
    """Four steps, each open once the one before is done.

    Attributes:
        view: What goes on the page.
    """

    def __init__(
        self, reader: Reader, root: Path, written: Callable[[str], None], fit: Callable[[], None]
    ) -> None:
        """Take the folder of motor files, whom to tell of a new one, and what calibrates."""
        self._reader, self._root, self._written = reader, root, written
        self._offered: tuple[Sequence[str], str | None] | None = None
        self._surveys: Sequence[Survey] = ()
        self._rows: list[Row] = []
        self._numbers: dict[str, pn.widgets.TextInput] = {}
        self._tests, self._said = text_pane(), text_pane()
        self._columns = pn.Column(sizing_mode=WIDE)
        self._name = pn.widgets.TextInput(name="File name", value="motor.toml")
        write = pn.widgets.Button(name="Write motor file", button_type="primary", width=180)
        write.on_click(lambda _: self._write())
        self._form = pn.Column(
            text_pane("<h3>2 Columns: untick or change what is wrong</h3>"), self._columns,
            text_pane("<h3>3 Motor file</h3>"), self._name, write, sizing_mode=WIDE, visible=False,
        )  # fmt: skip
        calibrate = pn.widgets.Button(name="Calibrate these tests", button_type="primary")
        calibrate.on_click(lambda _: fit())
        self._fit = pn.Column(text_pane("<h3>4 Calibration</h3>"), calibrate, visible=False)
        self.view = pn.Column(self._tests, self._form, self._said, self._fit, sizing_mode=WIDE)

    def offer(self, tests: Sequence[str], motor: str | None) -> None:
        """Take other tests, or a motor file that describes them already.

        Args:
            tests: As the page lists them.
            motor: As the page lists it, or None.
        """
        if self._offered == (tests, motor):
            return
        self._offered = (tests, motor)
        self._form.visible = self._fit.visible = False
        names = ", ".join(map(escape, tests))
        self._tests.object = "<h3>1 Tests</h3>" + (
            f"<p>{names}</p>" if tests else message("note", "Tick the tests of one motor.")
        )
        self._said.object = ""
        if tests and motor is not None:
            self._said.object = "<h3>2 Columns and 3 motor file</h3>" + message(
                "note", f"{motor} describes both. The tab “Checks” says what is to be mended, the "
                "tab “Motor file” shows the lines."
            )  # fmt: skip
            self._fit.visible = True
        elif tests:
            self._look_at(tests)

    def _look_at(self, tests: Sequence[str]) -> None:
        self._said.object = "<p class='faded'>Looking at the columns …</p>"
        offered = self._offered

        def work() -> Sequence[Survey] | str:
            try:
                return self._reader.survey(tests)
            except Exception as error:
                return problem(", ".join(tests), error)

        def show(found: Sequence[Survey] | str) -> None:
            if self._offered is not offered:
                return
            self._said.object = found if isinstance(found, str) else ""
            if not isinstance(found, str):
                self._ask(found)

        in_background(work, show)

    def _ask(self, surveys: Sequence[Survey]) -> None:
        """Show what is proposed, and ask for what is missing."""
        self._surveys = surveys
        self._rows = [Row(each) for each in choices(surveys)]
        missing = [gap for gap in gaps(surveys) if not gap.is_answered]
        self._numbers = {
            _name(gap): pn.widgets.TextInput(
                name=f"{_name(gap)} [{UNITS[_name(gap)]}]", placeholder=f"such as {gap.number}"
            )
            for gap in missing
            if gap.number
        }
        parts: list[pn.viewable.Viewable] = [row.view for row in self._rows]
        for gap in missing:
            said = gap.sentence.replace("--model first", "the first-order network")
            parts.append(text_pane(message("warning", f"{_name(gap)}: {said}")))
            parts += [self._numbers[_name(gap)]] if gap.number else []
        self._columns[:] = parts
        self._form.visible = True

    def _write(self) -> None:
        try:
            stem = run_name(str(self._name.value).removesuffix(".toml"), "motor")
            typed = {name: str(asked.value).strip() for name, asked in self._numbers.items()}
            numbers = {
                name: typed_number(text, name, "0.0062") for name, text in typed.items() if text
            }
            columns = {channel: side for row in self._rows for channel, side in row.said.items()}
            text = draft(name_of(self._surveys), self._surveys, is_accepted=True, numbers=numbers,
                         columns=columns)  # fmt: skip
            create_motor_file(self._root, f"{stem}.toml", text.encode())
        except InputError as error:
            self._said.object = error_message(error)
            return
        self._written(f"{stem}.toml")


def _name(gap: Gap) -> str:
    return gap.channel or gap.key
