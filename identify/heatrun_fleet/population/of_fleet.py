"""The machines of a type, from the rows that `heatrun fleet` wrote or from runs of calibrations."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from heatrun.errors import InputError, did_you_mean
from heatrun.model.noise import noise_parameters
from heatrun.model.parameters import Parameter
from heatrun.model.problem import NUM_NOISE
from heatrun.runs.run import Run

from ..job import MACHINES, MANIFEST, FleetResult
from ..rows import FITTED, THERMAL, arrow, read_part
from .gathered import FEWEST, Gathered, LeftOut, is_positive

Row = Mapping[str, Any]

COLUMNS = (
    "machine", "type", "covariates", "status", "findings", "model", "is_converged", "result",
    "parameters", "parameter_units", "transforms", "log_mean", "log_covariance", "prior_mean",
    "prior_sd", "noise", "noise_units", "noise_log_mean", "noise_log_covariance",
    "noise_prior_mean", "noise_prior_sd",
)  # fmt: skip
"""What a population is made of."""

LONGEST_REASON = 300
"""Letters of a reason; all of it stands in the fleet's rows."""


@dataclass(frozen=True)
class FleetRows:
    """The rows of a fleet.

    Attributes:
        path: The file.
        name: Of the fleet; empty if it is not known.
        rows: With the columns of `COLUMNS`.
        sha256: Of the file.
    """

    path: Path
    name: str
    rows: tuple[Row, ...]
    sha256: str

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

    Args:
        source: Its folder, `machines.parquet`, or what `heatrun.calibrate_fleet` returns.

    Raises:
        InputError: If there is no such file, or it is none that heatrun wrote.
    """
    arrow()
    path = source.path if isinstance(source, FleetResult) else Path(source)
    path = path / MACHINES if path.is_dir() else path
    remedy = "Give the folder that `heatrun fleet` wrote."
    try:
        table = read_part(path)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except FileNotFoundError:
        raise InputError(f"Found no {path}.", remedy=remedy) from None
    except (OSError, ValueError) as error:  # pyarrow's errors are kinds of these
        raise InputError(
            f"Expected the rows of a fleet, they could not be read ({error}).",
            where=str(path),
            remedy=remedy,
        ) from None
    rows = table.select(list(COLUMNS)).to_pylist()
    return FleetRows(path, _fleet_name(path.parent), tuple(rows), digest)


def gathered_of_fleet(fleet: FleetRows, type: str) -> Gathered:
    """Return the machines of a type, with those that cannot count left out and named.

    Args:
        fleet: The rows.
        type: One of `fleet.types`.

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
    form = Counter(_form(row) for row in usable).most_common(1)
    names, units, transforms, model = form[0][0] if form else ((), (), (), "")
    for row in usable:
        if _form(row) != (names, units, transforms, model):
            reasons[row["machine"]] = _of_other_form(row, names, model)
    used = [row for row in usable if not reasons[row["machine"]]]
    size = len(names)
    columns = dict.fromkeys(name for row in own for name, _ in row["covariates"] or ())
    said = [dict(row["covariates"] or ()) for row in used]
    return Gathered(
        tuple(row["machine"] for row in used),
        names,
        units,
        transforms,
        _stacked(used, "log_mean", (size,)),
        _stacked(used, "log_covariance", (size, size)),
        _stacked(used, "prior_mean", (size,)),
        _stacked(used, "prior_sd", (size,)),
        {name: tuple(each.get(name, "") for each in said) for name in columns},
        tuple(
            LeftOut(row["machine"], reasons[row["machine"]]) for row in own
            if reasons[row["machine"]]
        ),
        {"fleet": fleet.name, "network": model, MACHINES: fleet.sha256},
        _noise_of(used),
    )  # fmt: skip


def _noise_of(rows: Sequence[Row]) -> Gathered | None:
    """Return noise and unmodelled heat of the machines; a machine may lack a sound posterior."""
    names = next((tuple(row["noise"]) for row in rows if row["noise"]), ())
    size = len(names)
    if not size:
        return None
    used = [
        row for row in rows
        if tuple(row["noise"]) == names
        and is_positive(np.array(row["noise_log_covariance"], dtype=float), size)
    ]  # fmt: skip
    if not used:
        return None
    return Gathered(
        tuple(row["machine"] for row in used),
        names,
        tuple(used[0]["noise_units"]),
        ("log",) * size,
        _stacked(used, "noise_log_mean", (size,)),
        _stacked(used, "noise_log_covariance", (size, size)),
        _stacked(used, "noise_prior_mean", (size,)),
        _stacked(used, "noise_prior_sd", (size,)),
    )


def _form(row: Row) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...], str]:
    texts = (tuple(row[name]) for name in ("parameters", "parameter_units", "transforms"))
    return (*texts, row["model"])  # type: ignore[return-value]


def _unusable(row: Row) -> str:
    """Return why a machine cannot count; empty if it can."""
    if row["status"] != FITTED:
        return f"{row['status']}: {_first_error(row) or row['result']}"[:LONGEST_REASON]
    if not row["is_converged"]:
        return f"not converged: {row['result']}"[:LONGEST_REASON]
    if not row["parameters"]:
        return "no thermal parameter is free"
    size = len(row["parameters"])
    covariance = np.array(row["log_covariance"])
    if covariance.size != size**2 or not np.all(np.isfinite(covariance)):
        return "no covariance"
    return "" if is_positive(covariance, size) else "its covariance is not positive definite"


def _first_error(row: Row) -> str:
    findings = json.loads(row["findings"] or "[]")
    return next((each["message"] for each in findings if each["severity"] == "error"), "")


def _of_other_form(row: Row, names: Sequence[str], model: str) -> str:
    if row["model"] != model:
        return f"fitted with another network ({row['model']}, most with {model})"
    more = [name for name in row["parameters"] if name not in names]
    less = [name for name in names if name not in row["parameters"]]
    parts = [f"has {', '.join(more)}" if more else "", f"lacks {', '.join(less)}" if less else ""]
    said = " and ".join(part for part in parts if part) or "others in unit or order"
    return f"other parameters than most: {said}"


def _stacked(rows: Sequence[Row], name: str, shape: tuple[int, ...]) -> np.ndarray:
    return np.array([row[name] for row in rows], dtype=float).reshape(len(rows), *shape)


def _fleet_name(folder: Path) -> str:
    try:
        return str(json.loads((folder / MANIFEST).read_bytes())["fleet"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


Normal = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


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
    kinds = []
    rows, noises = [], []
    of_noise: tuple[Parameter, ...] = ()
    for run in runs:
        draws = run.draws(network)
        found = {
            place: slot.parameter
            for place, slot in enumerate(draws.parameters.slots)
            if slot.parameter.role in THERMAL and slot.test is None
        }
        own = tuple(parameter.name for parameter in found.values())
        if kinds and own != tuple(parameter.name for parameter in kinds):
            raise InputError(
                f"Expected free parameters {', '.join(p.name for p in kinds)} as in "
                f"{runs[0].path}, got {', '.join(own)}.",
                where=str(run.path),
                remedy="Calibrate all machines with one network, and fix none of its parameters.",
            )
        kinds = list(found.values())
        rows.append(_normal(kinds, draws.vectors[:, list(found)]))
        of_noise = noise_parameters(draws.model.adequacy)
        noises.append(_normal(of_noise, draws.vectors[:, -NUM_NOISE:]))
    names = [run.path.name for run in runs]
    if len(set(names)) < len(names):
        names = [str(run.path) for run in runs]
    is_told = [is_positive(covariance, NUM_NOISE) for _, covariance, _, _ in noises]
    own = [name for name, told in zip(names, is_told, strict=True) if told]
    noises = [noise for noise, told in zip(noises, is_told, strict=True) if told]
    return replace(
        _gathered(names, kinds, rows),
        source={"network": runs[0].choose(network)},
        noise=_gathered(own, of_noise, noises) if own else None,
    )


def _normal(kinds: Sequence[Parameter], scores: np.ndarray) -> Normal:
    """Return mean and covariance of draws, then centre and width of the prior, all in the space of
    the transforms.
    """
    scale = np.array([parameter.sd for parameter in kinds])
    centre = np.array([np.log(p.centre) if p.transform == "log" else p.centre for p in kinds])
    values = centre + scale * scores
    return values.mean(axis=0), np.cov(values.T), centre, scale


def _gathered(names: Sequence[str], kinds: Sequence[Parameter], rows: Sequence[Normal]) -> Gathered:
    mean, covariance, prior_mean, prior_sd = map(np.stack, zip(*rows, strict=True))
    return Gathered(
        tuple(names),
        tuple(parameter.name for parameter in kinds),
        tuple(parameter.unit for parameter in kinds),
        tuple(parameter.transform for parameter in kinds),
        mean,
        covariance,
        prior_mean,
        prior_sd,
    )
