"""Checkpoints of a sampler: chunks of the chain, each written whole or not at all."""

from __future__ import annotations

import io
import json
import os
from dataclasses import dataclass
from pathlib import Path

import emcee
import numpy as np


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or none, even after a kill."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    with partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


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
        """Return the chunks in order, up to the first that is missing or of another key."""
        chunks = []
        for number in range(100_000):
            path = self._path(number)
            if not path.exists():
                break
            with np.load(path, allow_pickle=False) as file:
                chunk = {name: file[name] for name in file.files}
            if str(chunk["key"]) != self.key:
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


def state_of(chunk: dict[str, np.ndarray]) -> emcee.State:
    """Return the sampler's state at the end of a chunk."""
    kind, position, has_gauss, gauss = json.loads(str(chunk["random_rest"]))
    random_state = (kind, chunk["random_keys"], position, has_gauss, gauss)
    return emcee.State(chunk["coords"], log_prob=chunk["coords_density"], random_state=random_state)
