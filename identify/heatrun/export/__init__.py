"""A run's model for other programs: Simulink, MATLAB, Octave; C; FMI; Modelica; drives; MuJoCo."""

from __future__ import annotations

from .c_file import export_c
from .contents import mat_bytes
from .course import Course, simulate_variables
from .drive import export_drive
from .fmu import export_fmu
from .mat import export_mat, export_test
from .modelica import export_modelica
from .mujoco import export_mujoco
from .network_course import NetworkCourse, simulate_network
from .network_file import network_variables
from .rerun import RunAndTest, read_new_test, read_run_test
from .variables import Corrections, thesis_variables

__all__ = [
    "Corrections",
    "Course",
    "NetworkCourse",
    "RunAndTest",
    "export_c",
    "export_drive",
    "export_fmu",
    "export_mat",
    "export_modelica",
    "export_mujoco",
    "export_test",
    "mat_bytes",
    "network_variables",
    "read_new_test",
    "read_run_test",
    "simulate_network",
    "simulate_variables",
    "thesis_variables",
]
