"""The files of an export in their folder, where nothing is lost that cannot be made again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from ..bench.own_files import EXPORT
from ..errors import InputError
from ..io.file_set import together
from ..io.free_names import is_other
from ..io.whole_files import writable, write_whole


def write_export(
    places: Iterable[Path],
    content: Mapping[str, bytes],
    inputs: tuple[Path, ...],
    *,
    is_replacing: bool,
) -> list[Path]:
    """Write files into the first folder that holds no other export.

    Args:
        places: The folders, best first; a single one is where the user wants them.
        content: The files by name.
        inputs: Files that the export was made of.
        is_replacing: Whether another export is replaced.

    Returns:
        Where the files are.

    Raises:
        InputError: If every folder holds another export, a file is there that heatrun has not
            written, or a folder cannot be written to.
    """
    folder, others = Path(), [""]
    for folder in places:
        for name, new in content.items():
            _refuse_loss(folder / name, new, inputs)
        others = [name for name, new in content.items() if is_other(folder / name, new)]
        if is_replacing or not others:
            break
    else:
        raise InputError(
            f"{folder / others[0]} holds another export; it is left as it is.",
            remedy="Choose another --out, or pass --force to replace it.",
        )
    with writable("the export", folder), together(folder, "export") as files:
        for name, new in content.items():
            write_whole(files.aside / name, new)
    return [folder / name for name in content]


def _refuse_loss(path: Path, content: bytes, inputs: tuple[Path, ...]) -> None:
    """Refuse to replace what heatrun has not written: a recording, or an edited script."""
    try:
        existing = path.read_bytes()
    except OSError:
        return  # it is not there, or writing fails with its own words
    is_input = any(path.resolve() == source.resolve() for source in inputs)
    is_ours = existing.startswith(EXPORT) or existing == content
    if is_input or not is_ours:
        what = "one of the run's records" if is_input else "not as heatrun writes it"
        raise InputError(
            f"{path} exists and is {what}; it is left as it is.",
            remedy="Choose another --out, or move it away.",
        )
