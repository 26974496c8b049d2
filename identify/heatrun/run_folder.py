"""The run folder: the result as files, there as a whole or not at all, resumable after a kill.

A run works in `NAME.partial` beside its destination, where its checkpoints lie; the folder takes
its name in one step when everything is in it. The same command started again finds the partial
folder of the same inputs and goes on.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from .checkpoint import write_whole
from .errors import InputError

MANIFEST = "manifest.json"
PACKAGES = ("heatrun", "jax", "optimistix", "diffrax", "emcee", "numpy", "pandas", "arviz")


@dataclass(frozen=True)
class RunFolder:
    """A run on its way to a folder.

    Attributes:
        path: Where it will be.
        partial: Where it is until it is whole.
    """

    path: Path
    partial: Path

    @classmethod
    def begin(cls, path: Path, identity: Mapping[str, Any]) -> RunFolder:
        """Make or take up the partial folder of a run.

        Args:
            path: Destination; an earlier run there is replaced in the end, anything else is not.
            identity: What makes the run what it is: inputs with digests, settings, seed.

        Raises:
            InputError: If the destination is no run, or cannot be written to.
        """
        if path.exists() and not (path / MANIFEST).is_file():
            raise InputError(
                f"{path} exists and is not a run of heatrun (it has no {MANIFEST}).",
                remedy="Choose another --out.",
            )
        partial = path.with_name(path.name + ".partial")
        digest = hashlib.sha256(dump(identity).encode()).hexdigest()
        mark = partial / "identity"
        try:
            if partial.exists() and (not mark.is_file() or mark.read_text() != digest):
                shutil.rmtree(partial)
            partial.mkdir(parents=True, exist_ok=True)
            write_whole(mark, digest.encode())
        except OSError as error:
            raise InputError(
                f"the run folder cannot be written: {error.strerror}.",
                where=str(path.parent),
                remedy="Choose a writable folder with --out.",
            ) from error
        return cls(path, partial)

    @property
    def checkpoints(self) -> Path:
        """Folder of the sampler's checkpoints."""
        return self.partial / "checkpoints"

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file, whole or not at all."""
        write_whole(self.partial / name, (dump(content) + "\n").encode())

    def finish(self, manifest: Mapping[str, Any]) -> Path:
        """Write the manifest, drop the checkpoints and give the folder its name."""
        files = sorted(
            p for p in self.partial.rglob("*")
            if p.is_file() and "checkpoints" not in p.parts and p.name != "identity"
        )  # fmt: skip
        listing = {
            str(p.relative_to(self.partial)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in files
        }
        self.write_json(MANIFEST, {**manifest, "files": listing})
        shutil.rmtree(self.checkpoints, ignore_errors=True)
        (self.partial / "identity").unlink(missing_ok=True)
        if self.path.exists():
            old = self.path.with_name(f".{self.path.name}.{os.getpid()}.old")
            self.path.replace(old)
            self.partial.replace(self.path)
            shutil.rmtree(old)
        else:
            self.partial.replace(self.path)
        return self.path


def environment() -> dict[str, Any]:
    """Return versions of what a result depends on."""
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "packages": {name: version(name) for name in PACKAGES},
    }


def dump(content: Any) -> str:
    """Return JSON text; numbers that are not finite become null, arrays lists."""
    return json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False)


def load_result(path: Path) -> dict[str, Any]:
    """Return `fit.json` of a run folder.

    Raises:
        InputError: If the folder is no run or the file is damaged.
    """
    file = path / "fit.json"
    if not (path / MANIFEST).is_file() or not file.is_file():
        raise InputError(
            f"{path} is not a run folder: it holds no {MANIFEST} and fit.json.",
            remedy="Pass the folder that `heatrun calibrate --out` wrote.",
        )
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"fit.json cannot be read: {error}.", where=str(path), remedy="Calibrate again."
        ) from error
    if not isinstance(result, dict) or result.get("format") != "heatrun-fit/1":
        raise InputError(
            "fit.json is of another format than heatrun-fit/1.",
            where=str(path),
            remedy="Calibrate again with this version.",
        )
    return result


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
