"""A motor bench in plain NumPy: an independent source of records with a known truth.

It shares no code with the packages it is used to test. `simulate` gives the true temperatures of
a machine on a load profile, `measure` what the bench's instruments would have written down.
"""

from __future__ import annotations

from .instruments import Instruments, measure
from .machine import Machine, random_motor, reference_motor
from .profile import Profile, Segment, constant_load, drive_cycle, duty, staircase
from .thermal import Room, Truth, simulate

__all__ = [
    "Machine",
    "reference_motor",
    "random_motor",
    "Segment",
    "Profile",
    "constant_load",
    "staircase",
    "duty",
    "drive_cycle",
    "Room",
    "Truth",
    "simulate",
    "Instruments",
    "measure",
]
