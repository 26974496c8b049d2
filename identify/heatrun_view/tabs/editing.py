"""The tab with the text of the motor file: checked, and saved over the file that was read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import panel as pn

from heatrun.errors import InputError
from heatrun.io.toml_text import LARGEST_BYTES
from heatrun.model.catalogue import known_effects
from heatrun.motor.file import parse_motor
from heatrun.record.motor import Motor

from ..background import in_background
from ..look import text_pane
from ..motor_text import (
    fault_html,
    file_of_text,
    has_mixed_ends,
    read_motor_file,
    refuse_sent,
    text_of_file,
    write_motor_file,
)
from ..reading import Reader, problem
from ..store import Stamp
from ..words import error_message, message

ROWS = 24

TEXT_CSS = """
    textarea.bk-input {
      font-family: ui-monospace, "DejaVu Sans Mono", Consolas, monospace; font-size: 13px;
      line-height: 1.4; white-space: pre; overflow: auto; tab-size: 4;
    }
"""


class MotorPage(Protocol):
    """The page, as the editor sees it.

    Attributes:
        reader: Reads and checks the tests.
    """

    reader: Reader

    @property
    def motor_name(self) -> str | None:
        """The motor file that is chosen, or None."""
        ...

    @property
    def chosen(self) -> list[str]:
        """Names of the tests that are chosen."""
        ...

    @property
    def root(self) -> Path:
        """The folder outside of which nothing is written."""
        ...

    def path(self, name: str) -> Path:
        """Return the file of a name in the lists."""
        ...

    def open_tests(self) -> None:
        """Read the chosen tests again."""
        ...


@dataclass(frozen=True)
class Draft:
    """A text on the page.

    Attributes:
        base: What the file held when it was read.
        text: What stands on the page.
    """

    base: bytes
    text: str


@dataclass(frozen=True)
class Answer:
    """What came of a button.

    Attributes:
        said: As HTML.
        is_refused: The text is no motor file.
        saved: What the file holds now, None if it was not written.
    """

    said: str
    is_refused: bool = False
    saved: bytes | None = None


class Editing:
    """The text of the motor file that is chosen on the left.

    A text that is not saved stays when another file is chosen, and when the file changes.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, page: MotorPage) -> None:
        self._page = page
        self._name: str | None = None
        self._path: Path | None = None
        self._base: bytes | None = None
        self._stamp = Stamp(-1, -1)
        self._now = ""
        self._drafts: dict[str, Draft] = {}
        self._own: str | None = None
        self._is_sent = False
        self._head, self._changed, self._said = text_pane(), text_pane(), text_pane()
        self._text = pn.widgets.TextAreaInput(
            name="Text", rows=ROWS, max_length=LARGEST_BYTES, sizing_mode="stretch_width",
            stylesheets=[TEXT_CSS],
        )  # fmt: skip
        self._check = pn.widgets.Button(name="Check", width=90)
        self._save = pn.widgets.Button(name="Save", button_type="primary", width=90)
        self._anyway = pn.widgets.Button(name="Save all the same", width=150, visible=False)
        self._reload = pn.widgets.Button(name="Read the file again", width=150)
        self._back = pn.widgets.Button(name="Back to my text", width=130, visible=False)
        self._buttons = (self._check, self._save, self._anyway, self._reload, self._back)
        for button, act in zip(
            self._buttons,
            (self._check_text, self._save_text, self._save_anyway, self._read_again, self._to_own),
            strict=True,
        ):
            button.on_click(_without_event(act))
        for name in ("value", "value_input"):
            self._text.param.watch(lambda event: self._typed(event.new), name)
        self._form = pn.Column(
            self._text, pn.FlexBox(*self._buttons), sizing_mode="stretch_width", visible=False
        )
        self.view = pn.Column(
            self._head, self._changed, self._form, self._said, sizing_mode="stretch_width"
        )

    def choose(self) -> None:
        """Show the motor file that is chosen on the left."""
        name = self._page.motor_name
        if name is not None and name == self._name and self._base is not None:
            self.look()
            return
        self._keep_draft()
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
            self._stamp = Stamp(-1, -1)  # the next look holds the file against it
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

    def _keep_draft(self) -> None:
        if self._name is not None and self._base is not None and self._is_dirty:
            self._drafts[self._name] = Draft(self._base, self._now)

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

    def _save_text(self) -> None:
        self._write(self._now, is_forced=False)

    def _save_anyway(self) -> None:
        self._write(self._now, is_forced=True)

    def _write(self, text: str, *, is_forced: bool) -> None:
        path, base, name, root = self._path, self._base, str(self._name), self._page.root
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
            try:
                if read_motor_file(path) != base:
                    return Answer(CHANGED)
                if text == text_of_file(base, name):
                    return Answer(message("note", "Nothing was changed, and nothing written."))
                write_motor_file(root, path, base, after)
            except InputError as error:
                return Answer(error_message(error))
            return Answer(message("note", f"Written into {name}."), saved=after)

        self._start(work)

    def _start(self, work: Callable[[], Answer]) -> None:
        """Do what a button asks beside the page, and show what came of it."""
        name = self._name
        self._said.object = "<p class='faded'>Checking …</p>"
        self._changed.object = ""
        for button in self._buttons:
            button.disabled = True

        def done() -> Answer:
            try:
                return work()
            except Exception as error:
                return Answer(problem(str(name), error))

        def show(answer: Answer) -> None:
            for button in self._buttons:
                button.disabled = False
            self._save.disabled = self._is_sent
            if name == self._name:
                self._say(answer)

        in_background(done, show)

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


def _without_event(act: Callable[[], None]) -> Callable[[object], None]:
    return lambda _: act()
