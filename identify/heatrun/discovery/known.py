"""Effects that are known: a search takes them as part of its base network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lptn.effects import AbstractEffect

from ..inference.parameters import collect
from ..inference.problem import Problem


def with_known(problem: Problem, known: Sequence[type[AbstractEffect]]) -> Problem:
    """Return a problem in which the parameters of known effects belong to the base network."""
    if not known:
        return problem
    heads = tuple(f"{kind.card.id}." for kind in known)
    by_test = [
        {
            name: replace(parameter, role="known") if name.startswith(heads) else parameter
            for name, parameter in parameters.items()
        }
        for parameters in problem.parameters.by_test
    ]
    return replace(problem, parameters=collect(problem.parameters.tests, by_test))


def known_effects_of(problem: Problem) -> tuple[type[AbstractEffect], ...]:
    """Return the effects of a problem that its base network has."""
    first = problem.parameters.by_test[0]
    known = {name.partition(".")[0] for name, p in first.items() if p.role == "known"}
    return tuple(kind for kind in problem.model.effects if kind.card.id in known)
