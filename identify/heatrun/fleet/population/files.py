"""`population.json`: what a population leaves for data sheets and for the next machine."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...io.whole_files import write_whole

NAME = "population.json"


def write_population(path: Path, content: Mapping[str, Any]) -> None:
    """Write a population into a file, whole or not at all.

    Args:
        path: The file.
        content: As `heatrun.fleet.population.report.content`.
    """
    write_whole(path, (json.dumps(content, indent=1) + "\n").encode())


def read_next_machine(folder: Path, where: str) -> dict[str, tuple[float, float]]:
    """Return what a population says of its next machine before its first test.

    Args:
        folder: Of the population, or its file.
        where: What asked for it, for messages.

    Returns:
        By parameter: median [its unit] and standard deviation of the logarithm [1].

    Raises:
        InputError: If there is no such file, or it is not one that heatrun wrote.
    """
    path = folder / NAME if folder.is_dir() else folder
    remedy = "Give the folder that `heatrun.population` wrote."
    try:
        content = json.loads(path.read_bytes())
        found = {
            name: (float(said["next_median"]), float(said["next_log_sd"]))
            for name, said in content["parameters"].items()
        }
    except OSError as error:
        raise InputError(
            f"Expected a population, found no readable {path} ({error.strerror}).",
            where=where,
            remedy=remedy,
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"Expected a population as heatrun writes it, got another content in {path}.",
            where=where,
            remedy=remedy,
        ) from None
    if not found or not all(
        math.isfinite(m) and m > 0.0 and math.isfinite(s) and s > 0.0 for m, s in found.values()
    ):
        raise InputError(
            f"Expected positive medians and widths of the parameters in {path}.",
            where=where,
            remedy=remedy,
        )
    return found
