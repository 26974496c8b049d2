"""The tab on which readings after switch-off are typed, and the winding's temperature follows."""

import re
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError
from heatrun.record.motor import Motor
from heatrun.shutdown import winding_at_switch_off
from heatrun.shutdown.printed import figure
from heatrun.shutdown.result import ShutdownResult
from heatrun.shutdown.sheet import write_results

from ..background import Latest, Soon
from ..look import button, on_change, text_pane
from ..reading import Reader
from ..runs import Run, run_name, typed_number
from ..words import error_message, message, shutdown_html

HEADS = {"resistance [mΩ]": "R [mOhm]", "resistance [Ω]": "R [Ohm]",
         "sensor in the winding [°C]": "T [degC]"}  # fmt: skip
"""What may be typed, and the heading that the reader knows."""

OHMS = {"R [mOhm]": 1e-3, "R [Ohm]": 1.0}

EXAMPLE = "30 16.62\n60 16.41\n90 16.24\n120 16.10"
MOST_CHARACTERS = 20_000


@dataclass(frozen=True)
class Typed:
    """What stands on the page; what is left empty is the motor file's."""

    head: str  # Heading of the readings.
    readings: str = ""  # Times and readings, a line each.
    cold: str = ""  # Cold resistance in their unit.
    cold_at: str = ""  # Its temperature [degC].
    sink: str = ""  # Temperature that the machine cools to [degC].

    def machine(self, motor: Motor) -> Motor:
        """Return the machine with what is stated on the page."""
        stated: dict[str, object] = {}
        if self.cold.strip() and self.head in OHMS:
            ohm = OHMS[self.head] * typed_number(self.cold, "cold resistance", "12.4")
            stated |= {"measured_resistance_ohm": ohm}
        if self.cold_at.strip():
            stated["reference_temperature_degC"] = typed_number(
                self.cold_at, "its temperature", "12.4"
            )
        if self.sink.strip():
            degC = typed_number(self.sink, f"temperature of the {motor.sink}", "25")
            stated["constants"] = {**motor.constants, f"{motor.sink}_degC": degC}
        # the columns are those of this page, not of a logger
        return replace(motor, columns={}, tests={}, **stated)

    def known(self, motor: Motor) -> dict[str, str]:
        """Return what counts where nothing is typed, by field, as far as the machine has it."""
        stated, phase = motor.measured_resistance_ohm, motor.phase_resistance_ohm
        ohm, of = (phase, " a phase") if stated is None else (stated, "")
        sink = motor.constants.get(f"{motor.sink}_degC")
        found = {"cold_at": motor.reference_temperature_degC, "sink": sink}
        if self.head in OHMS and ohm is not None:
            found["cold"] = ohm / OHMS[self.head]
        return {key: f"{value:.6g}{of if key == 'cold' else ''} (motor file)"
                for key, value in found.items() if value is not None}  # fmt: skip

    def table(self) -> str:
        """Return the readings as a file holds them."""
        rows = [_row(line, place) for place, line in enumerate(self.readings.splitlines(), 1)
                if line.strip()]  # fmt: skip
        return "\n".join([f"time [s],{self.head}", *(f"{t!r},{value!r}" for t, value in rows), ""])


class SwitchingOff:
    """Readings that are typed in, and what the winding had at switch-off."""

    def __init__(self, reader: Reader, out: Path, listed: Callable[[], None]) -> None:
        """Take what reads motor files, the folder of results, and whom to tell of a new one."""
        self._reader, self._out, self._listed = reader, out, listed
        self._motor: str | None = None
        self._run: Run | None = None
        self._is_busy = self._is_stale = False
        self._result: ShutdownResult | None = None
        self._soon, self._latest = Soon(), Latest()
        text = pn.widgets.TextInput
        self._readings = pn.widgets.TextAreaInput(
            name="Seconds since switch-off, and reading", placeholder=EXAMPLE,
            rows=12, max_length=MOST_CHARACTERS, width=300,
        )  # fmt: skip
        self._head = pn.widgets.Select(name="Reading", options=HEADS, width=300)
        self._cold = text(name="Cold resistance, same circuit and unit", width=300)
        self._cold_at = text(name="at [°C]", width=140)
        self._sink = text(width=140)
        self._with_run = pn.widgets.Checkbox(name="", visible=False)
        self._name = text(name="Name of the folder", value="switch_off", width=200)
        self._save = button("Save", self._write, 90, align="end", disabled=True)
        self._said, self._saved = text_pane(), text_pane()
        self._figure = pn.pane.PNG(None, sizing_mode="scale_width", max_width=760, visible=False)
        self._now: dict[str, str] = {}
        self._fields = {"readings": self._readings, "cold": self._cold,
                        "cold_at": self._cold_at, "sink": self._sink}  # fmt: skip
        for key, field in self._fields.items():
            for name in ("value", "value_input"):  # the second while something is typed
                field.param.watch(partial(self._take, key), name)
        on_change(lambda: self._soon(self._ask), self._head, self._with_run)
        on_change(self._say_known, self._head)
        asked = pn.Column(
            self._head, self._readings, self._cold, pn.FlexBox(self._cold_at, self._sink),
            self._with_run, pn.FlexBox(self._name, self._save), self._saved, width=320,
        )  # fmt: skip
        answer = pn.Column(self._figure, self._said, styles={"flex": "1 1 380px"}, min_width=300)
        self.view = pn.FlexBox(asked, answer)

    def offer(self, motor: str | None, run: Run | None) -> None:
        """Take another machine, as the page lists it, or run, whose time constants may be taken."""
        self._motor, self._run = motor, run
        self._with_run.visible = run is not None
        self._with_run.name = "" if run is None else f"Time constants of run {run.path.name}"
        self._say_known()
        self._ask()

    def _say_known(self) -> None:
        """Ask for what the machine cools to, and show what counts where nothing is typed."""
        known, sink = {"readings": EXAMPLE}, Motor("").sink
        with suppress(InputError):  # said where the readings are worked out
            if self._motor is not None:
                motor = self._reader.motor(self._motor)
                sink = motor.sink
                known |= Typed(head=str(self._head.value)).known(motor)
        self._sink.name = f"{sink.capitalize()} [°C]"
        for key, field in self._fields.items():
            field.placeholder = known.get(key, "")

    def _take(self, key: str, event: Any) -> None:
        if self._now.get(key, "") != (event.new or ""):
            self._now[key] = event.new or ""
            self._soon(self._ask)

    def _ask(self) -> None:
        """Work out beside the page what stands on it; once more where it has changed meanwhile."""
        if self._is_busy:
            self._is_stale = True
            return
        typed, name = Typed(head=str(self._head.value), **self._now), self._motor
        run = self._run if self._with_run.value else None
        if name is None or not typed.readings.strip():
            what = "Choose a motor file in the side panel" if name is None else "Type readings"
            self._show(message("note", f"{what}."))
            return
        self._is_busy = True

        def work() -> tuple[ShutdownResult, bytes]:
            found = answer(typed, self._reader.motor(name), run)
            return found, figure(found)

        def show(found: tuple[ShutdownResult, bytes] | str) -> None:
            self._is_busy = False
            self._show(found)
            if self._is_stale:
                self._is_stale = False
                self._ask()

        self._latest.ask("readings", work, show)

    def _show(self, found: tuple[ShutdownResult, bytes] | str) -> None:
        self._result, drawn = (None, None) if isinstance(found, str) else found
        self._save.disabled = self._result is None
        self._saved.object = ""
        self._said.object = found if isinstance(found, str) else shutdown_html(found[0])
        self._figure.object, self._figure.visible = drawn, drawn is not None

    def _write(self) -> None:
        if self._result is None:
            return
        try:
            folder = self._out / run_name(str(self._name.value), "switch_off")
            if folder.exists():
                raise InputError(f"{folder.name} exists.", remedy="Choose another name.")
            stated = None if self._motor is None else self._reader.motor(self._motor).certificate
            write_results(self._result, folder, stated=stated)
        except InputError as error:
            self._saved.object = error_message(error)
            return
        self._saved.object = message("note", f"Written into {folder.name}.")
        self._listed()


def answer(typed: Typed, motor: Motor, run: Run | None) -> ShutdownResult:
    """Return the winding at switch-off of what stands on the page.

    Raises:
        InputError: If a number is none, or the readings are none of a winding that cools.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "readings.csv"
        path.write_text(typed.table(), encoding="utf-8")
        try:
            return winding_at_switch_off(
                typed.machine(motor), path, run=None if run is None else run.path
            )
        except InputError as error:
            where = error.where.replace(str(path), "readings")
            raise InputError(error.problem, where=where, remedy=error.remedy) from None


def _row(line: str, place: int) -> tuple[float, float]:
    """Return time and reading of a line: `30 0,0162`, `30; 16.2`, `0:30<tab>16.2` or `30,16.2`."""
    text = line.strip()
    parts = re.split(r"\s*[;\t]\s*|\s+", text) if re.search(r"[;\s]", text) else text.split(",")
    if len(parts) == 2:
        try:
            minutes, _, seconds = parts[0].rstrip(",").rpartition(":")
            time_s = 60.0 * float(minutes or 0.0) + float(seconds.replace(",", "."))
            return time_s, float(parts[1].replace(",", "."))
        except ValueError:
            pass
    raise InputError(
        f"Expected a time and a reading, got {text[:40]!r}.",
        where=f"readings, line {place}",
        remedy="Such as 30 16.62 or 0:30 16,62.",
    )
