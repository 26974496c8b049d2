"""What is chosen on the left of the page, in its address too."""

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import panel as pn

from heatrun.record.channels import CHANNELS
from heatrun_reports import CARDS

from ..look import NAMES_CSS, WIDE, asked, button, stacked, text_pane
from ..store import Opened

NO_MOTOR = "(none: known column names)"
NO_RUN = "(none)"


class Sidebar:
    """The widgets on the left: files, test type, signals that are channels and others, run."""

    def __init__(self) -> None:
        self.motor = pn.widgets.Select(name="Motor file", sizing_mode=WIDE)
        self.kind = pn.widgets.Select(
            name="Test type",
            options={card.title.removesuffix(" Validation"): kind for kind, card in CARDS.items()},
            sizing_mode=WIDE,
        )
        self.tests, self.simulated, self.channels, self.others = (
            pn.widgets.CheckBoxGroup(sizing_mode=WIDE, stylesheets=[NAMES_CSS]) for _ in range(4)
        )
        self.run = pn.widgets.Select(name="Simulated course of run", sizing_mode=WIDE)
        self.follow = pn.widgets.Toggle(name="Follow changes", width=130)
        self.status = text_pane()
        self._others = _group("Columns without a channel", self.others, 160, visible=False)
        self._simulated = _group("Simulated", self.simulated, 160, visible=False)

    def view(self, folder: Path, look_again: Callable[[], None], below: Any) -> list[Any]:
        """Return what stands on the left, top to bottom, with something else at the end."""
        name, path = escape(folder.name), escape(str(folder))
        return [
            text_pane(f"<p class='faded' title='{path}'>Folder {name}</p>"),
            self.motor,
            self.kind,
            _group("Tests", self.tests, 200),
            self._simulated,
            pn.FlexBox(self.follow, button("Look again", look_again, 100)),
            self.status,
            _group("Signals", self.channels, 240),
            self._others,
            self.run,
            below,
        ]

    @property
    def motor_name(self) -> str | None:
        """The motor file that is chosen, None for none."""
        name = self.motor.value
        return None if name in (None, NO_MOTOR) else str(name)

    @property
    def chosen(self) -> list[str]:
        """Names of the tests and virtual records that are chosen."""
        return [*self.tests.value, *self.simulated.value]

    def choose(self, names: Sequence[str]) -> None:
        """Choose tests and virtual records; those that are not listed are passed over."""
        for widget in (self.tests, self.simulated):
            widget.value = [name for name in names if name in widget.options]

    def list_files(
        self, tests: list[str], simulated: list[str], motors: list[str], last: str | None
    ) -> None:
        """Offer files; what is chosen and still there stays chosen.

        Where no motor file is chosen, the one that was used last is.
        """
        chosen, motor = self.chosen, self.motor.value
        names = [*motors, NO_MOTOR]
        self.motor.options = names
        self.motor.value = next(name for name in (motor, last, names[0]) if name in names)
        self.tests.options, self.simulated.options = tests, simulated
        self._simulated.visible = bool(simulated)
        self.choose(chosen)

    def list_runs(self, names: Sequence[str], choose: str | None) -> None:
        """Offer runs, the youngest first; choose one of them, or keep the choice."""
        chosen = self.run.value if choose is None else choose
        self.run.options = [NO_RUN, *names]
        self.run.value = chosen if chosen in names else NO_RUN

    def offer_signals(self, opened: Sequence[Opened], draw: Callable[[], None]) -> None:
        """Offer what the tests hold; the channels of the test type are chosen.

        What draws is called where the choice stays as it is; a change calls whoever watches it.
        """
        held = [c.name for c in CHANNELS if c.name != "time_s"
                and any(c.name in each.record for each in opened)]  # fmt: skip
        card = CARDS[self.kind.value]  # pyright: ignore[reportArgumentType]
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
        self.choose(asked("test"))
        self.follow.value = asked("follow")[:1] == ["1"]

    def write_address(self, more: Mapping[str, str]) -> None:
        """Keep what is chosen, and more, in the page's address for reloads and bookmarks."""
        location = pn.state.location
        if location is None:
            return
        pairs = [(name, str(widget.value)) for widget, name in self._addressed()]
        pairs += [("test", name) for name in self.chosen]
        pairs += [("follow", "1")] if self.follow.value else []
        location.search = "?" + urlencode([*pairs, *more.items()])

    def _addressed(self) -> list[tuple[Any, str]]:
        return [(self.motor, "motor"), (self.kind, "type"), (self.run, "run")]


def _group(title: str, widget: Any, max_height: int, **options: Any) -> pn.Column:
    """Return a list of names under its heading, which scrolls beyond a height [px]."""
    inner = stacked(widget, max_height=max_height, scroll=True)
    return stacked(text_pane(f"<h3>{title}</h3>"), inner, **options)
