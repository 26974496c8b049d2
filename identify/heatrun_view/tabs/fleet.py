"""The tab that shows a fleet: a row for each machine, and all that is known of the one chosen."""

import time
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import panel as pn
from bokeh.models import (
    CDSView,
    ColumnDataSource,
    DataTable,
    HTMLTemplateFormatter,
    IndexFilter,
    NumberFormatter,
    StringFormatter,
    TableColumn,
)

from heatrun.errors import InputError
from heatrun.io.quantities import printed_unit

from ..background import in_order
from ..fleets import STRIP, Fleet, Row, columns, details, files, fleets_under, headline, parameters
from ..look import WIDE, button, on_change, stacked, text_pane
from ..words import message, problem

LOOK_S = 5.0
"""How often a fleet is looked at for new machines."""

MOST_PARAMETERS = 8
"""Parameters with a column of their own; all of them stand behind a click on the machine."""

NO_PYARROW = "A fleet is read with pyarrow, which is not installed: install heatrun[fleet]."

ROW_PX, TABLE_PX, LANE_PX = 28, 480, 5

ENDS_PX = 44
"""Heads of the columns, and the bar that moves them [px]."""

EVERY = "all types"
ALL, ODD, POOR, FOUND = "all machines", "not fitting their type", "not fitted", "with warnings"

STRIP_TEMPLATE = f"""
<svg width="{STRIP + 12}" height="<%= {LANE_PX} * value.length / 3 + 3 %>" style="display: block">
<line x1="{STRIP // 2 + 6}" x2="{STRIP // 2 + 6}" y1="0" y2="100%" stroke="currentColor"
  stroke-opacity="0.3"/>
<% for (let i = 0; 3 * i < value.length; i++) {{ const y = {LANE_PX} * i + 4; %>
<line x1="<%= value[3 * i] + 6 %>" x2="<%= value[3 * i + 2] + 6 %>" y1="<%= y %>" y2="<%= y %>"
  stroke="var(--hr-strip)" stroke-width="2"/>
<circle cx="<%= value[3 * i + 1] + 6 %>" cy="<%= y %>" r="2" fill="var(--hr-strip)"/>
<% }} %></svg>
"""

NUMBER_TEMPLATE = """
<div style="text-align: right"><%= Number.isFinite(value) ? value.toFixed(2) : "" %></div>
"""

TABLE_CSS = """
    :host { --hr-strip: light-dark(#0072b2, #4fb0ea); color: var(--hr-ink); font-size: 13px; }
    .slick-header, .slick-header-columns, .slick-header-column.ui-state-default {
      background: var(--hr-faint); color: var(--hr-ink); font-weight: 600;
    }
    .slick-row, .slick-row.odd, .slick-cell { background: var(--hr-paper); color: var(--hr-ink); }
    .slick-cell { border-color: var(--hr-faint); line-height: 24px; }
    .slick-cell.selected, .slick-row .slick-cell.active.selected { background: var(--hr-faint); }
    .slick-sort-indicator { color: var(--hr-ink); }
"""


class FleetTab:
    """The fleets of the folder that is shown."""

    def __init__(self, root: Path, show_tests: Callable[[list[str], str | None], None]) -> None:
        self._root, self._show_tests = root, show_tests
        self.fleets: list[Fleet] = []
        self._rows: tuple[Row, ...] = ()
        self._sisters: dict[str, Row] = {}
        self._columns: dict[str, list[Any]] = {}
        self._state: Any = None
        self._looked = 0.0
        self._fleet = pn.widgets.Select(name="Fleet", width=220)
        self._type = pn.widgets.Select(name="Type", width=150)
        self._which = pn.widgets.Select(
            name="Machines", options=[ALL, ODD, FOUND, POOR], value=ALL, width=180
        )
        self._text = pn.widgets.TextInput(name="Name or covariate holds", width=180)
        self._said, self._details = text_pane(), text_pane()
        self._button = button("Show its tests", self._go_to_tests, 140, visible=False)
        self._grid = self._table()
        self._place = stacked()
        asked = pn.FlexBox(self._fleet, self._type, self._which, self._text)
        self.view = stacked(self._said, asked, self._place, self._button, self._details)
        on_change(self._read, self._fleet)
        on_change(self._fill, self._type, self._which, self._text)

    def list_fleets(self) -> bool:
        """Bring the list of fleets up to date; return whether there is one."""
        self.fleets = fleets_under(self._root)
        names = {self._label(fleet): fleet for fleet in self.fleets}
        self._fleet.options = names
        if self._fleet.value not in self.fleets:
            self._fleet.value = self.fleets[0] if self.fleets else None
        self.look(at_once=True)
        return bool(self.fleets)

    def look(self, *, at_once: bool = False) -> None:
        """Show what has come since, where a fleet is being worked out; every few seconds only."""
        fleet = self._fleet.value
        if fleet is None or (not at_once and time.monotonic() - self._looked < LOOK_S):
            return
        self._looked = time.monotonic()
        if fleet.state != self._state:
            self._read()

    def _label(self, fleet: Fleet) -> str:
        where = fleet.path.relative_to(self._root).as_posix()
        return fleet.name() if where == "." else f"{fleet.name()} ({where})"

    def _read(self) -> None:
        fleet = self._fleet.value
        if fleet is None:
            return
        self._state = fleet.state
        try:
            self._rows, self._sisters = fleet.rows(), fleet.sisters()
        except ImportError:
            self._say_problem(message("warning", NO_PYARROW))
            return
        except Exception as error:  # a file of another version, or a damaged one
            self._say_problem(problem(fleet.path.name, error))
            return
        self._columns = columns(self._rows, self._sisters)
        kinds = list(dict.fromkeys(row["type"] for row in self._rows))
        chosen = self._type.value
        self._type.options = {EVERY: EVERY, **{kind or "(none)": kind for kind in kinds}}
        self._type.value = chosen if chosen in kinds else EVERY
        self._said.object = f"<p>{escape(headline(self._rows, self._sisters, fleet.is_whole))}</p>"
        self._grid = self._table()
        self._place[:] = [pn.pane.Bokeh(self._grid, sizing_mode=WIDE, stylesheets=[TABLE_CSS])]
        self._fill()

    def _say_problem(self, html: str) -> None:
        self._rows, self._columns = (), {}
        self._said.object, self._place[:] = html, []
        self._details.object, self._button.visible = "", False

    def _fill(self) -> None:
        kind, which, text = self._type.value, self._which.value, self._text.value.lower()
        data = self._columns
        is_asked = {
            ALL: lambda i: True,
            ODD: lambda i: data["verdict"][i] == "does not fit its type",
            FOUND: lambda i: data["warnings"][i] > 0,
            POOR: lambda i: data["verdict"][i] in ("refused", "failed", "not converged"),
        }[which]
        places = [
            i for i, row in enumerate(self._rows)
            if kind in (EVERY, row["type"]) and is_asked(i)
            and text in f"{row['machine']} {data['covariates'][i]}".lower()
        ]  # fmt: skip
        with in_order():
            self._source.selected.indices = []
            self._filter.indices = places
            self._grid.height = min(self._row_px * len(places) + ENDS_PX, TABLE_PX)
            self._choose()

    def _table(self) -> DataTable:
        self._source, self._filter = ColumnDataSource(data=self._columns), IndexFilter(indices=[])
        self._source.selected.on_change("indices", lambda attr, old, new: self._choose())
        names = [*parameters(self._rows).items()][:MOST_PARAMETERS]
        text, whole = StringFormatter(), NumberFormatter(format="0", text_align="right")
        number = HTMLTemplateFormatter(template=NUMBER_TEMPLATE)
        asked: list[tuple[str, str, Any, int]] = [
            ("machine", "Machine", text, 110), ("type", "Type", text, 60),
            ("covariates", "Covariates", text, 150), ("verdict", "Verdict", text, 150),
            ("strip", "Against its type", HTMLTemplateFormatter(template=STRIP_TEMPLATE),
             STRIP + 34),
            *((f"value_{place}", f"{name} [{printed_unit(unit)}]",
               HTMLTemplateFormatter(template=f"<%= text_{place} %>"), 200)
              for place, (name, unit) in enumerate(names)),
            ("rmse", "RMSE [K]", number, 80), ("warnings", "Warnings", whole, 80),
        ]  # fmt: skip
        if self._sisters:
            asked.insert(4, ("outlier", "P(outlier)", number, 90))
        self._row_px = max(ROW_PX, len(names) * LANE_PX + 6)
        return DataTable(
            source=self._source,
            view=CDSView(filter=self._filter),
            columns=[
                TableColumn(field=field, title=title, formatter=shape, width=width,
                            sortable=field != "strip")
                for field, title, shape, width in asked
            ],
            index_position=None,
            sizing_mode=WIDE,
            height=TABLE_PX,
            row_height=self._row_px,
            fit_columns=False,
            selectable=True,
            reorderable=False,  # it would take jQuery UI
        )  # fmt: skip

    def _choose(self) -> None:
        row = self._chosen()
        self._button.visible = row is not None and bool(files(row, "calibration"))
        if row is None:
            self._details.object = message("note", "Choose a machine in the table.")
            return
        try:
            self._details.object = details(row, self._sisters.get(row["machine"]))
        except Exception as error:  # a row of another hand
            self._details.object = problem(str(row["machine"]), error)

    def _chosen(self) -> Row | None:
        indices: Sequence[int] = self._source.selected.indices
        is_one = len(indices) > 0 and indices[0] < len(self._rows)
        return self._rows[indices[0]] if is_one else None

    def _go_to_tests(self) -> None:
        row, fleet = self._chosen(), self._fleet.value
        if row is None or fleet is None:
            return
        motors, tests, held = (
            [self._inside(fleet, path) for path in files(row, role)]
            for role in ("motor", "calibration", "holdout")
        )
        names = [name for name in (*tests, *held) if name]
        if not names:
            self._details.object = message(
                "warning",
                "Its tests lie outside the folder that is shown, or are no longer there. Start "
                "`heatrun view` on the folder that holds fleet and tests.",
            ) + str(self._details.object)
            return
        self._show_tests(names, next(iter(motors), None))

    def _inside(self, fleet: Fleet, path: str) -> str | None:
        """Return the name of a file of the fleet file under the folder that is shown."""
        for base in (fleet.path, *fleet.path.parents):
            try:
                found = (base / path).resolve()
                if found.is_file() and found.is_relative_to(self._root):
                    return found.relative_to(self._root).as_posix()
            except (OSError, ValueError, InputError):
                continue
            if base == self._root:
                break
        return None
