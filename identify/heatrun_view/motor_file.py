"""The motor file that is chosen on the page: read, and written where nothing is lost by it."""

from __future__ import annotations

from pathlib import Path

from heatrun.errors import InputError
from heatrun.io.toml_text import LARGEST_BYTES
from heatrun.motorfile import parse_motor

from .server.confined import read_inside, replace_inside


def read_motor_file(path: Path) -> bytes:
    """Return the content of a motor file.

    Args:
        path: The file, as the page has found it in one of its folders.

    Raises:
        InputError: If it is no regular file any more, cannot be read or is too large.
    """
    return read_inside(path.parent.resolve(), path, LARGEST_BYTES)


def write_motor_file(root: Path, path: Path, before: bytes, after: bytes) -> None:
    """Put another content into a motor file, whole or not at all.

    Args:
        root: The folder that is shown, with links resolved; nothing is written outside it.
        path: The file.
        before: What it holds; with anything else in it, it stays.
        after: What it is to hold.

    Raises:
        InputError: If it was sent to the page, or as `heatrun_view.server.confined.replace_inside`.
    """
    refuse_sent(root, path)
    if len(after) > LARGEST_BYTES:
        raise InputError(
            f"Expected a motor file of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=path.name,
            remedy="Check what was put in; it was not written.",
        )
    replace_inside(root, path, before, after)


def create_motor_file(root: Path, name: str, content: bytes) -> None:
    """Write a motor file that is not there yet.

    Args:
        root: The folder that is shown, with links resolved.
        name: Of the file, without a folder.
        content: What it holds; it loads.

    Raises:
        InputError: If there is a file of this name, it is no motor file or cannot be written.
    """
    parse_motor(content, name)
    try:
        with (root / name).open("xb") as file:  # follows no link
            file.write(content)
    except FileExistsError as error:
        raise InputError(
            "There is a file of this name already.", where=name, remedy="Choose another name."
        ) from error
    except OSError as error:
        raise InputError(
            f"The motor file cannot be written ({error.strerror}).",
            where=name,
            remedy="Make the folder writable.",
        ) from error


def refuse_sent(root: Path, path: Path) -> None:
    """Refuse to write a motor file that is none of the folder that is shown.

    Args:
        root: The folder, with links resolved.
        path: The file.

    Raises:
        InputError: If it lies elsewhere.
    """
    if not path.is_relative_to(root):
        raise InputError(
            "The motor file was sent to the page and ends with it.",
            where=path.name,
            remedy="Copy the text into your own motor file.",
        )
