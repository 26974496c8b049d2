"""heatrun identifies the thermal network of an electric motor from bench transients.

    import heatrun
    run = heatrun.calibrate("motor.toml", ["duty.csv"], holdout=["step.csv"])
    run.summary()
    run.plot()
    run.predict("other.csv")
    found = heatrun.discover(run)
    found.run.simulate("other.csv")
    heatrun.open_run("results/runs/demo")
    heatrun.winding_at_switch_off("motor.toml", "resistances.csv", run="run").winding_degC

Importing this package switches JAX to float64, which the thermal models need (a thousandth of
a kelvin over an hour does not survive float32), and sets the one XLA option that makes small
loops compile whole. Both happen before JAX is first used, in `heatrun.runtime`. Everything else is
loaded when it is first asked for.
"""

from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

from . import runtime as runtime
from .version import __version__ as __version__

if TYPE_CHECKING:
    from .api import Found, calibrate, check, compare, discover, simulate
    from .errors import InputError
    from .motor.file import load_motor
    from .runs.before_after import compare_runs
    from .runs.run import Run, open_run
    from .shutdown import winding_at_switch_off

__all__ = [
    "Found",
    "InputError",
    "Run",
    "calibrate",
    "check",
    "compare",
    "compare_runs",
    "discover",
    "load_motor",
    "open_run",
    "simulate",
    "winding_at_switch_off",
]

_PLACES = {
    "InputError": ".errors",
    "load_motor": ".motor.file",
    "Run": ".runs.run",
    "open_run": ".runs.run",
    "compare_runs": ".runs.before_after",
    "winding_at_switch_off": ".shutdown",
}


@cache
def _added() -> dict[str, EntryPoint]:
    """Return the names that other packages add, by their entry points `heatrun.names`."""
    return {entry.name: entry for entry in entry_points(group="heatrun.names")}


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module(_PLACES.get(name, ".api"), __name__), name)
    if not name.startswith("_") and name in _added():
        return _added()[name].load()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, *_added(), "__version__"]
