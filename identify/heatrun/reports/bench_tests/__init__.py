"""The bench's everyday reports by test type, and the comparison of several prototypes."""

from .build import build_report as build_report
from .card import CARDS as CARDS
from .card import TEST_TYPES as TEST_TYPES
from .card import BenchTestType as BenchTestType
from .card import Kind as Kind
from .energy import energy_report as energy_report
from .general import general_report as general_report
from .job import Outcome as Outcome
from .job import make_report as make_report
from .prototypes.job import make_prototypes_report as make_prototypes_report
from .reference import Reference as Reference
from .reference import read_reference as read_reference
from .report import Report as Report
from .thermal import thermal_report as thermal_report
from .validation_report import validation_report as validation_report
