"""One tab of the browser: what is chosen on the left, what comes of it on the right.

The chosen tests are read in the background, and followed as they grow.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from html import escape
from io import BufferedReader
from pathlib import Path

import panel as pn

from heatrun.errors import InputError
from heatrun_reports import CARDS, Kind

from ..background import LateTabs, in_background
from ..look import Screen, asked_theme, framed, on_change, text_pane
from ..reading import Reader, Reading, Refused
from ..running_jobs import JobQueue
from ..runs import Run, last_motor, runs_under
from ..store import Folder, Listing, Opened, RecordStore, UploadRoom
from ..words import error_message, message, problem
from .editing import Editing, Start
from .fitting import calibrating, discovering
from .fleet import FleetTab
from .sidebar import Sidebar
from .signals import Cutting, Signals
from .sliders import Sliders
from .switching_off import SwitchingOff
from .using import Reporting, Sending, Using

WATCH_MS = 1000
"""How often the files that are shown are looked at for changes."""

UPLOADED = "uploaded/"

SIGNALS = 1
"""Place of the tab of signals."""


class Page:
    """A tab of the browser.

    Attributes:
        out: Folder of the runs.
        root: The folder that is shown, outside of which nothing is written.
        reader: Reads and checks the tests.
    """

    def __init__(
        self, folder: Folder, out: Path, room: UploadRoom, store: RecordStore, queue: JobQueue
    ) -> None:
        self.folder, self.out, self.root = folder, out, folder.root
        self._uploads = Folder(room.folder)
        self._store = store
        self._runs: dict[str, Run] = {}
        self._theme = asked_theme()
        self.reader = Reader(self.path, store, self._open)
        self._tests = Tests(self.reader, self._take)

        self._sidebar = Sidebar()
        self._sending = Sending(room, self.list_folder)
        self._banner = text_pane()
        self.signals = Signals(Cutting(self), lambda: self._draw())
        self._checks = text_pane(message("note", "Choose tests in the side panel."))
        self.editing = Editing(self)
        self.sliders = Sliders(self.reader)
        self.calibrating = calibrating(self, queue)
        self.start = Start(self.reader, self.root, self._take_motor, self._calibrate)
        self.discovering = discovering(self, queue)
        self.reporting = Reporting(self, queue)
        self.using = Using(self, queue)
        self.switching_off = SwitchingOff(self.reader, out, self.list_folder)
        self.fleet = FleetTab(self.root, self.show_tests)
        self._tabs = LateTabs(
            ("Start", self.start.view),
            ("Signals", self.signals.view),
            ("Checks", self._checks),
            ("Motor file", self.editing.view),
            ("By hand", self.sliders.view),
            ("Calibration", self.calibrating.view),
            ("Discovery", self.discovering.view),
            ("Report", self.reporting.view),
            ("Simulate and export", self.using.view),
            ("Switch-off", self.switching_off.view),
            active=SIGNALS,
        )
        left = self._sidebar.view(folder.root, self._look_again, self._sending.view)
        self._has_fleet = False
        self.view = framed(left, [self._banner, self._tabs.view], self._look_like)
        self.list_folder()
        self._sidebar.take_address()
        self._connect()
        self._choose_channels()
        self.editing.choose()
        if self.chosen:
            self.open_tests()
        elif self.motor_name is None and self._tabs.shown is self.signals.view:
            self._tabs.show(self.start.view)
        self._offer_tab()
        self._tabs.render()

    def _connect(self) -> None:
        """Let the widgets act, and time too."""
        left = self._sidebar
        on_change(self.open_tests, left.motor, left.tests, left.simulated)
        on_change(self.editing.choose, left.motor)
        on_change(self._choose_channels, left.kind)
        on_change(self._draw, left.channels, left.others)
        on_change(self._show_run, left.run)
        on_change(self._begin_following, left.follow)
        self._tabs.view.param.watch(lambda _: self._offer_tab(), "active")
        if pn.state.curdoc is not None and pn.state.curdoc.session_context is not None:
            pn.state.add_periodic_callback(
                lambda: self._watch() if pn.state.loaded else None, period=WATCH_MS
            )
            pn.state.on_session_destroyed(lambda _: self._sending.close())

    @property
    def opened(self) -> tuple[Opened, ...]:
        """The tests that are shown."""
        return tuple(self._tests.opened.values())

    @property
    def kind(self) -> Kind:
        """The test type that is chosen."""
        return self._sidebar.kind.value  # pyright: ignore[reportReturnType]

    @property
    def motor_name(self) -> str | None:
        """The motor file that is chosen, as the page lists it, or None."""
        return self._sidebar.motor_name

    @property
    def motor_path(self) -> Path | None:
        """The motor file that is chosen, or None."""
        return None if self.motor_name is None else self.path(self.motor_name)

    def required_motor(self) -> str:
        """Return the path of the motor file that is chosen.

        Raises:
            InputError: If there is none.
        """
        if self.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one in the side panel.")
        return str(self.motor_path)

    def required_tests(self) -> list[str]:
        """Return the paths of the tests that are chosen, at least one.

        Raises:
            InputError: If there is none.
        """
        if not self.chosen:
            raise InputError("Expected a test.", remedy="Choose tests in the side panel.")
        return [str(self.path(name)) for name in self.chosen]

    @property
    def tests(self) -> list[str]:
        """Names of the tests in folder and uploads."""
        return list(self._sidebar.tests.options)

    @property
    def simulated(self) -> list[str]:
        """Names of the virtual records there."""
        return list(self._sidebar.simulated.options)

    @property
    def chosen(self) -> list[str]:
        """Names of the tests and virtual records that are chosen."""
        return self._sidebar.chosen

    @property
    def run(self) -> Run | None:
        """The run whose simulated course is shown."""
        return self._runs.get(str(self._sidebar.run.value))

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

    def say(self, html: str) -> None:
        """Show a sentence above everything."""
        self._banner.object = html

    def _look_like(self, screen: Screen) -> None:
        self._theme = ("dark" if screen.look.is_dark else "light") if screen.is_chosen else ""
        figures = (each.figure for each in (self.sliders, self.calibrating, self.discovering))
        for part in (self.signals, *figures):
            part.look_like(screen)
        self._write_address()

    def _look_again(self) -> None:
        self.list_folder()
        self.editing.choose()
        self.open_tests()

    def list_folder(self) -> None:
        """Bring the lists up to date; what is chosen and still there stays chosen."""
        listing = self.folder.list()
        sent = self._uploads.list()
        tests, simulated, motors = (
            [*getattr(listing, kind), *(UPLOADED + name for name in getattr(sent, kind))]
            for kind in ("tests", "simulated", "motors")
        )
        last = last_motor(self._runs_there(), {name: self.root / name for name in listing.motors})
        self._sidebar.list_files(tests, simulated, motors, last)
        self.list_runs()
        has_tests = bool(tests or simulated)
        if self.fleet.list_fleets() and not self._has_fleet:
            self._has_fleet = True
            self._tabs.append("Fleet", self.fleet.view)
            if not has_tests:
                self._tabs.show(self.fleet.view)
        self._say_of_folder(listing, has_tests)

    def show_tests(self, names: list[str], motor: str | None) -> None:
        """Choose tests, and a motor file, as if on the left, and show their signals.

        Names that are not listed are passed over.
        """
        left = self._sidebar
        if motor in left.motor.options:
            left.motor.value = motor
        left.choose(names)
        self._tabs.show(self.signals.view)

    def list_runs(self, choose: Path | None = None) -> None:
        """Bring the list of runs up to date; choose the one whose simulated course is shown."""
        self._runs = {run.path.name: run for run in reversed(self._runs_there())}
        youngest_first = [*reversed(self._runs)]
        self._sidebar.list_runs(youngest_first, None if choose is None else choose.name)
        for form in (self.discovering, self.calibrating):
            form.offer([self._runs[name] for name in youngest_first])

    def _runs_there(self) -> list[Run]:
        """Return the run folders, the youngest first."""
        root = self.folder.root
        return runs_under([(self.out, self.out), (root, root), (root / "runs", root)])

    def open_tests(self) -> None:
        """Read the chosen tests in the background and show them."""
        self._tabs.view.loading = True
        self._tests.open(self.chosen, self._sidebar.motor_name)

    def _take(self, reading: Reading, is_growth: bool) -> None:
        self._banner.object = reading.problems
        if reading.checks is not None:
            self._checks.object = reading.checks
        self._tabs.view.loading = False
        left = self._sidebar
        if not is_growth or not self.signals.grow(
            self._with_others(), left.channels.value, left.others.value
        ):
            self._choose_channels()
            self._offer_tab()
        self._say_following()

    def _offer_tab(self) -> None:
        """Prepare what takes a while once it is looked at."""
        shown = self._tabs.shown
        is_asked = shown is self.start.view and bool(self.chosen) and self.motor_name is None
        self._banner.visible = not is_asked  # the tab asks for what could not be read
        if shown is self.sliders.view:
            self.sliders.offer(self.opened, self.motor_name, self.run)
        elif shown is self.switching_off.view:
            self.switching_off.offer(self.motor_name, self.run)
        elif shown is self.start.view:
            self.start.offer(self.chosen, self.motor_name)

    def _take_motor(self, name: str) -> None:
        """Choose a motor file that has been written."""
        self.list_folder()
        self._sidebar.motor.value = name

    def _calibrate(self) -> None:
        self._tabs.show(self.calibrating.view)
        self.calibrating.start()

    def _choose_channels(self) -> None:
        """Offer the signals of the tests, and say what they lack for the test type."""
        card = CARDS[self.kind]
        missing = [
            f"{each.record.name} holds no {lack}, which this test type needs."
            for each in self.opened
            if (lack := card.lacks(each.record))
        ]
        self.reporting.say_missing(missing)
        self._sidebar.offer_signals(self.opened, self._draw)

    def _with_others(self) -> list[Opened]:
        """Return the tests, with the columns that are no channel if such are to be drawn."""
        if not self._sidebar.others.value:
            return list(self.opened)
        found = []
        for each in self.opened:
            try:
                found.append(self._store.with_others(each, self._open))
            except InputError as error:
                self.say(error_message(error))
                found.append(each)
        return found

    def _draw(self) -> None:
        self._write_address()
        try:
            bands = self.run.bands(self.opened) if self.run else []
        except Exception as error:  # a result of another version, or a damaged one
            bands = []
            self.say(problem(f"run {self._sidebar.run.value}", error))
        left = self._sidebar
        self.signals.show(self._with_others(), left.channels.value, left.others.value, bands)

    def _show_run(self) -> None:
        self.reporting.offer_references()
        self._offer_tab()
        self._draw()

    def _write_address(self) -> None:
        self._sidebar.write_address({"theme": self._theme} if self._theme else {})

    def _begin_following(self) -> None:
        self._write_address()
        self._watch()
        self._say_following()

    def _watch(self) -> None:
        self.editing.look()
        self.fleet.look()
        if self._sidebar.follow.value:
            if self._tests.has_news:
                self._tests.follow(self._sidebar.motor_name)
            return
        changed = self._tests.outdated()
        if changed and self._tests.is_idle:
            self._banner.object = message(
                "warning",
                f"{', '.join(changed)}: the file has changed or is gone since it was opened; what "
                "is shown is the old content. “Look again” shows the new one, “Follow changes” "
                "goes with it.",
            )

    def _say_following(self) -> None:
        """Say how far the tests that are followed have come."""
        if not self._sidebar.follow.value:
            self._sidebar.status.object = ""
            return
        rows = [
            f"{escape(each.record.name)}: {each.record.time_s.size} rows, to "
            f"{each.record.time_s[-1] / 60:.2f} min"
            for each in self.opened
            if each.is_part
        ]
        said = f"<br>as of {time.strftime('%H:%M:%S')}" if rows else "the chosen tests"
        self._sidebar.status.object = f"<p class='faded'>Following {'<br>'.join(rows)}{said}</p>"

    def _say_of_folder(self, listing: Listing, has_tests: bool) -> None:
        kind, said = "note", ""
        if listing.is_cut:
            kind = "warning"
            said = "The folder holds more files than are listed. Show a smaller folder."
        elif not has_tests and not self._has_fleet:
            said = (
                f"There are no bench files in {self.folder.root}. Drop one in the side panel, or "
                "start `heatrun view` on the folder of your tests."
            )
        elif listing.num_own and not self._banner.object:
            said = (
                "Files that heatrun itself has written are no tests and not listed: "
                f"{listing.num_own}."
            )
        if said:
            self.say(message(kind, said))


MAX_READERS = 4
"""Readings at a time; one that takes long does not keep the page from the tests chosen since."""


class Tests:
    """The tests of a tab as they were read last, by the names of the page."""

    def __init__(self, reader: Reader, changed: Callable[[Reading, bool], None]) -> None:
        """Take who reads, and whom to tell what came of it, and whether it only grew."""
        self.opened: Mapping[str, Opened] = {}
        self._refused: Mapping[str, Refused] = {}
        self._reader = reader
        self._changed = changed
        self._generation = 0
        self._num_reading = 0
        self._waiting: tuple[list[str], str | None] | None = None

    @property
    def is_idle(self) -> bool:
        """Whether nothing is being read."""
        return self._num_reading == 0

    def outdated(self) -> list[str]:
        """Return the names of tests whose file is not the one that was read."""
        return [name for name, each in self.opened.items() if not each.is_current()]

    @property
    def has_news(self) -> bool:
        """Whether a look at the files may bring anything."""
        return bool(self.outdated() or self._refused)

    def open(self, names: Sequence[str], motor_name: str | None) -> None:
        """Read tests, as the page lists them, in place of those of before."""
        self._generation += 1
        if self._num_reading >= MAX_READERS:
            self._waiting = (list(names), motor_name)
            return
        self._waiting, wanted = None, list(names)
        self._begin(lambda: self._reader.read(wanted, motor_name), is_growth=False)

    def follow(self, motor_name: str | None) -> None:
        """Read what has been written to the tests since, and those that could not be read yet."""
        if not self.is_idle:
            return
        before: dict[str, Opened | Refused] = {**self.opened, **self._refused}
        self._begin(lambda: self._reader.follow(before, motor_name), is_growth=True)

    def _begin(self, read: Callable[[], Reading], *, is_growth: bool) -> None:
        generation = self._generation
        self._num_reading += 1

        def take(reading: Reading) -> None:
            self._num_reading -= 1
            if generation == self._generation:
                self.opened, self._refused = reading.opened, reading.refused
                self._changed(reading, is_growth)
            elif self._waiting is not None:
                self.open(*self._waiting)

        in_background(read, take)
