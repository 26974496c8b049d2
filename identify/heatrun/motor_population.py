"""`[population]` of a motor file: what its sisters say of a machine before its first test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .fleet.population.files import NextMachine, read_next_machine
from .io.toml_values import text_of


def next_of_population(section: Mapping[str, Any], where: str) -> NextMachine:
    """Return what is known of a machine of a known type; nothing where no type is given.

    Each parameter has its own: correlations over the machines are left aside, and covariates are at
    their mean over the machines.

    Args:
        section: `[population]`.
        where: The motor file; a folder is sought from where it is.

    Raises:
        InputError: If there is no population where it says.
    """
    if not section:
        return NextMachine({})
    at = f"{where}, [population]"
    folder = Path(where).parent / text_of(section, "run", at)
    return read_next_machine(folder, at)
