"""The networks that are built in, and networks by name or file."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from ...errors import InputError, UsageError
from .form import NetworkForm
from .text import read_network

BUILT_IN = ("first", "second")
"""Names of the two networks that every bench compares, by growing number of nodes."""

SHIPPED = (*BUILT_IN, "cooled", "three", "four")
"""Names of all networks that come with the package."""


@cache
def _built_in(name: str) -> NetworkForm:
    text = files("heatrun.inference.networks") / f"{name}.toml"
    return read_network(text.read_bytes(), f"{name}.toml")


def networks_of(words: str) -> tuple[NetworkForm, ...]:
    """Return the networks behind `--model`: `"both"`, or names and files with commas between.

    Raises:
        InputError: As `network_named`.
        UsageError: If no network is named.
    """
    names = BUILT_IN if words == "both" else [word for word in words.split(",") if word.strip()]
    if not names:
        raise UsageError(f"--model names no network: write both, {', '.join(SHIPPED)} or FILE.toml")
    return tuple(network_named(name.strip()) for name in names)


def pair_of(words: str) -> tuple[NetworkForm, NetworkForm]:
    """Return the two networks that are compared, the one with fewer nodes first.

    Args:
        words: As `networks_of`; a single network is set against the second order, and the second
            order against the first.

    Raises:
        InputError: As `network_named`.
        UsageError: If more than two networks are named.
    """
    named = networks_of(words)
    if len(named) == 1:
        other = "first" if named[0].name == "second" else "second"
        named = (*named, network_named(other))
    if len(named) != 2:
        raise UsageError(f"two networks are compared at a time, and --model names {len(named)}")
    one, two = sorted(named, key=lambda form: len(form.nodes))
    return one, two


def network_named(name: str | NetworkForm) -> NetworkForm:
    """Return a network by the name of a built-in one, or from a TOML file.

    Args:
        name: One of `SHIPPED`, a path that ends in `.toml`, or the network itself.

    Raises:
        InputError: If there is no such network, or the file is wrong.
    """
    if isinstance(name, NetworkForm):
        return name
    if name in SHIPPED:
        return _built_in(name)
    path = Path(name)
    if path.suffix == ".toml":
        from ...bench.readers.open_file import read_start
        from ...io.toml_text import LARGEST_BYTES

        return read_network(read_start(path, LARGEST_BYTES + 1), str(path))
    raise InputError(
        f"there is no network {name!r}.",
        remedy=f"Name one of {', '.join(SHIPPED)}, or a TOML file with a [network].",
    )
