"""Files that are dropped on the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panel as pn

from heatrun.errors import InputError, of_file

from ..pane import text_pane
from ..uploads import BoundedDropper, UploadRoom, keep_upload
from ..words import error_message


class Sending:
    """Where files are dropped.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, room: UploadRoom, arrived: Callable[[], None]) -> None:
        """Take where files are kept, and whom to tell of new ones."""
        self._room, self._arrived = room, arrived
        self._dropper = BoundedDropper(room, self._refuse, height=90, sizing_mode="stretch_width")
        self._problem = text_pane()
        self.view = pn.Column(
            text_pane("<h3>Other files</h3>"), self._dropper, self._problem,
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._dropper.param.watch(self._keep, "value")

    def close(self) -> None:
        """Give back the room of what has not arrived."""
        self._dropper.close()

    def _keep(self, _: Any) -> None:
        problems = ""
        for name, content in self._dropper.arrived().items():
            try:
                keep_upload(self._room.folder, name, content)
            except InputError as error:
                problems += error_message(error)
            except OSError as error:
                problems += error_message(of_file(error))
        self._problem.object = problems
        self._arrived()

    def _refuse(self, error: InputError) -> None:
        self._problem.object = error_message(error)
