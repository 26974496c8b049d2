"""A run's model and record for other programs: the MAT file of the thesis' Simulink model."""

from __future__ import annotations

from .course import Course, simulate_variables
from .mat import export_mat, mat_bytes
from .rerun import RunAndTest, read_run_test
from .variables import Corrections, thesis_variables

__all__ = [
    "Corrections",
    "Course",
    "RunAndTest",
    "export_mat",
    "mat_bytes",
    "read_run_test",
    "simulate_variables",
    "thesis_variables",
]
