"""What is chosen on the left of the page, in its address too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any
from urllib.parse import urlencode

import panel as pn

from ...bench.channels.schema import CHANNELS
from ...reports.bench_tests import TEST_TYPES
from ..frame import asked
from ..look import NAMES_CSS
from ..pane import text_pane
from ..store import Opened

NO_MOTOR = "(none: known column names)"
NO_RUN = "(none)"
WIDE = "stretch_width"


class Sidebar:
    """The widgets on the left.

    Attributes:
        motor: Motor file.
        kind: Test type.
        tests: Tests.
        channels: Signals that are channels.
        others: Columns that are none.
        run: Run whose simulated course is shown.
        follow: Whether growing files are followed.
        refresh: Looks at the folder again.
        status: What is followed, how far.
    """

    def __init__(self) -> None:
        self.motor = pn.widgets.Select(name="Motor file", sizing_mode=WIDE)
        self.kind = pn.widgets.Select(
            name="Test type",
            options={card.title: kind for kind, card in TEST_TYPES.items()},
            sizing_mode=WIDE,
        )
        self.tests, self.channels, self.others = (
            pn.widgets.CheckBoxGroup(sizing_mode=WIDE, stylesheets=[NAMES_CSS]) for _ in range(3)
        )
        self.run = pn.widgets.Select(name="Simulated course of run", sizing_mode=WIDE)
        self.follow = pn.widgets.Toggle(name="Follow changes", width=130)
        self.refresh = pn.widgets.Button(name="Look again", width=100)
        self.status = text_pane()
        self._others = pn.Column(
            text_pane("<h3>Columns without a channel</h3>"),
            pn.Column(self.others, max_height=160, scroll=True, sizing_mode=WIDE),
            sizing_mode=WIDE,
            visible=False,
        )

    def view(self, folder_name: str, folder_path: str, below: Sequence[Any]) -> list[Any]:
        """Return what stands on the left, top to bottom.

        Args:
            folder_name: Name of the folder that is shown.
            folder_path: Its path.
            below: What stands at the end.
        """
        return [
            text_pane(
                f"<p class='faded' title='{escape(folder_path)}'>Folder {escape(folder_name)}</p>"
            ),
            self.motor,
            self.kind,
            text_pane("<h3>Tests</h3>"),
            pn.Column(self.tests, max_height=200, scroll=True, sizing_mode=WIDE),
            pn.FlexBox(self.follow, self.refresh),
            self.status,
            text_pane("<h3>Signals</h3>"),
            pn.Column(self.channels, max_height=240, scroll=True, sizing_mode=WIDE),
            self._others,
            self.run,
            *below,
        ]

    @property
    def motor_name(self) -> str | None:
        """The motor file that is chosen, None for none."""
        name = self.motor.value
        return None if name in (None, NO_MOTOR) else str(name)

    @property
    def chosen(self) -> list[str]:
        """Names of the tests that are chosen."""
        return list(self.tests.value)

    def list_files(self, tests: list[str], motors: Sequence[str]) -> None:
        """Offer tests and motor files; what is chosen and still there stays chosen."""
        names = [*motors, NO_MOTOR]
        motor = self.motor.value
        self.motor.options = names
        self.motor.value = motor if motor in names else names[0]
        self.tests.options = tests
        self.tests.value = [name for name in self.tests.value if name in tests]

    def list_runs(self, names: Sequence[str], choose: str | None) -> None:
        """Offer runs.

        Args:
            names: The youngest first.
            choose: One that is chosen from now on; None keeps the choice.
        """
        chosen = self.run.value if choose is None else choose
        self.run.options = [NO_RUN, *names]
        self.run.value = chosen if chosen in names else NO_RUN

    def offer_signals(self, opened: Sequence[Opened], draw: Callable[[], None]) -> None:
        """Offer what the tests hold; the channels of the test type are chosen.

        Args:
            opened: The tests.
            draw: Called where the choice stays as it is; a change calls whoever watches it.
        """
        held = [c.name for c in CHANNELS if c.name != "time_s"
                and any(c.name in each.record for each in opened)]  # fmt: skip
        card = TEST_TYPES[self.kind.value]  # pyright: ignore[reportArgumentType]
        wanted = [name for name in held if name in card.channels] or held
        self.channels.options = held
        others = list(dict.fromkeys(name for each in opened for name in each.record.unused))
        self._others.visible = bool(others)
        self.others.options = others
        kept = [name for name in self.others.value if name in others]
        if kept != self.others.value:
            self.others.value = kept
        if self.channels.value == wanted:
            draw()
        else:
            self.channels.value = wanted

    def take_address(self) -> None:
        """Take up the choices of the page's address, as far as there are such files."""
        for widget, name in self._addressed():
            for value in asked(name)[:1]:
                if value in widget.values:
                    widget.value = value
        held = list(self.tests.options)
        self.tests.value = [name for name in asked("test") if name in held]
        self.follow.value = asked("follow")[:1] == ["1"]

    def write_address(self, more: Mapping[str, str]) -> None:
        """Keep what is chosen in the page's address, for reloads and bookmarks.

        Args:
            more: Other words of the address.
        """
        location = pn.state.location
        if location is None:
            return
        pairs = [(name, str(widget.value)) for widget, name in self._addressed()]
        pairs += [("test", name) for name in self.chosen]
        pairs += [("follow", "1")] if self.follow.value else []
        location.search = "?" + urlencode([*pairs, *more.items()])

    def _addressed(self) -> list[tuple[Any, str]]:
        return [(self.motor, "motor"), (self.kind, "type"), (self.run, "run")]
