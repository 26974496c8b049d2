"""Calling a library on a file that may be damaged: quiet, and with our own error alone."""

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from ..errors import InputError


class BrokenFileError(Exception):
    """What our own checks found wrong with a file, in words for its reader."""


def library(name: str, what: str, where: str) -> Any:
    """Return a module that is installed with the extra of heatrun's called as the format.

    Raises:
        InputError: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(
            f"Reading {what} needs {name.partition('.')[0]}, which is not installed.",
            where=where,
            remedy=f'Run: pip install "heatrun[{what.lower()}]"',
        ) from error


@contextlib.contextmanager
def reading(what: str, where: str) -> Iterator[None]:
    """Turn whatever a library does about a damaged file into an `InputError`.

    Within, nothing is printed or logged: the libraries of measurement formats print to stdout,
    where `--json` puts its object alone. What they warn of, the readers check themselves. `what` is
    the format, such as `"an MDF 4 file"`.

    Raises:
        InputError: In place of any other exception.
    """
    disabled = logging.root.manager.disable
    try:
        with (
            contextlib.redirect_stdout(io.StringIO()),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)
            yield
    except InputError:
        raise
    except Exception as error:  # a damaged file raises nearly anything in there
        is_ours = isinstance(error, BrokenFileError)
        problem = str(error) if is_ours else f"{type(error).__name__}: {error}"
        raise damaged(what, where, problem) from error
    finally:
        logging.disable(disabled)


def damaged(what: str, where: str, problem: str) -> InputError:
    """Return the error for a file of a format, as `reading`, that is damaged or cut."""
    first_line = problem.strip().splitlines()[0][:300] if problem.strip() else "no reason given"
    return InputError(
        f"Expected {what}, it could not be read ({first_line}).",
        where=where,
        remedy="Copy the file again from the bench; it may have been cut.",
    )
