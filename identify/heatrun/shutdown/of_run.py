"""Time constants and amplitudes of a calibrated run as the prior of its machine's cooling.

The posterior draws of the network, without current and losses, give time constants and how losses
before switch-off spread over the modes. How large copper loss and other losses were is left open,
and so is how far the slowest mode had come; the readings tell. One mode within the winding, which a
network of lumped nodes does not have, is added, as machines in general have it.

The draws are those of the network, and say nothing of what it lumps: a network of two nodes that
follows the heating of a machine of five within 0.1 K has time constants that are not those by which
its winding cools. `TIME_SLACK` is for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Drive, linearise

from ..errors import InputError
from ..io.programs import compiled
from ..model.model import Model
from ..runs.run import open_run
from .cooling import AbstractModes, Draws, is_there, winding_drops
from .readings import Readings

NUM_DRAWS = 300

TIME_SLACK = 0.2
"""Standard deviation of the logarithm of a time constant beside that of the run [1]: the winding at
rest does not cool by the modes of the network that was calibrated."""

WITHIN_RATIO, WITHIN_LOG_SD = 1.6, 0.5
"""By how much the mode within the winding is faster, less one [1]."""

LOSS_SHARES = (0.6, 0.4)
"""Of copper loss and other losses in the rise, as wide as they are large [1]."""

SLOW_SHARE = 0.4
"""Of the rise, standard deviation of what the slowest mode lacks of its steady state [1]."""


@dataclass(frozen=True, kw_only=True)
class RunModes(AbstractModes):
    """Modes of a run's network, and one within the winding."""

    rise_K: float  # Of the first reading [K].
    log_times: np.ndarray  # Mean of the logarithms of the time constants, shape (mode,).
    factor: np.ndarray  # Their factor by standard normal numbers, shape (mode, mode).
    # Share of each mode in the rise by copper loss and by other losses, shape (1 + mode, 2, mode):
    # at the mean, and by standard normal number.
    shapes: np.ndarray
    are_positive: bool = False

    def times(self, z: Draws) -> np.ndarray:
        """Return the time constants, as `AbstractModes`."""
        num = self.log_times.size
        tau = np.exp(self.log_times + z[:, :num] @ self.factor.T)
        within = tau[:, :1] / (1.0 + WITHIN_RATIO * np.exp(WITHIN_LOG_SD * z[:, num : num + 1]))
        return np.concatenate([within, tau], axis=1)

    def amplitudes(self, z: Draws) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and factor of the amplitudes, as `AbstractModes`."""
        num, rise = self.log_times.size, max(self.rise_K, 5.0)
        shapes = self.shapes[0] + np.einsum("dk,kij->dij", z[:, :num], self.shapes[1:])
        by_loss = rise * np.array(LOSS_SHARES)[:, None] * shapes
        present = is_there(z[:, num + 2])
        within, sd = winding_drops(rise, self.times(z)[:, :1], z[:, num + 1 : num + 2])
        mean = np.concatenate([within * present[:, None], np.sum(by_loss, axis=1)], axis=1)
        factor = np.zeros((len(z), 1 + num, 4))
        factor[:, 0, 0] = sd[:, 0] * present
        factor[:, 1:, 1:3] = np.swapaxes(by_loss, 1, 2)
        factor[:, -1, 3] = SLOW_SHARE * rise
        return mean, factor


def modes_of_run(
    folder: Path, readings: Readings, network: str | None = None, *, is_turning: bool = False
) -> RunModes:
    """Return the modes of a run's network as a prior.

    Args:
        folder: Run folder.
        readings: At whose temperatures the network is taken.
        network: Its name; the last one if None.
        is_turning: Whether the machine turns on at rated speed after switch-off.

    Raises:
        InputError: If the run cannot be read, or its network does not cool.
    """
    run = open_run(folder)
    draws = run.draws(network).thin(NUM_DRAWS)
    model = draws.model
    values = model.in_general({key: jnp.asarray(one) for key, one in draws.of_test(None).items()})
    speed = 1.0 if is_turning else 0.0
    sink = readings.sink_degC
    drive = Drive.constant(
        current_squared=0.0, losses=0.0, ambient=sink, speed=speed, coolant=sink, fan=speed,
        second_sink=sink if model.form.second_sink else None,
    )  # fmt: skip
    A, heat = _states(model, values, drive, np.asarray(readings.degC[0]))
    tau, shapes, place = _modal(np.asarray(A), np.asarray(heat))
    if not np.all(np.isfinite(tau)):
        raise InputError(
            "The network of the run does not cool without losses in every draw.",
            where=str(folder),
            remedy="Leave --run out, or choose another network by --model.",
        )
    log_times = np.log(tau)
    mean = log_times.mean(axis=0)
    covariance = np.atleast_2d(np.cov(log_times.T)) + TIME_SLACK**2 * np.eye(mean.size)
    factor = np.linalg.cholesky(covariance)
    scores = np.linalg.solve(factor, (log_times - mean).T).T
    design = np.concatenate([np.ones((len(scores), 1)), scores], axis=1)
    flat = shapes.reshape(len(shapes), -1)
    by_score = np.linalg.lstsq(design, flat, rcond=None)[0].reshape(-1, 2, mean.size)
    times = tuple(f"time constant {k + 1} of the run" for k in range(mean.size))
    return RunModes(
        of_times=(
            *times,
            "time constant within the winding",
            "heating of the copper before switch-off",
            "whether the winding has a drop within",
        ),
        of_amplitudes=(
            "drop within the winding",
            "copper loss before switch-off",
            "other losses before switch-off",
            "steady state before switch-off",
        ),
        num_winding=2 + place,
        basis=f"the run {folder.name}, network {run.choose(network)}",
        rise_K=float(readings.degC[0]) - sink,
        log_times=mean,
        factor=factor,
        shapes=by_score,
    )


@compiled("model")
def _states(
    model: Model, values: dict[str, Float[Array, " draw"]], drive: Drive, at: Float[Array, ""]
) -> tuple[Float[Array, "draw node node"], Float[Array, "draw 2 node"]]:
    """Return state matrices [1/s], and slopes by 1 W of copper and of other losses [K/s].

    The copper node is put first.
    """

    def one(values: dict[str, Float[Array, ""]]):
        network, losses = model.network(values), model.losses(values)
        effects = model.built_effects(values)
        T = dict.fromkeys(network.nodes, at)
        rest = linearise(network, losses, drive, T, effects=effects)
        watt = Drive.constant(
            current_squared=0.0, losses=1.0, ambient=drive.ambient, speed=drive.speed,
            coolant=drive.coolant, fan=drive.fan, second_sink=drive.second_sink,
        )  # fmt: skip
        other = linearise(network, losses, watt, T, effects=effects)
        first = rest.nodes.index(network.copper_node)
        order = jnp.asarray([first, *(k for k in range(len(rest.nodes)) if k != first)])
        copper = jnp.zeros(len(rest.nodes)).at[0].set(1 / network.capacitance[network.copper_node])
        by_loss = (other.offset - rest.offset)[order]
        return rest.A[order][:, order], jnp.stack([copper, by_loss])

    return jax.vmap(one)(values)


def _modal(
    A: Float[np.ndarray, "draw node node"], heat: Float[np.ndarray, "draw 2 node"]
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return time constants, shares of the modes in the rise by each loss, the winding's mode."""
    rate, vectors = (np.real(one) for one in np.linalg.eig(A))
    order = np.argsort(rate, axis=1)  # the fastest first
    rate = np.take_along_axis(rate, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    with np.errstate(divide="ignore"):
        tau = np.where(rate < 0.0, -1.0 / rate, np.inf)
    steady = np.linalg.solve(A[:, None], -heat[..., None])
    parts = np.linalg.solve(vectors[:, None], steady)[..., 0] * vectors[:, None, 0, :]
    # mode in which a watt in the copper begins to show
    own = np.linalg.solve(vectors, heat[:, 0, :, None])[..., 0] * vectors[:, 0, :]
    total = np.sum(parts, axis=2, keepdims=True)
    return tau, parts / total, int(np.argmax(np.mean(own, axis=0)))
