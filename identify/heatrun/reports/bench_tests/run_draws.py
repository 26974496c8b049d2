"""Draws of the parameters of a run folder, read back from its files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...errors import InputError
from ...inference.model import ALL_NAMES, OF_ONE_TEST, Order
from ...inference.noise import Noise
from ...runs.run_folder import load_result, read_listed


@dataclass(frozen=True)
class RunDraws:
    """What a run says of the parameters.

    Attributes:
        order: The higher order that the run holds.
        values: Draws by name, shape (draw,) each: fixed parameters as constants, those of one
            test left out.
        noise: At the fit.
        motor_name: The machine that was calibrated.
        calibration_sha256: Digests of the files that the run was calibrated on.
    """

    order: Order
    values: dict[str, Float[np.ndarray, " draw"]]
    noise: Noise
    motor_name: str
    calibration_sha256: frozenset[str]


def read_draws(run: Path, *, num_draws: int, seed: int, order: Order | None = None) -> RunDraws:
    """Read the posterior of a run.

    Args:
        run: A folder that `heatrun calibrate` wrote.
        num_draws: Number of draws to pick.
        seed: Of the pick.
        order: Of the network; the higher one that the run holds if None.

    Raises:
        InputError: If the folder is no run, misses a file, or holds effects or parameters of
            one test.
    """
    from ...runs import netcdf as archive

    result = load_result(run)
    try:
        order = order or ("second" if "second" in result["models"] else "first")
        model: dict[str, Any] = result["models"][order]
        read_listed(run, f"posterior_{order}.nc")  # refuses one that was changed
        group = archive.read(run / f"posterior_{order}.nc")["posterior"]
        entries = {**model["parameters"], **model["nuisances"]}
        names = [n for n in entries if n.partition("[")[0] not in OF_ONE_TEST]
        _refuse_effects(run, names)
        sizes = [np.asarray(group[n]).size for n in names if not entries[n]["fixed"]]
        num_kept = min(sizes, default=1)  # nothing to pick from where everything was fixed
        picked = np.random.default_rng([seed, 7]).integers(0, num_kept, num_draws)
        values = {
            name: np.full(num_draws, float(entries[name]["value"]))
            if entries[name]["fixed"]
            else np.asarray(group[name], dtype=float).ravel()[picked]
            for name in names
        }
        return RunDraws(
            order=order,
            values=values,
            noise=_noise(model["noise"]),
            motor_name=str(result["motor"]["name"]),
            calibration_sha256=frozenset(
                test["sha256"] for test in result["tests"] if test["role"] == "calibration"
            ),
        )
    except InputError:
        raise
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(
            f"a file of the run cannot be read: {error}.",
            where=str(run),
            remedy="Calibrate again.",
        ) from error


def _noise(said: dict[str, Any]) -> Noise:
    sd = float(said["sd_K"]) * (said["kind"] == "correlated")
    return Noise(*map(jnp.asarray, (sd, float(said["time_s"]), float(said["white_K"]))))


def _refuse_effects(run: Path, names: list[str]) -> None:
    extra = [name for name in names if name not in ALL_NAMES]
    if extra:
        raise InputError(
            f"the run holds what another test does not take over ({', '.join(extra)}): effects, or "
            "parameters of one test.",
            where=str(run),
            remedy="Pass a run of `heatrun calibrate`.",
        )
