"""The bench's everyday reports by test type, and the comparison of several prototypes.

Everything is loaded when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import heatrun as heatrun  # settings of JAX before its first use

if TYPE_CHECKING:
    from .job import Outcome as Outcome
    from .job import build_report as build_report
    from .job import make_prototypes_report as make_prototypes_report
    from .job import make_report as make_report
    from .report import CARDS as CARDS
    from .report import TEST_TYPES as TEST_TYPES
    from .report import Kind as Kind
    from .report import Report as Report
    from .simulated import Reference as Reference
    from .simulated import read_reference as read_reference

_PLACES = {
    ".job": ("Outcome", "build_report", "make_prototypes_report", "make_report"),
    ".report": ("CARDS", "TEST_TYPES", "Kind", "Report"),
    ".simulated": ("Reference", "read_reference"),
}


def __getattr__(name: str) -> Any:
    for place, names in _PLACES.items():
        if name in names:
            return getattr(import_module(place, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
