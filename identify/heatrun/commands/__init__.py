"""The commands, one per file: its words (`add_parser`) and what it does (`run`).

A command loads, calls, writes and prints; it computes nothing itself. Its file imports what is
slow to import inside `run`, so that `heatrun --help` answers at once.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.metadata import entry_points
from types import ModuleType

COMMANDS = (
    "init", "check", "calibrate", "compare", "discover", "simulate", "sheet", "export",
    "shutdown", "demo",
)  # fmt: skip
"""Names of the commands that are modules of this package."""

GROUP = "heatrun.commands"
"""Entry points of this group are commands that other packages add: modules like those here."""

ORDER = (
    "init", "check", "calibrate", "compare", "discover", "simulate", "report", "sheet", "export",
    "shutdown", "fleet", "population", "view", "demo",
)  # fmt: skip
"""Of the help, which has any further ones at its end."""


def all_commands() -> dict[str, Callable[[], ModuleType]]:
    """Return what loads each command, by its name, in the order of the help."""
    found: dict[str, Callable[[], ModuleType]] = {
        entry.name: entry.load for entry in entry_points(group=GROUP)
    }
    found |= {name: partial(import_module, f".{name}", __name__) for name in COMMANDS}
    names = sorted(found, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER))
    return {name: found[name] for name in names}
