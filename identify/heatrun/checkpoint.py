"""Checkpoints of a sampler: chunks of the chain, each written whole or not at all."""

from __future__ import annotations

import io
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import emcee
import numpy as np

PARTIAL = ".partial"
"""End of the name of what is being written."""

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


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or none, even after a kill.

    Args:
        path: The file; what it held before stays where the writing fails.
        content: What it is to hold.

    Raises:
        OSError: If it cannot be written; no part of it is left then.
    """
    with whole(path) as partial, partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a name to write a file under, which becomes `path` once that has succeeded.

    Args:
        path: The file.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def drop_partials(folder: Path) -> None:
    """Remove the pieces of files that killed processes left in a folder and below it.

    Args:
        folder: A folder that no other process writes to.
    """
    for piece in folder.rglob(f".*{PARTIAL}"):
        if piece.is_dir():
            shutil.rmtree(piece)
        else:
            piece.unlink()


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
