"""The tabs that lead to a motor file, and that hold its text.

`Start` leads from files to a calibration: tests, their columns, a motor file, the fit. In
`Editing` the text of the motor file is checked, and saved over the file that was read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import panel as pn

from heatrun.commands.init import UNITS, name_of
from heatrun.errors import InputError
from heatrun.init.draft import NONE, Choice, choices, draft
from heatrun.init.gaps import Gap, gaps
from heatrun.init.survey import Survey
from heatrun.io.toml_text import LARGEST_BYTES
from heatrun.model.catalogue import known_effects
from heatrun.motor.file import parse_motor
from heatrun.record.motor import Motor

from ..background import Latest
from ..look import WIDE, button, on_change, stacked, text_pane
from ..motor_text import (
    create_motor_file,
    fault_html,
    file_of_text,
    has_mixed_ends,
    read_motor_file,
    refuse_sent,
    text_of_file,
    write_motor_file,
)
from ..reading import Reader
from ..runs import run_name, typed_number
from ..store import NOTHING, Stamp
from ..words import error_message, message

if TYPE_CHECKING:
    from .page import Page

ROWS = 24

TEXT_CSS = """
    textarea.bk-input {
      font-family: ui-monospace, "DejaVu Sans Mono", Consolas, monospace; font-size: 13px;
      line-height: 1.4; white-space: pre; overflow: auto; tab-size: 4;
    }
"""


@dataclass(frozen=True)
class Draft:
    """A text on the page, and what the file held when it was read."""

    base: bytes
    text: str


@dataclass(frozen=True)
class Answer:
    """What came of a button, as HTML; what the file holds now, None if it was not written."""

    said: str
    is_refused: bool = False
    saved: bytes | None = None


class Editing:
    """The text of the motor file that is chosen on the left.

    A text that is not saved stays when another file is chosen, and when the file changes.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._name: str | None = None
        self._path: Path | None = None
        self._base: bytes | None = None
        self._stamp = NOTHING
        self._now = ""
        self._drafts: dict[str, Draft] = {}
        self._own: str | None = None
        self._is_sent = False
        self._latest = Latest()
        self._head, self._changed, self._said = text_pane(), text_pane(), text_pane()
        self._text = pn.widgets.TextAreaInput(
            name="Text", rows=ROWS, max_length=LARGEST_BYTES, sizing_mode=WIDE,
            stylesheets=[TEXT_CSS],
        )  # fmt: skip
        self._check = button("Check", self._check_text, 90)
        self._save = button("Save", lambda: self._write(is_forced=False), 90, button_type="primary")
        self._anyway = button(
            "Save all the same", lambda: self._write(is_forced=True), 150, visible=False
        )
        self._reload = button("Read the file again", self._read_again, 150)
        self._back = button("Back to my text", self._to_own, 130, visible=False)
        self._buttons = (self._check, self._save, self._anyway, self._reload, self._back)
        for name in ("value", "value_input"):
            self._text.param.watch(lambda event: self._typed(event.new), name)
        self._form = stacked(self._text, pn.FlexBox(*self._buttons), visible=False)
        self.view = stacked(self._head, self._changed, self._form, self._said)

    def choose(self) -> None:
        """Show the motor file that is chosen on the left."""
        name = self._page.motor_name
        if name is not None and name == self._name and self._base is not None:
            self.look()
            return
        if self._name is not None and self._base is not None and self._is_dirty:
            self._drafts[self._name] = Draft(self._base, self._now)
        self._name, self._path, self._base, self._own = name, None, None, None
        self._is_sent = False
        self._said.object = self._changed.object = ""
        self._anyway.visible = self._back.visible = self._form.visible = False
        if name is None:
            self._head.object = message("note", "Choose a motor file in the side panel.")
            return
        draft = self._drafts.pop(name, None)
        try:
            self._path = self._page.path(name)
            self._take(self._path)
        except InputError as error:
            self._head.object = error_message(error)
            if draft is None:
                return
        self._form.visible = True
        if draft is not None:
            self._show(draft.text)
            self._base = draft.base
            self._stamp = NOTHING  # the next look holds the file against it
            self.look()

    def look(self) -> None:
        """Go with the file where nothing was typed; say that it has changed where something was."""
        if self._path is None or self._base is None or Stamp.of(self._path) == self._stamp:
            return
        self._stamp = Stamp.of(self._path)
        try:
            if not self._is_dirty:
                self._take(self._path)
            is_same = read_motor_file(self._path) == self._base
            self._changed.object = "" if is_same else CHANGED
        except InputError as error:
            self._changed.object = error_message(error)

    @property
    def _is_dirty(self) -> bool:
        """Whether something stands on the page that is not in the file as it was read."""
        return self._base is not None and self._now != text_of_file(self._base, str(self._name))

    def _take(self, path: Path) -> None:
        """Show what the file holds."""
        stamp = Stamp.of(path)
        data = read_motor_file(path)
        text = text_of_file(data, str(self._name))
        self._base, self._stamp = data, stamp
        self._changed.object = ""
        self._show(text)
        self._head.object = self._heading(path, data)

    def _show(self, text: str) -> None:
        self._text.value = text
        self._now = text

    def _heading(self, path: Path, data: bytes) -> str:
        try:
            refuse_sent(self._page.root, path)
        except InputError as error:
            self._is_sent = self._save.disabled = True
            return message("note", f"{error.problem} {error.remedy}")
        self._is_sent = self._save.disabled = False
        if has_mixed_ends(data):
            return message(
                "note", "The file ends its lines in several ways; saving writes the most frequent."
            )
        return ""

    def _typed(self, text: str | None) -> None:
        self._now = text or ""
        self._anyway.visible = False

    def _check_text(self) -> None:
        text, base, name, tests = self._now, self._base, str(self._name), self._page.chosen
        if base is None:
            return

        def work() -> Answer:
            try:
                motor = _parsed(file_of_text(text, base), name)
            except InputError as error:
                return Answer(fault_html(text, error))
            said = message("note", "The text is a motor file. Check does not save it.")
            return Answer(said + (self._page.reader.check(tests, motor) if tests else ""))

        self._start(work)

    def _write(self, *, is_forced: bool) -> None:
        path, base, name, root = self._path, self._base, str(self._name), self._page.root
        text = self._now
        if path is None or base is None:
            return

        def work() -> Answer:
            try:
                after = file_of_text(text, base)
                if not is_forced:
                    _parsed(after, name)
            except InputError as error:
                not_saved = message("warning", "Not saved: the text is no motor file.")
                return Answer(not_saved + fault_html(text, error), is_refused=True)
            if read_motor_file(path) != base:
                return Answer(CHANGED)
            if text == text_of_file(base, name):
                return Answer(message("note", "Nothing was changed, and nothing written."))
            write_motor_file(root, path, base, after)
            return Answer(message("note", f"Written into {name}."), saved=after)

        self._start(work)

    def _start(self, work: Callable[[], Answer]) -> None:
        """Do what a button asks beside the page, and show what came of it."""
        name = self._name
        self._said.object = "<p class='faded'>Checking …</p>"
        self._changed.object = ""
        for each in self._buttons:
            each.disabled = True

        def show(found: Answer | str) -> None:
            for each in self._buttons:
                each.disabled = False
            self._save.disabled = self._is_sent
            if name == self._name:
                self._say(Answer(found) if isinstance(found, str) else found)

        self._latest.ask(str(name), work, show)

    def _say(self, answer: Answer) -> None:
        self._said.object = answer.said
        self._anyway.visible = answer.is_refused and not self._is_sent
        if answer.saved is not None and self._path is not None:
            self._base, self._stamp = answer.saved, Stamp.of(self._path)
            self._page.open_tests()

    def _read_again(self) -> None:
        """Show the file; what was typed is kept for a button."""
        if self._path is None:
            return
        own = self._now if self._is_dirty else self._own
        try:
            self._take(self._path)
        except InputError as error:
            self._said.object = error_message(error)
            return
        self._own, self._back.visible = own, own is not None
        self._anyway.visible = False
        self._said.object = message("note", "This is the file as it is now.")

    def _to_own(self) -> None:
        """Show what was typed before the file was read again; what stands there is kept instead."""
        if self._own is None:
            return
        own, now = self._own, self._now if self._is_dirty else None
        self._show(own)
        self._own, self._back.visible = now, now is not None
        self._said.object = message("note", "This is your text. “Save” puts it over the file.")


CHANGED = message(
    "warning",
    "The file has changed since it was read. Your text is kept, and not written over it. “Read the "
    "file again” shows the file, and “Back to my text” then shows yours.",
)


def _parsed(data: bytes, where: str) -> Motor:
    """Return the machine of a text, with effects that there are."""
    motor = parse_motor(data, where)
    known_effects(motor)
    return motor


LONGEST_LABEL = 90


class Row:
    """A channel: ticked where it is read, with the columns that it may be."""

    def __init__(self, choice: Choice) -> None:
        self._choice = choice
        options = {f"{side} · {held}"[:LONGEST_LABEL]: side for side, held in choice.sides.items()}
        name = [choice.channel]
        self._read = pn.widgets.CheckBoxGroup(
            options=name, value=name if choice.is_proposed else [], width=190, align="center"
        )
        self._side = pn.widgets.Select(options=options, sizing_mode=WIDE, max_width=620)
        on_change(lambda: self._read.param.update(value=name), self._side)
        self.view = pn.FlexBox(self._read, self._side)

    @property
    def said(self) -> dict[str, str]:
        """What differs from the proposal: right-hand side by channel."""
        proposed = next(iter(self._choice.sides)) if self._choice.is_proposed else NONE
        side = str(self._side.value) if self._read.value else NONE
        return {} if side == proposed else {self._choice.channel: side}


TICK = (
    "Tick the tests of one motor in the side panel. Then come their columns, the motor file and "
    "the calibration."
)


class Start:
    """Four steps, each open once the one before is done."""

    def __init__(
        self, reader: Reader, root: Path, written: Callable[[str], None], fit: Callable[[], None]
    ) -> None:
        """Take the folder of motor files, whom to tell of a new one, and what calibrates."""
        self._reader, self._root, self._written = reader, root, written
        self._offered: tuple[Sequence[str], str | None, Stamp] | None = None
        self._surveys: Sequence[Survey] = ()
        self._rows: list[Row] = []
        self._numbers: dict[str, pn.widgets.TextInput] = {}
        self._tests, self._said = text_pane(), text_pane()
        self._columns, self._latest = stacked(), Latest()
        self._name = pn.widgets.TextInput(name="File name", value="motor.toml")
        write = button("Write motor file", self._write, 180, button_type="primary")
        self._form = stacked(
            text_pane("<h3>2 Columns: untick or change what is wrong</h3>"), self._columns,
            text_pane("<h3>3 Motor file</h3>"), self._name, write, visible=False,
        )  # fmt: skip
        calibrate = button("Calibrate these tests", fit, button_type="primary")
        self._fit = pn.Column(text_pane("<h3>4 Calibration</h3>"), calibrate, visible=False)
        self.view = stacked(self._tests, self._form, self._said, self._fit)

    def offer(self, tests: Sequence[str], motor: str | None) -> None:
        """Take other tests, or a motor file that describes them already, as the page lists them."""
        stamp = NOTHING if motor is None else Stamp.of(self._root / motor)
        if self._offered == (tests, motor, stamp):
            return
        self._offered = (tests, motor, stamp)
        self._latest.forget()
        self._form.visible = self._fit.visible = False
        names = ", ".join(map(escape, tests))
        self._tests.object = "<h3>1 Tests</h3>" + (
            f"<p>{names}</p>" if tests else message("note", TICK)
        )
        self._said.object = ""
        if tests and motor is not None:
            self._hold_against(tests, motor)
        elif tests:
            self._look_at(tests)

    def _hold_against(self, tests: Sequence[str], motor: str) -> None:
        """Go on to the calibration, or to another motor file where this one lacks a channel."""

        def show(found: Sequence[str] | str) -> None:
            if found:
                lacking = "" if isinstance(found, str) else f" It leaves out {', '.join(found)}."
                self._tests.object += message(
                    "warning", f"{motor} does not describe these tests.{lacking} Steps 2 and 3 "
                    "write a motor file that does."
                )  # fmt: skip
                self._look_at(tests)
                return
            self._said.object = "<h3>2 Columns and 3 motor file</h3>" + message(
                "note", f"{motor} describes both. The tab “Checks” says what is to be mended, the "
                "tab “Motor file” shows the lines."
            )  # fmt: skip
            self._fit.visible = True

        self._latest.ask(", ".join(tests), lambda: self._reader.lacking(tests, motor), show)

    def _look_at(self, tests: Sequence[str]) -> None:
        self._said.object = "<p class='faded'>Looking at the columns …</p>"

        def show(found: Sequence[Survey] | str) -> None:
            self._said.object = found if isinstance(found, str) else ""
            if not isinstance(found, str):
                self._ask(found)

        self._latest.ask(", ".join(tests), lambda: self._reader.survey(tests), show)

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
