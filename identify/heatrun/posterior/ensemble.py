"""An ensemble of walkers that runs in chunks and takes up where a checkpoint ends.

Each chunk of the chain is written whole or not at all.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import emcee
import numpy as np

from ..fit.fit_result import Fit
from ..io.whole_files import write_whole
from ..model.draws import NUM_NOISE
from .proposal import Proposal
from .weighted import LEAST_EFFECTIVE, Weighted, evaluate

CONTENT = ("key", "chain", "log_density", "coords", "coords_density", "random_keys", "random_rest")
"""Names of the arrays of a chunk."""

NUM_RANDOM_KEYS = 624
"""Words in the state of the random numbers, a Mersenne twister."""


@dataclass(frozen=True)
class Checkpoint:
    """A folder with the chunks of one ensemble."""

    folder: Path  # Where the chunks lie.
    key: str  # Digest of what is sampled; chunks of anything else are not taken up.

    def load(self) -> list[dict[str, np.ndarray]]:
        """Return the chunks in order, up to the first that is missing or cannot be gone on from.

        What is damaged, of another key or of another shape is sampled again: the random numbers
        stand in the chunk before it, so the chain comes out the same.
        """
        chunks: list[dict[str, np.ndarray]] = []
        for number in range(100_000):
            chunk = _read(self._path(number))
            if chunk is None or str(chunk["key"]) != self.key or not _fits(chunk):
                break
            chunks.append(chunk)
        return chunks

    def save(self, number: int, chain: np.ndarray, log_density: np.ndarray, state: emcee.State):
        """Write one chunk: positions, densities, and the state of the random numbers."""
        buffer = io.BytesIO()
        assert state.random_state is not None
        kind, keys, position, has_gauss, gauss = state.random_state
        numbers = json.dumps([str(kind), int(position), int(has_gauss), float(gauss)])
        np.savez(
            buffer,
            key=np.array(self.key),
            chain=chain,
            log_density=log_density,
            coords=state.coords,
            coords_density=np.asarray(state.log_prob),
            random_keys=np.asarray(keys),
            random_rest=np.array(numbers),
        )
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self._path(number), buffer.getvalue())

    def _path(self, number: int) -> Path:
        return self.folder / f"chunk_{number:05d}.npz"


def _read(path: Path) -> dict[str, np.ndarray] | None:
    """Return what a chunk holds, or None if it is not there or damaged."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            chunk = {name: file[name] for name in CONTENT}
        if not all(isinstance(array, np.ndarray) for array in chunk.values()):
            return None  # NumPy gives members that are no arrays as bytes
        state_of(chunk)
    except Exception:  # a damaged file raises nearly anything in there
        return None
    return chunk


def _fits(chunk: dict[str, np.ndarray]) -> bool:
    """Whether the arrays of a chunk belong together and hold numbers."""
    chain, coords = chunk["chain"], chunk["coords"]
    numbers = [chunk[name] for name in ("chain", "log_density", "coords", "coords_density")]
    return (
        all(array.dtype == np.float64 for array in numbers)
        and chain.ndim == 3
        and chunk["log_density"].shape == chain.shape[:2]
        and coords.shape == chain.shape[1:]
        and chunk["coords_density"].shape == chain.shape[1:2]
        and chunk["random_keys"].shape == (NUM_RANDOM_KEYS,)
        and bool(np.isfinite(chain).all() and np.isfinite(coords).all())
    )


def state_of(chunk: dict[str, np.ndarray]) -> emcee.State:
    """Return the sampler's state at the end of a chunk."""
    kind, position, has_gauss, gauss = json.loads(str(chunk["random_rest"]))
    random_state = (kind, chunk["random_keys"], position, has_gauss, gauss)
    return emcee.State(chunk["coords"], log_prob=chunk["coords_density"], random_state=random_state)


class Shares(NamedTuple):
    """Shares of the moves of an ensemble; evolution has the rest [1]."""

    noise: float  # That take one score of the noise anew.
    anew: float  # That take all scores anew, from the proposal of the importance sampling.


ALONE = Shares(0.25, 0.0)
"""Where that proposal is too poor to draw from."""

LINEAR = Shares(0.25, 0.6)
"""Where it is of linear models: a draw costs as much as two steps of evolution, and one in seven is
taken. On `duty_90min` what is remembered times what a step costs is two thirds of that with 0.2."""

FOLLOWED, FOLLOWED_IN_VAIN = Shares(0.5, 0.05), Shares(0.5, 0.2)
"""Where it follows the model, and its draws are sound or not: many of them are taken, and each
costs as much as dozens of steps of evolution."""


TOLD_EVERY = 25
"""Steps from one word of how far it is to the next."""


class Ensemble:
    """One ensemble with its chunks; takes up a checkpoint where there is one."""

    def __init__(self, sampler: emcee.EnsembleSampler, state, checkpoint, chunks) -> None:
        self._sampler, self._state = sampler, state
        self._checkpoint, self._waiting, self._done = checkpoint, chunks, []

    @classmethod
    def begin(
        cls,
        fit: Fit,
        weighted: Weighted,
        num_walkers: int,
        index: int,
        seed: int,
        folder: Path | None,
    ) -> Ensemble:
        """Return the ensemble at its start: importance samples, and the chunks of its checkpoint.

        Args:
            fit: What is sampled.
            weighted: Where the walkers start, and the proposal of a part of their moves.
            num_walkers: Number of walkers.
            index: Which of the ensembles that run apart it is.
            seed: Random seed.
            folder: Where the chunks are written; None for none.
        """
        sampler = emcee.EnsembleSampler(
            num_walkers,
            fit.vector.size,
            partial(evaluate, fit),
            vectorize=True,
            moves=_moves(weighted),
        )
        rng = np.random.default_rng([seed, 7, index])
        drawn = weighted.resample(num_walkers, rng)
        # equal draws would leave the ensemble in a subspace that it cannot get out of
        start = drawn + 1e-3 * np.sqrt(np.diag(fit.covariance)) * rng.standard_normal(drawn.shape)
        # beyond the largest noise no walker may start: there the density is nothing
        is_beyond = ~np.isfinite(evaluate(fit, start))
        start[is_beyond] = drawn[is_beyond]
        random_state = np.random.RandomState(rng.integers(2**31)).get_state()
        state = emcee.State(start, random_state=random_state)
        if folder is None:
            return cls(sampler, state, None, [])
        digest = hashlib.sha256(
            repr((fit.problem.structure, seed, index, num_walkers)).encode() + start.tobytes()
        )
        checkpoint = Checkpoint(folder / f"ensemble_{index}", digest.hexdigest())
        return cls(sampler, state, checkpoint, checkpoint.load())

    @property
    def num_steps(self) -> int:
        """Steps so far."""
        return sum(chunk["chain"].shape[0] for chunk in self._done)

    def advance(
        self, num_steps: int, num_chunks: int = 1, told: Callable[[int], None] | None = None
    ) -> None:
        """Go on by chunks of so many steps, or take them from the checkpoint; `told` gets the steps
        so far, every `TOLD_EVERY` of them.
        """
        for _ in range(num_chunks):
            if self._waiting:
                chunk = self._waiting.pop(0)
                self._state = state_of(chunk)
                self._done.append(chunk)
                continue
            self._sampler.reset()
            begun = self.num_steps
            for number, state in enumerate(self._sampler.sample(self._state, iterations=num_steps)):
                self._state = state
                if told is not None and (number + 1) % TOLD_EVERY == 0:
                    told(begun + number + 1)
            chain, density = self._sampler.get_chain(), self._sampler.get_log_prob()
            if self._checkpoint is not None:
                self._checkpoint.save(len(self._done), chain, density, self._state)
            self._done.append({"chain": chain, "log_density": density})

    def chain(self) -> np.ndarray:
        """Return positions, shape (step, walker, all)."""
        return np.concatenate([chunk["chain"] for chunk in self._done])

    def density(self) -> np.ndarray:
        """Return log densities, shape (step, walker)."""
        return np.concatenate([chunk["log_density"] for chunk in self._done])


def evolution() -> list[tuple[emcee.moves.Move, float]]:
    """Return moves of differential evolution with their shares.

    It mixes three times faster than the stretch move in a dozen dimensions, and its full steps
    change between optima. The snooker move of emcee 3.1.6 is left out: it does not keep the law
    (alone, it gave a standard normal in ten dimensions a variance of 0.6).
    """
    return [(emcee.moves.DEMove(), 0.9), (emcee.moves.DEMove(gamma0=1.0), 0.1)]


def of_noise(coordinates: np.ndarray, random: np.random.RandomState):
    """Return walkers each of which has one score of the noise anew from its prior, and the factors
    of their acceptance [nat].

    A white part so small that it does not show leaves its logarithm to the prior. That makes a long
    tail, into which evolution and the proposal of the importance sampling seldom reach: the other
    scores forgot where they were in 30 steps, this one in 160 (`duty_90min`).

    Args:
        coordinates: Scores of parameters and noise, shape (walker, all).
        random: Random numbers.
    """
    num, size = coordinates.shape
    rows, place = np.arange(num), size - NUM_NOISE + random.randint(NUM_NOISE, size=num)
    moved, old, new = coordinates.copy(), coordinates[rows, place], random.randn(num)
    moved[rows, place] = new
    return moved, 0.5 * (new**2 - old**2)


def _shares(weighted: Weighted) -> Shares:
    """Return the shares of the moves with a proposal."""
    if weighted.effective_size <= LEAST_EFFECTIVE:
        return ALONE
    if isinstance(weighted.proposal, Proposal):
        return LINEAR
    return FOLLOWED if weighted.is_sound else FOLLOWED_IN_VAIN


def _moves(weighted: Weighted) -> list[tuple[emcee.moves.Move, float]]:
    """Return the moves of an ensemble with their shares.

    Draws from the proposal of the importance sampling forget where a walker was wherever that
    proposal is good; the tails that it misses are left to the other moves.
    """
    shares, proposal = _shares(weighted), weighted.proposal.latest
    known: dict[bytes, float] = {}  # log density where walkers stood or might have gone last

    def anew(coordinates: np.ndarray, random: np.random.RandomState):
        rng = np.random.default_rng(random.randint(2**32, size=4, dtype=np.uint32))
        drawn = proposal.draw(coordinates.shape[0], rng)
        places = [row.tobytes() for row in coordinates]
        is_new = np.array([place not in known for place in places])
        density = np.array([known.get(place, 0.0) for place in places])
        if is_new.any():
            density[is_new] = proposal.log_density(coordinates[is_new])
        known.clear()
        known.update(zip(places, density.tolist(), strict=True))
        drawn_places = (row.tobytes() for row in drawn.vectors)
        known.update(zip(drawn_places, drawn.log_density.tolist(), strict=True))
        return drawn.vectors, density - drawn.log_density

    rest = 1.0 - shares.noise - shares.anew
    moves = [(move, rest * share) for move, share in evolution()]
    moves.append((emcee.moves.MHMove(of_noise), shares.noise))
    if shares.anew:
        moves.append((emcee.moves.MHMove(anew), shares.anew))
    return moves
