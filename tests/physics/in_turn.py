"""Every case on some of the machines by default, on all of them with the slow tests."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest
from bench_machines import Machine


def in_turn(cases: Iterable[Any], machines: Sequence[Machine], *, num: int = 2) -> list[Any]:
    """Return parameters (case, machine): each case on the next `num` machines, the rest slow.

    Args:
        cases: A value each, or a tuple of values.
        machines: Each has its turn as often as the others.
        num: Machines for a case.
    """
    found = []
    for place, case in enumerate(cases):
        values = case if isinstance(case, tuple) else (case,)
        turns = {(place * num + turn) % len(machines) for turn in range(num)}
        for index, machine in enumerate(machines):
            marks = () if index in turns else (pytest.mark.slow,)
            name = values[0] if isinstance(values[0], str) else f"case{place}"
            found.append(pytest.param(*values, machine, marks=marks, id=f"{name}-{machine.name}"))
    return found
