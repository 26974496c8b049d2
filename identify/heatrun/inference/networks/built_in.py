"""The networks that are built in, and networks by name or file."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from ...errors import InputError
from .form import NetworkForm
from .text import read_network

BUILT_IN = ("first", "second")
"""Names of the networks that are built in, by growing number of nodes."""


@cache
def _built_in(name: str) -> NetworkForm:
    text = files("heatrun.inference.networks") / f"{name}.toml"
    return read_network(text.read_bytes(), f"{name}.toml")


def networks_of(words: str) -> tuple[NetworkForm, ...]:
    """Return the networks behind `--model`: `"both"`, or names and files with commas between.

    Raises:
        InputError: As `network_named`.
    """
    names = BUILT_IN if words == "both" else [word for word in words.split(",") if word.strip()]
    return tuple(network_named(name.strip()) for name in names)


def network_named(name: str | NetworkForm) -> NetworkForm:
    """Return a network by the name of a built-in one, or from a TOML file.

    Args:
        name: `"first"`, `"second"`, a path that ends in `.toml`, or the network itself.

    Raises:
        InputError: If there is no such network, or the file is wrong.
    """
    if isinstance(name, NetworkForm):
        return name
    if name in BUILT_IN:
        return _built_in(name)
    path = Path(name)
    if path.suffix == ".toml":
        from ...bench.readers.open_file import read_start
        from ...io.toml_text import LARGEST_BYTES

        return read_network(read_start(path, LARGEST_BYTES + 1), str(path))
    raise InputError(
        f"there is no network {name!r}.",
        remedy=f"Name one of {', '.join(BUILT_IN)}, or a TOML file with a [network].",
    )
