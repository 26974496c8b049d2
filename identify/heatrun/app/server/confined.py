"""Opening a file inside a folder, and nothing outside it, whatever is done to the folder meanwhile.

A path that was looked at and is opened afterwards may have become a link in between. So the folders
on the way are opened one in the other, none of them through a link, and the file in the last one.
"""

from __future__ import annotations

import os
import stat
from io import BufferedReader
from pathlib import Path

from ...errors import InputError

HAS_FOLDERS = os.open in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
"""Whether the system opens a file relative to an open folder; Windows does not."""

FOLDER_FLAGS = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
FILE_FLAGS = (
    os.O_RDONLY
    | getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)  # a FIFO would wait for its writer, a device for itself
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_BINARY", 0)
)
CLOEXEC = getattr(os, "O_CLOEXEC", 0)


def open_inside(root: Path, path: Path) -> BufferedReader:
    """Open a regular file in a folder for reading.

    Links that stay inside the folder are followed: they are resolved first, and what comes of it
    is opened without any.

    Args:
        root: The folder, with links resolved.
        path: The file.

    Raises:
        InputError: If it is none, or lies outside the folder by `..`, an absolute path or a link.
    """
    try:
        steps = (root / path).resolve().relative_to(root).parts
        if not steps:
            raise InputError("Expected a file, got a directory.", where=str(path))
        descriptor = _open_in_steps(root, steps) if HAS_FOLDERS else _open_checked(root, steps)
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: links in a circle
        raise outside(str(path)) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise no_regular_file(str(path))
    return os.fdopen(descriptor, "rb")


def outside(where: str) -> InputError:
    """Return the error of a file that is not in the folder."""
    return InputError(
        "Expected a file in the folder that is shown; this is none.",
        where=repr(where),
        remedy="Put the file into the folder, or start heatrun view on its folder.",
    )


def no_regular_file(where: str) -> InputError:
    """Return the error of a pipe, a device or a folder."""
    return InputError(
        "Expected a file in the folder that is shown, got a pipe, a device or a folder.",
        where=repr(where),
        remedy="Copy what comes out of it into a file.",
    )


def _open_in_steps(root: Path, steps: tuple[str, ...]) -> int:
    folder = os.open(root, FOLDER_FLAGS | CLOEXEC)
    try:
        for step in steps[:-1]:
            inner = os.open(step, FOLDER_FLAGS | CLOEXEC, dir_fd=folder)
            os.close(folder)
            folder = inner
        # Some devices act when they are opened, so what is known to be one is not.
        status = os.stat(steps[-1], dir_fd=folder, follow_symlinks=False)
        if not stat.S_ISREG(status.st_mode):
            raise no_regular_file(steps[-1])
        return os.open(steps[-1], FILE_FLAGS | CLOEXEC, dir_fd=folder)
    finally:
        os.close(folder)


def _open_checked(root: Path, steps: tuple[str, ...]) -> int:
    """Open by path and look where it led; a link could be there for the time of the opening."""
    path = root.joinpath(*steps)
    descriptor = os.open(path, FILE_FLAGS | CLOEXEC)
    found = path.resolve()
    if found.is_relative_to(root) and os.path.samestat(os.fstat(descriptor), found.stat()):
        return descriptor
    os.close(descriptor)
    raise outside(str(path))


def read_inside(root: Path, path: Path, max_bytes: int) -> bytes:
    """Return the content of a regular file in a folder.

    Args:
        root: The folder, with links resolved.
        path: The file.
        max_bytes: Largest content [byte].

    Raises:
        InputError: If it is none, lies outside the folder, cannot be read or is larger.
    """
    try:
        with open_inside(root, path) as file:
            content = file.read(max_bytes + 1)
    except OSError as error:
        raise outside(str(path)) from error
    if len(content) > max_bytes:
        raise InputError(
            f"Expected a file of at most {max_bytes / 1e6:.0f} MB, got a larger one.",
            where=str(path),
            remedy="Open it from the folder itself.",
        )
    return content


def is_inside(root: Path, path: Path) -> bool:
    """Return whether a path is a regular file in a folder, for lists of what may be opened."""
    try:
        found = path.resolve()
        return found.is_relative_to(root) and stat.S_ISREG(found.lstat().st_mode)
    except (OSError, ValueError, RuntimeError):  # RuntimeError: links in a circle
        return False
