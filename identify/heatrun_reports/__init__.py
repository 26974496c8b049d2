"""The bench's everyday reports by test type, and the comparison of several prototypes.

Everything is loaded when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import heatrun as heatrun  # settings of JAX before its first use

if TYPE_CHECKING:
    from .general import energy_report as energy_report
    from .general import general_report as general_report
    from .job import Outcome as Outcome
    from .job import build_report as build_report
    from .job import make_report as make_report
    from .prototypes_report import make_prototypes_report as make_prototypes_report
    from .report import CARDS as CARDS
    from .report import TEST_TYPES as TEST_TYPES
    from .report import BenchTestType as BenchTestType
    from .report import Kind as Kind
    from .report import Report as Report
    from .simulated import Reference as Reference
    from .simulated import read_reference as read_reference
    from .thermal import thermal_report as thermal_report
    from .validation_report import validation_report as validation_report

_PLACES = {
    "build_report": ".job",
    "CARDS": ".report",
    "TEST_TYPES": ".report",
    "BenchTestType": ".report",
    "Kind": ".report",
    "energy_report": ".general",
    "general_report": ".general",
    "Outcome": ".job",
    "make_report": ".job",
    "make_prototypes_report": ".prototypes_report",
    "Reference": ".simulated",
    "read_reference": ".simulated",
    "Report": ".report",
    "thermal_report": ".thermal",
    "validation_report": ".validation_report",
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name], __name__), name)
