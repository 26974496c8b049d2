"""Bench records with a hidden cause, for measuring how well discovery works.

Plain NumPy; shares no code with the packages that it is used to test. Forms of the laws, method
of integration and imperfections differ from theirs on purpose.
"""

from __future__ import annotations

from .cases import EFFECT_IDS, UNKNOWN_IDS, Case, Recording, make_case

__all__ = ["EFFECT_IDS", "UNKNOWN_IDS", "Case", "Recording", "make_case"]
