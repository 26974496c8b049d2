"""The machines of a type, from the rows that `heatrun fleet` wrote or from runs of calibrations."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from heatrun.errors import InputError, did_you_mean
from heatrun.io.open_file import digest
from heatrun.model.noise import noise_parameters
from heatrun.model.parameters import Parameter
from heatrun.model.problem import NUM_NOISE
from heatrun.runs.run import Run

from ..job import MACHINES, MANIFEST, FleetResult
from ..results import MachineLeftOut
from ..rows import FITTED, OF_EFFECTS, THERMAL, arrow, read_part
from .gathered import FEWEST, Gathered, is_positive

Row = Mapping[str, Any]
Texts = tuple[str, ...]

LONGEST_REASON = 300
"""Letters of a reason; all of it stands in the fleet's rows."""


@dataclass(frozen=True)
class FleetRows:
    """The rows of a fleet."""

    path: Path  # The file.
    name: str  # Of the fleet; empty if it is not known.
    rows: tuple[Row, ...]  # Without what they say of effects.
    sha256: str  # Of the file.

    @property
    def types(self) -> dict[str, int]:
        """Number of machines by type, in the order of the rows."""
        return dict(Counter(row["type"] for row in self.rows))


def is_fleet(source: object) -> bool:
    """Whether something is the result of a fleet: its folder, its file, or as Python has it."""
    if isinstance(source, FleetResult):
        return True
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    return path.suffix == ".parquet" or (path / MACHINES).exists()


def read_fleet(source: FleetResult | str | Path) -> FleetRows:
    """Return the rows of a fleet.

    Raises:
        InputError: If there is no such file, or it is none that heatrun wrote.
    """
    arrow()
    of_effects = [name for name, _, _, _ in OF_EFFECTS]
    path = source.path if isinstance(source, FleetResult) else Path(source)
    path = path / MACHINES if path.is_dir() else path
    remedy = "Give the folder that `heatrun fleet` wrote."
    try:
        table = read_part(path)
        sha256 = digest(path)
    except FileNotFoundError:
        raise InputError(f"Found no {path}.", remedy=remedy) from None
    except (OSError, ValueError) as error:  # pyarrow's errors are kinds of these
        raise InputError(
            f"Expected the rows of a fleet, they could not be read ({error}).",
            where=str(path),
            remedy=remedy,
        ) from None
    try:
        name = str(json.loads((path.parent / MANIFEST).read_bytes())["fleet"])
    except (OSError, ValueError, KeyError, TypeError):
        name = ""
    return FleetRows(path, name, tuple(table.drop_columns(of_effects).to_pylist()), sha256)


def gathered_of_fleet(fleet: FleetRows, type: str) -> Gathered:
    """Return the machines of a type, with those that cannot count left out and named.

    Raises:
        InputError: If there is no such type.
    """
    own = [row for row in fleet.rows if row["type"] == type]
    if not own:
        named = ", ".join(f"{each!r}" for each in fleet.types if each) or "none is named"
        raise InputError(
            f"Found no machine of type {type!r}; there are {named}.",
            where=str(fleet.path),
            remedy=did_you_mean(type, fleet.types) or "Give one of these types.",
        )
    reasons = {row["machine"]: _unusable(row) for row in own}
    usable = [row for row in own if not reasons[row["machine"]]]
    (form, _), *_ = Counter(map(_form, usable)).most_common(1) or [(((), (), (), ""), 0)]
    for row in usable:
        if _form(row) != form:
            reasons[row["machine"]] = _of_other_form(row, form)
    used = [row for row in usable if not reasons[row["machine"]]]
    said = [dict(row["covariates"] or ()) for row in used]
    columns = dict.fromkeys(name for row in own for name, _ in row["covariates"] or ())
    return replace(
        _gathered(used, *form[:3]),
        columns={name: tuple(each.get(name, "") for each in said) for name in columns},
        left_out=tuple(MachineLeftOut(name=n, reason=why) for n, why in reasons.items() if why),
        source={"fleet": fleet.name, "network": form[3], MACHINES: fleet.sha256},
    )


def _gathered(
    rows: Sequence[Row], names: Texts, units: Texts, transforms: Texts, prefix: str = ""
) -> Gathered:
    """Return the laws of machines with their noise; those whose noise has no sound posterior count
    for their parameters all the same.
    """
    size = len(names)

    def stacked(name: str, *shape: int) -> np.ndarray:
        return np.array([row[prefix + name] for row in rows], dtype=float).reshape(
            len(rows), *shape
        )

    found = Gathered(
        tuple(row["machine"] for row in rows), names, units, transforms,
        stacked("log_mean", size), stacked("log_covariance", size, size),
        stacked("prior_mean", size), stacked("prior_sd", size),
    )  # fmt: skip
    noise = next((tuple(row["noise"]) for row in rows if row["noise"]), ())
    sound = [
        row for row in rows if noise and not prefix and tuple(row["noise"]) == noise
        and is_positive(np.array(row["noise_log_covariance"], dtype=float), len(noise))
    ]  # fmt: skip
    if not sound:
        return found
    of_noise = tuple(sound[0]["noise_units"]), ("log",) * len(noise)
    return replace(found, noise=_gathered(sound, noise, *of_noise, "noise_"))


def _form(row: Row) -> tuple[Texts, Texts, Texts, str]:
    names, units, transforms = (
        tuple(row[name]) for name in ("parameters", "parameter_units", "transforms")
    )
    return names, units, transforms, row["model"]


def _unusable(row: Row) -> str:
    """Return why a machine cannot count; empty if it can."""
    if row["status"] != FITTED:
        findings = json.loads(row["findings"] or "[]")
        errors = [each["message"] for each in findings if each["severity"] == "error"]
        return f"{row['status']}: {(*errors, row['result'])[0]}"[:LONGEST_REASON]
    if not row["is_converged"]:
        return f"not converged: {row['result']}"[:LONGEST_REASON]
    if not row["parameters"]:
        return "no thermal parameter is free"
    size = len(row["parameters"])
    covariance = np.array(row["log_covariance"])
    if covariance.size != size**2 or not np.all(np.isfinite(covariance)):
        return "no covariance"
    return "" if is_positive(covariance, size) else "its covariance is not positive definite"


def _of_other_form(row: Row, form: tuple[Texts, Texts, Texts, str]) -> str:
    names, *_, model = form
    if row["model"] != model:
        return f"fitted with another network ({row['model']}, most with {model})"
    more = [name for name in row["parameters"] if name not in names]
    less = [name for name in names if name not in row["parameters"]]
    parts = [f"has {', '.join(more)}" if more else "", f"lacks {', '.join(less)}" if less else ""]
    said = " and ".join(part for part in parts if part) or "others in unit or order"
    return f"other parameters than most: {said}"


def gathered_of_runs(runs: Sequence[Run], network: str | None = None) -> Gathered:
    """Return the posterior of each machine's thermal parameters, and of its noise.

    Args:
        runs: One for each machine, all with one network.
        network: Name of the network, where a run has several; by default the one that its sheet is
            of.

    Raises:
        InputError: If there are too few runs, or one was fitted with another network, a fixed
            parameter, or an effect that others do not have.
    """
    if len(runs) < FEWEST:
        raise InputError(
            f"Expected the runs of {FEWEST} machines or more, got {len(runs)}.",
            remedy="Calibrate more machines of the type; a spread cannot be told from fewer.",
        )
    rows = [_row_of_run(run, network) for run in runs]
    for run, row in zip(runs, rows, strict=True):
        if row["parameters"] != rows[0]["parameters"]:
            raise InputError(
                f"Expected free parameters {', '.join(rows[0]['parameters'])} as in "
                f"{runs[0].path}, got {', '.join(row['parameters'])}.",
                where=str(run.path),
                remedy="Calibrate all machines with one network, and fix none of its parameters.",
            )
    if len({row["machine"] for row in rows}) < len(rows):
        rows = [{**row, "machine": str(run.path)} for run, row in zip(runs, rows, strict=True)]
    form = _form(rows[0])
    return replace(_gathered(rows, *form[:3]), source={"network": form[3]})


def _row_of_run(run: Run, network: str | None) -> dict[str, Any]:
    """Return what a row of a fleet says of a machine, from the draws of its run."""
    draws = run.draws(network)
    found = {
        place: slot.parameter for place, slot in enumerate(draws.parameters.slots)
        if slot.parameter.role in THERMAL and slot.test is None
    }  # fmt: skip
    kinds = list(found.values())
    noise = noise_parameters(draws.model.adequacy)
    return {
        "machine": run.path.name,
        "model": run.choose(network),
        "parameters": [each.name for each in kinds],
        "parameter_units": [each.unit for each in kinds],
        "transforms": [each.transform for each in kinds],
        **_law(kinds, draws.vectors[:, list(found)]),
        "noise": [each.name for each in noise],
        "noise_units": [each.unit for each in noise],
        **_law(noise, draws.vectors[:, -NUM_NOISE:], "noise_"),
    }


def _law(kinds: Sequence[Parameter], scores: np.ndarray, prefix: str = "") -> dict[str, Any]:
    """Return posterior and prior by draws, in the space of the transforms."""
    scale = np.array([parameter.sd for parameter in kinds])
    centre = np.array([np.log(p.centre) if p.transform == "log" else p.centre for p in kinds])
    values = centre + scale * scores
    law = {"log_mean": values.mean(axis=0), "log_covariance": np.cov(values.T),
           "prior_mean": centre, "prior_sd": scale}  # fmt: skip
    return {prefix + name: numbers for name, numbers in law.items()}
