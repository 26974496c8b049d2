"""The bench's everyday reports by test type: general, thermal, energy, virtual, real."""

from .compare_signals import SignalComparison as SignalComparison
from .compare_signals import compare_signals as compare_signals
from .energy import GeneralInformation as GeneralInformation
from .energy import general_information as general_information
from .job import ReportJob as ReportJob
from .job import run_reports as run_reports
from .offset import Offset as Offset
from .offset import find_offset as find_offset
from .pair import Pair as Pair
from .pair import pair_records as pair_records
