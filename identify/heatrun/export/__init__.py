"""A run's model for other programs: Simulink, MATLAB, Octave; C; FMI; Modelica; drives; MuJoCo."""

from .drive import export_drive
from .mat import export_mat, export_test, mat_bytes
from .network_course import NetworkCourse, simulate_network, simulate_variables
from .network_file import network_variables
from .ratings import export_ratings
from .rerun import RunAndTest, read_new_test, read_run_test
from .simpler import export_mujoco
from .sources import export_source
from .variables import Corrections, thesis_variables

__all__ = [
    "Corrections",
    "NetworkCourse",
    "RunAndTest",
    "export_drive",
    "export_mat",
    "export_mujoco",
    "export_ratings",
    "export_source",
    "export_test",
    "mat_bytes",
    "network_variables",
    "read_new_test",
    "read_run_test",
    "simulate_network",
    "simulate_variables",
    "thesis_variables",
]
