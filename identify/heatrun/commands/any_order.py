"""A parser of a command's words that takes files before, between and behind the options."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any


class AnyOrder(argparse.ArgumentParser):
    """As argparse, whose own parser takes a list of files in one piece only.

    A list that may be empty is taken for empty at the first option, and files behind it are then
    "unrecognized". `parse_intermixed_args` would do, but a parser with subcommands cannot call it;
    so each subcommand does.
    """

    _is_intermixing = False

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Iterable[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse options first, then what is left as one row of files."""
        words = None if args is None else list(args)
        if self._is_intermixing:  # called by the very method that is called below
            return super().parse_known_args(words, namespace)
        self._is_intermixing = True
        try:
            return self.parse_known_intermixed_args(words, namespace)
        finally:
            self._is_intermixing = False
