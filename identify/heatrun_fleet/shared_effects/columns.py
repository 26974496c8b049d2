"""The evidence on effects as columns of a machine's row, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from ..arrow_schema import LIST, Column
from .pooled import Evidence

COLUMNS: tuple[Column, ...] = (
    ("effect_parameters", "list of text", "", "with --discover: free parameters that effects are "
     "told from, tests by number in brackets"),
    ("effects", "list of text", "", "likewise: effects that the tests could show, each with a "
     "setting of its shape"),
    ("effect_scale", LIST, "", "amplitude of each effect at a score of 1, in its own unit"),
    ("effect_score", LIST, "1", "derivative of the log likelihood by the scores of "
     "effect_parameters, then of effects"),
    ("effect_information", LIST, "1", "its precision: upper triangle, row by row"),
    ("effect_visible_K", LIST, "K", "what each effect leaves of a refitted network at "
     "a score of 1, root mean square"),
)  # fmt: skip
"""Name, kind, unit and meaning of each column, in order."""


def effect_columns(evidence: Evidence) -> dict[str, Any]:
    """Return the columns of a machine's row.

    Args:
        evidence: On effects.
    """
    return {
        "effect_parameters": list(evidence.parameters),
        "effects": list(evidence.effects),
        "effect_scale": evidence.scale.tolist(),
        "effect_score": evidence.score.tolist(),
        "effect_information": packed(evidence.information),
        "effect_visible_K": evidence.visible_K.tolist(),
    }


def evidence_in(row: Mapping[str, Any]) -> Evidence | None:
    """Return the evidence on effects that a row holds, None where it holds none.

    Args:
        row: Of a machine, with the columns of `COLUMNS`.
    """
    if not row["effects"]:
        return None
    score = np.asarray(row["effect_score"], dtype=float)
    return Evidence(
        parameters=tuple(row["effect_parameters"]),
        effects=tuple(row["effects"]),
        scale=np.asarray(row["effect_scale"], dtype=float),
        score=score,
        information=unpacked(row["effect_information"], score.size),
        visible_K=np.asarray(row["effect_visible_K"], dtype=float),
    )


def packed(matrix: Float[np.ndarray, "all all"]) -> list[float]:
    """Return the upper triangle of a symmetric matrix, row by row."""
    return matrix[np.triu_indices(matrix.shape[0])].tolist()


def unpacked(numbers: Any, size: int) -> Float[np.ndarray, "all all"]:
    """Return the symmetric matrix of an upper triangle; the inverse of `packed`."""
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = numbers
    return matrix + np.triu(matrix, 1).T
