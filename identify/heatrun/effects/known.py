"""Effects of a problem that are known, and those that a search may leave out."""

from __future__ import annotations

from lptn.effects import AbstractEffect

from ..inference.problem import Problem


def known_effects_of(problem: Problem) -> tuple[type[AbstractEffect], ...]:
    """Return the effects of a problem that its base network has."""
    return _with_role(problem, "known")


def searched_effects_of(problem: Problem) -> tuple[type[AbstractEffect], ...]:
    """Return the effects of a problem that may be absent."""
    return _with_role(problem, "effect")


def _with_role(problem: Problem, role: str) -> tuple[type[AbstractEffect], ...]:
    first = problem.parameters.by_test[0]
    ids = {name.partition(".")[0] for name, p in first.items() if p.role == role}
    return tuple(kind for kind in problem.model.effects if kind.card.id in ids)
