"""Checkpoints of a sampler: chunks of the chain, each written whole or not at all."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path

import emcee
import numpy as np

from ...io.whole_files import write_whole

CONTENT = (
    "key",
    "chain",
    "log_density",
    "coords",
    "coords_density",
    "random_keys",
    "random_rest",
)
"""Names of the arrays of a chunk."""

NUM_RANDOM_KEYS = 624
"""Words in the state of the random numbers, a Mersenne twister."""


@dataclass(frozen=True)
class Checkpoint:
    """A folder with the chunks of one ensemble.

    Attributes:
        folder: Where the chunks lie.
        key: Digest of what is sampled; chunks of anything else are not taken up.
    """

    folder: Path
    key: str

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
