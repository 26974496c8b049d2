"""One tab of the browser: what is chosen on the left, what comes of it on the right."""

from __future__ import annotations

import threading
from html import escape
from io import BufferedReader
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import panel as pn

from ...bench.channels.schema import CHANNELS
from ...errors import InputError, of_file
from ...reports.bench_tests import TEST_TYPES, Kind
from ..folder import Folder, Listing
from ..frame import asked, asked_look, framed
from ..jobs.running import JobQueue
from ..look import pane_css, tabs_css
from ..reading import Reading, problem, read_tests
from ..runs import Run, runs_under
from ..store import Opened, RecordStore
from ..uploads import BoundedDropper, UploadRoom, keep_upload
from ..words import error_message, message
from .calibrating import calibrating
from .discovering import discovering
from .reporting import Reporting
from .signals import Signals

MAX_READERS = 4
"""Readings at a time; one that takes long does not keep the page from the tests chosen since."""

WATCH_MS = 2000
"""How often the files that are shown are looked at for changes."""

NO_MOTOR = "(none: known column names)"
NO_RUN = "(none)"
UPLOADED = "uploaded/"


class Page:
    """A tab.

    Attributes:
        view: The page.
        opened: The tests that are shown.
    """

    def __init__(
        self,
        folder: Folder,
        out: Path,
        room: UploadRoom,
        store: RecordStore,
        queue: JobQueue,
    ) -> None:
        self.folder, self.out = folder, out
        self.opened: tuple[Opened, ...] = ()
        self._room = room
        self._uploads = Folder(room.folder)
        self._store = store
        self._runs: dict[str, Run] = {}
        self._generation = 0
        self._num_reading = 0
        self._is_waiting = False
        self.look = asked_look()

        self._motor_choice = pn.widgets.Select(name="Motor file", sizing_mode="stretch_width")
        self._type = pn.widgets.Select(
            name="Test type",
            options={card.title: kind for kind, card in TEST_TYPES.items()},
            sizing_mode="stretch_width",
        )
        self._tests = pn.widgets.CheckBoxGroup(sizing_mode="stretch_width")
        self._channels = pn.widgets.CheckBoxGroup(sizing_mode="stretch_width")
        self._run = pn.widgets.Select(name="Simulated course of run", sizing_mode="stretch_width")
        self._follow = pn.widgets.Toggle(name="Follow changes", width=150)
        self._refresh = pn.widgets.Button(name="Look again", width=110)
        self._dropper = BoundedDropper(room, self._refuse, height=90, width=290)
        self._banner = self.pane("")
        self._upload_problem = self.pane("")

        self.signals = Signals(self.look)
        self._checks = self.pane(message("note", "Choose tests on the left."))
        self.calibrating = calibrating(self, queue)
        self.discovering = discovering(self, queue)
        self.reporting = Reporting(self, queue)
        self._tabs = pn.Tabs(
            ("Signals", self.signals.view),
            ("Checks", self._checks),
            ("Calibration", self.calibrating.view),
            ("Discovery", self.discovering.view),
            ("Report", self.reporting.view),
            sizing_mode="stretch_width",
            dynamic=False,
            stylesheets=[tabs_css(self.look)],
        )
        self.view = framed(self.look, self._sidebar(), [self._banner, self._tabs])
        self.list_folder()
        self._choose_as_in_address()
        self._motor_choice.param.watch(lambda _: self.open_tests(), "value")
        self._tests.param.watch(lambda _: self.open_tests(), "value")
        self._type.param.watch(lambda _: self._choose_channels(), "value")
        self._channels.param.watch(lambda _: self._draw(), "value")
        self._run.param.watch(lambda _: self._show_run(), "value")
        self._refresh.on_click(lambda _: self._look_again())
        self._dropper.param.watch(self._keep, "value")
        self._choose_channels()
        if self._tests.value:
            self.open_tests()
        if pn.state.curdoc is not None and pn.state.curdoc.session_context is not None:
            pn.state.add_periodic_callback(self._watch, period=WATCH_MS)
            pn.state.on_session_destroyed(lambda _: self._dropper.close())

    @property
    def kind(self) -> Kind:
        """The test type that is chosen."""
        return self._type.value  # pyright: ignore[reportReturnType]

    @property
    def motor_path(self) -> Path | None:
        """The motor file that is chosen, or None."""
        name = self._motor_choice.value
        return None if name in (None, NO_MOTOR) else self.path(str(name))

    @property
    def tests(self) -> list[str]:
        """Names of the tests in folder and uploads."""
        return list(self._tests.options)

    @property
    def chosen(self) -> list[str]:
        """Names of the tests that are chosen."""
        return list(self._tests.value)

    def path(self, name: str) -> Path:
        """Return the file of a name in the lists.

        Raises:
            InputError: If there is none inside the folders that may be read.
        """
        if name.startswith(UPLOADED):
            return self._uploads.path(name.removeprefix(UPLOADED))
        return self.folder.path(name)

    def _open(self, path: Path) -> BufferedReader:
        sent = self._uploads
        return (sent if path.is_relative_to(sent.root) else self.folder).open(path)

    def pane(self, html: str) -> pn.pane.HTML:
        """Return a pane of text in the page's style."""
        return pn.pane.HTML(
            html, stylesheets=[pane_css(self.look)], sizing_mode="stretch_width", min_height=0
        )

    def _look_again(self) -> None:
        self.list_folder()
        self.open_tests()

    def list_folder(self) -> None:
        """Bring the lists up to date; what is chosen and still there stays chosen."""
        listing = self.folder.list()
        sent = self._uploads.list()
        tests = [*listing.tests, *(UPLOADED + name for name in sent.tests)]
        motors = [*listing.motors, *(UPLOADED + name for name in sent.motors), NO_MOTOR]
        motor = self._motor_choice.value
        self._motor_choice.options = motors
        self._motor_choice.value = motor if motor in motors else motors[0]
        self._tests.options = tests
        self._tests.value = [name for name in self._tests.value if name in tests]
        self.list_runs()
        self._say_of_folder(listing, bool(tests))

    def list_runs(self, choose: Path | None = None) -> None:
        """Bring the list of runs up to date.

        Args:
            choose: A run whose simulated course is shown from now on.
        """
        root = self.folder.root
        runs = runs_under([(self.out, self.out), (root, root), (root / "runs", root)])
        self._runs = {run.path.name: run for run in reversed(runs)}
        names = [NO_RUN, *reversed(self._runs)]
        chosen = self._run.value if choose is None else choose.name
        self._run.options = names
        self._run.value = chosen if chosen in names else NO_RUN
        self.discovering.offer(list(self._runs.values())[::-1])
        self.calibrating.offer(list(self._runs.values())[::-1])

    def _choose_as_in_address(self) -> None:
        """Take up the choices of the page's address, as far as there are such files."""
        for widget, name in self._addressed():
            for value in asked(name)[:1]:
                if value in widget.values:
                    widget.value = value
        self._tests.value = [name for name in asked("test") if name in self.tests]

    def _addressed(self) -> list[tuple[Any, str]]:
        return [(self._motor_choice, "motor"), (self._type, "type"), (self._run, "run")]

    def _write_address(self) -> None:
        """Keep what is chosen in the page's address, for reloads and bookmarks."""
        location = pn.state.location
        if location is None:
            return
        pairs = [(name, str(widget.value)) for widget, name in self._addressed()]
        pairs += [("test", name) for name in self.chosen]
        pairs += [("theme", "dark")] if self.look.is_dark else []
        location.search = "?" + urlencode(pairs)

    @property
    def run(self) -> Run | None:
        """The run whose simulated course is shown."""
        return self._runs.get(str(self._run.value))

    def open_tests(self) -> None:
        """Read the chosen tests in the background and show them."""
        self._generation += 1
        self._is_waiting = self._num_reading >= MAX_READERS
        if self._is_waiting:
            return
        self._num_reading += 1
        generation = self._generation
        names = self.chosen
        document = pn.state.curdoc
        self._tabs.loading = True

        motor = self._motor_choice.value
        motor_name = None if motor in (None, NO_MOTOR) else str(motor)

        def work() -> None:
            reading = read_tests(names, motor_name, self.path, self._store, self._open)

            def show() -> None:
                self._num_reading -= 1
                if generation == self._generation:
                    self._take(reading)
                elif self._num_reading < MAX_READERS and self._is_waiting:
                    self.open_tests()

            if document is None:
                show()
            else:
                document.add_next_tick_callback(show)

        if document is None:
            work()
        else:
            threading.Thread(target=work, daemon=True, name="heatrun reader").start()

    def _take(self, reading: Reading) -> None:
        self.opened = reading.opened
        self._banner.object = reading.problems
        self._checks.object = reading.checks
        self._choose_channels()
        self._tabs.loading = False

    def _choose_channels(self) -> None:
        """Offer the channels that the tests hold; those of the test type are chosen."""
        held = [c.name for c in CHANNELS if c.name != "time_s"
                and any(c.name in each.record for each in self.opened)]  # fmt: skip
        card = TEST_TYPES[self.kind]
        wanted = [name for name in held if name in card.channels]
        self._channels.options = held
        missing = [
            f"{each.record.name} holds no {need.meaning}, which this test type needs."
            for each in self.opened
            for need in card.missing(each.record)
        ]
        self.reporting.say_missing(missing)
        if self._channels.value == (wanted or held):
            self._draw()
        else:
            self._channels.value = wanted or held

    def _draw(self) -> None:
        self._write_address()
        try:
            bands = self.run.bands(self.opened) if self.run else []
        except Exception as error:  # a result of another version, or a damaged one
            bands = []
            self.say(problem(f"run {self._run.value}", error))
        self.signals.show(self.opened, self._channels.value, bands)

    def _show_run(self) -> None:
        self.reporting.offer_references()
        self._draw()

    def say(self, html: str) -> None:
        """Show a sentence above everything."""
        self._banner.object = html

    def _watch(self) -> None:
        changed = [each for each in self.opened if not each.is_current()]
        if not changed:
            return
        names = ", ".join(each.record.name for each in changed)
        if self._follow.value and not self._tabs.loading:
            self.open_tests()
        else:
            self._banner.object = message(
                "warning",
                f"{names}: the file has changed or is gone since it was opened; what is shown is "
                "the old content. “Look again” shows the new one.",
            )

    def _keep(self, _: Any) -> None:
        problems = ""
        for name, content in self._dropper.arrived().items():
            try:
                keep_upload(self._room.folder, name, content)
            except InputError as error:
                problems += error_message(error)
            except OSError as error:
                problems += error_message(of_file(error))
        self._upload_problem.object = problems
        self.list_folder()

    def _refuse(self, error: InputError) -> None:
        self._upload_problem.object = error_message(error)

    def _say_of_folder(self, listing: Listing, has_tests: bool) -> None:
        if listing.is_cut:
            self._banner.object = message(
                "warning", "The folder holds more files than are listed. Show a smaller folder."
            )
        elif not has_tests:
            self._banner.object = message(
                "note",
                f"There are no bench files in {self.folder.root}. Drop one on the left, or start "
                "`heatrun view` on the folder of your tests.",
            )
        elif listing.num_own and not self._banner.object:
            self._banner.object = message(
                "note",
                f"Files that heatrun itself has written are no tests and not listed: "
                f"{listing.num_own}.",
            )

    def _sidebar(self) -> list[Any]:
        return [
            self.pane(
                f"<p class='faded' title='{escape(str(self.folder.root))}'>"
                f"Folder {escape(self.folder.root.name)}</p>"
            ),
            self._motor_choice,
            self._type,
            self.pane("<h3>Tests</h3>"),
            pn.Column(self._tests, max_height=220, scroll=True, sizing_mode="stretch_width"),
            pn.Row(self._refresh, self._follow),
            self._run,
            self.pane("<h3>Signals</h3>"),
            pn.Column(self._channels, max_height=260, scroll=True, sizing_mode="stretch_width"),
            self.pane("<h3>Other files</h3>"),
            self._dropper,
            self._upload_problem,
        ]
