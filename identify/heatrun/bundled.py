"""Where the bundled data lie: inside the installed package, or in the checkout beside it."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError


def bundled(name: str) -> Path:
    """Return the folder of a bundled data set.

    Args:
        name: Such as `"synthetic"`.

    Raises:
        InputError: If this installation has none.
    """
    here = Path(__file__).resolve()
    for folder in (here.parent / "data" / name, here.parents[2] / "data" / name):
        if folder.is_dir():
            return folder
    raise InputError(
        f"the bundled data set {name!r} is not part of this installation.",
        remedy="Install heatrun from its wheel or run it in a checkout.",
    )
