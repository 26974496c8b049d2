"""What lies at a destination: whether it is whole, and whether it is what was expected."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

PARTIAL, READY = ".partial", ".heatrun.ready"
END_OF_PNG = b"IEND\xaeB`\x82"


def files_of(place: Path) -> dict[str, Path]:
    """Return the files that a user sees as results: no pieces, nothing hidden, no checkpoints."""
    if not place.is_dir():
        return {}
    found = {}
    for path in sorted(place.rglob("*")):
        parts = path.relative_to(place).parts
        is_ours = any(part.startswith(".") or part.endswith(PARTIAL) for part in parts)
        if path.is_file() and not is_ours and parts[0] not in ("checkpoints", "identity"):
            found["/".join(parts)] = path
    return found


def pieces_of(home: Path) -> list[str]:
    """Return what an unfinished command left below a folder."""
    return sorted(
        str(path.relative_to(home))
        for path in home.rglob("*")
        if path.name.endswith((PARTIAL, READY, ".replaced"))
        or path.name in ("checkpoints", "identity")
    )


def is_moving(place: Path) -> bool:
    """Whether a complete set waits beside its places for the next start to end its renames."""
    return place.is_dir() and any(path.name.endswith(READY) for path in place.iterdir())


def torn(place: Path) -> list[str]:
    """Return the files at a destination that are not whole, with the reason."""
    faults = []
    for name, path in files_of(place).items():
        check = CHECKS.get(path.suffix)
        try:
            if check is not None:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    check(path.read_bytes())
        except Exception as error:  # what is torn fails in any way
            faults.append(f"{name} ({path.stat().st_size} bytes): {type(error).__name__}: {error}")
    return faults


def differs_from_manifest(run: Path) -> list[str]:
    """Return the files of a run that are not what its manifest says."""
    try:
        listed = json.loads((run / "manifest.json").read_text())["files"]
    except (OSError, ValueError, KeyError) as error:
        return [f"manifest.json: {error!r}"]
    faults = []
    for name, digest in listed.items():
        try:
            if hashlib.sha256((run / name).read_bytes()).hexdigest() != digest:
                faults.append(f"{name}: not the file that the manifest lists")
        except OSError as error:
            faults.append(f"{name}: {error.strerror}")
    return faults


def _json(data: bytes) -> None:
    content = json.loads(data)
    if not isinstance(content, dict) or len(content) < 2:
        raise ValueError(f"holds nothing but {list(content)}")


def _pdf(data: bytes) -> None:
    from pypdf import PdfReader

    if not data.startswith(b"%PDF") or not data.rstrip().endswith(b"%%EOF"):
        raise ValueError("no start or no end of a PDF")
    if not [page.extract_text() for page in PdfReader(io.BytesIO(data), strict=True).pages]:
        raise ValueError("no pages")


def _xlsx(data: bytes) -> None:
    from openpyxl import load_workbook

    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if (bad := archive.testzip()) is not None:
            raise ValueError(f"{bad} is damaged")
    load_workbook(io.BytesIO(data), read_only=True).close()


def _netcdf(data: bytes) -> None:
    if not leaves_of_netcdf(data):
        raise ValueError("no data")


def _png(data: bytes) -> None:
    if not data.startswith(b"\x89PNG") or not data.endswith(END_OF_PNG):
        raise ValueError("no start or no end of a PNG")


def _csv(data: bytes) -> None:
    text = data.decode("utf-8-sig")
    if not text.endswith("\n") or not list(csv.reader(io.StringIO(text))):
        raise ValueError("ends within a line")


def _mat(data: bytes) -> None:
    import scipy.io

    scipy.io.loadmat(io.BytesIO(data))


CHECKS: Mapping[str, Callable[[bytes], None]] = {
    ".json": _json, ".pdf": _pdf, ".xlsx": _xlsx, ".nc": _netcdf, ".png": _png, ".csv": _csv,
    ".mat": _mat,
}  # fmt: skip


def leaves_of_netcdf(data: bytes) -> dict[str, Any]:
    """Return every array of a NetCDF file, bit by bit."""
    found: dict[str, Any] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            array = np.asarray(item)
            # not the bytes of texts, which are addresses
            found[name] = array.tolist() if array.dtype == object else array.tobytes()

    with h5py.File(io.BytesIO(data)) as file:
        file.visititems(keep)
    return found


def _leaves(path: Path) -> dict[str, Any]:
    """Return the contents of a file by name: what can differ while the file means the same."""
    data = path.read_bytes()
    if path.suffix == ".json":
        return _flat(json.loads(data))
    if path.suffix == ".nc":
        return leaves_of_netcdf(data)
    if path.suffix == ".xlsx":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {info.filename: info.CRC for info in archive.infolist()}
    if path.suffix == ".pdf":
        from pypdf import PdfReader

        pages = PdfReader(io.BytesIO(data)).pages
        return {f"page {n}": page.extract_text() for n, page in enumerate(pages)}
    return {"": hashlib.sha256(data).hexdigest()}


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    if isinstance(value, dict):
        items = [(f"{name}/{key}", item) for key, item in value.items()]
    elif isinstance(value, list):
        items = [(f"{name}/{index}", item) for index, item in enumerate(value)]
    else:
        return {name: value}
    found = {name: type(value).__name__}
    for key, item in items:
        found |= _flat(item, key)
    return found


@dataclass(frozen=True)
class Expected:
    """What an undisturbed command leaves, learnt from two of them."""

    # SHA-256 of the files that came out the same to the last byte, by name.
    digests: dict[str, str]
    # Contents that came out the same of files that did not, by name of the file.
    leaves: dict[str, dict[str, Any]]
    before: frozenset[str] = frozenset()  # Names that lay at the place before the command.
    # Contents that did not come out the same, by name of the file.
    varying: dict[str, list[str]] = field(default_factory=dict)

    @classmethod
    def learn(cls, first: Path, second: Path, before: frozenset[str]) -> Expected:
        """Compare what two undisturbed commands left, with the same words at the same path."""
        ours, theirs = files_of(first), files_of(second)
        if ours.keys() != theirs.keys():
            raise ValueError(f"{sorted(ours)} and {sorted(theirs)} came of the same command")
        digests, leaves, varying = {}, {}, {}
        for name, path in ours.items():
            if path.read_bytes() == theirs[name].read_bytes():
                digests[name] = hashlib.sha256(path.read_bytes()).hexdigest()
            else:
                one, other = _leaves(path), _leaves(theirs[name])
                leaves[name] = {k: v for k, v in one.items() if k in other and other[k] == v}
                varying[name] = sorted({*one, *other} - leaves[name].keys())
        return cls(digests, leaves, before, varying)

    @property
    def names(self) -> set[str]:
        """All files of the result."""
        return {*self.digests, *self.leaves}

    def missing(self, place: Path) -> list[str]:
        """Return the files that lack beside others that this command has newly written."""
        present = set(files_of(place))
        new = self.names - self.before
        return sorted(new - present) if present & new else []

    def differences(self, place: Path) -> list[str]:
        """Return how a finished result differs from the expected one."""
        present = files_of(place)
        faults = [f"{name} is not there" for name in sorted(self.names - present.keys())]
        faults += [f"{name} is there too" for name in sorted(present.keys() - self.names)]
        for name, digest in self.digests.items():
            if name in present:
                found = hashlib.sha256(present[name].read_bytes()).hexdigest()
                faults += [f"{name} has other bytes"] if found != digest else []
        for name, leaves in self.leaves.items():
            if name not in present:
                continue
            found = _leaves(present[name])
            other = [
                key for key, value in leaves.items() if key not in found or found[key] != value
            ]
            faults += [f"{name} differs at {other[:3]}"] if other else []
        return faults


def marked_processes(mark: str) -> list[int]:
    """Return the processes but this one whose environment holds a mark, by their ids."""
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit() or int(entry) == os.getpid():
            continue
        try:
            with open(f"/proc/{entry}/environ", "rb") as file:
                is_ours = mark.encode() in file.read()
            with open(f"/proc/{entry}/stat", "rb") as file:
                state = file.read().rpartition(b")")[2].split()[0]
        except OSError:
            continue
        if is_ours and state != b"Z":
            found.append(int(entry))
    return found
