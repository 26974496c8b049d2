"""What a tab asks of the page that it stands on: the choices on the left, and its style."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import panel as pn

from heatrun_reports import Kind

from ..runs import Run


class Choices(Protocol):
    """A page, as its tabs see it.

    Attributes:
        out: Folder of the runs.
    """

    out: Path

    @property
    def kind(self) -> Kind:
        """The test type that is chosen."""
        ...

    @property
    def motor_path(self) -> Path | None:
        """The motor file that is chosen, or None."""
        ...

    @property
    def tests(self) -> list[str]:
        """Names of the tests in folder and uploads."""
        ...

    @property
    def simulated(self) -> list[str]:
        """Names of the virtual records there."""
        ...

    @property
    def chosen(self) -> list[str]:
        """Names of the tests and virtual records that are chosen."""
        ...

    @property
    def run(self) -> Run | None:
        """The run whose simulated course is shown."""
        ...

    def path(self, name: str) -> Path:
        """Return the file of a name in the lists.

        Raises:
            InputError: If there is none inside the folders that may be read.
        """
        ...

    def pane(self, html: str) -> pn.pane.HTML:
        """Return a pane of text in the page's style."""
        ...

    def list_runs(self, choose: Path | None = None) -> None:
        """Bring the list of runs up to date; as `heatrun_view.tabs.page.Page.list_runs`."""
        ...
