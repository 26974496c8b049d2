"""Variables within structs, groups, cells and matrices, brought to one name each.

A struct that holds one signal, as Simulink ("structure with time": `signals(k).values`, `.label`)
and dSPACE (`Y(k).Data`, `.Name`, `.Unit`) write them, gives the signal its name and its unit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .mat5 import Text
from .stored import Stored

Nested = Stored | str | Sequence["Nested"] | Mapping[str, "Nested"]
"""Numbers, `Text`, the kind of what is neither, elements, or fields."""

VALUES = frozenset(("values", "value", "data", "signal"))
NAMES = ("label", "name", "signalname", "title")
UNITS = ("unit", "units", "unitstring")
"""Fields of a struct of one signal, in lower case."""

TIME = "time"
"""What dSPACE calls X beside Y, whatever name it gives it."""

MOST_COLUMNS = 200
"""A matrix with more columns holds no channels."""


@dataclass(frozen=True)
class Leaf:
    """One variable.

    Attributes:
        name: How MATLAB calls it, such as `log.signals(2).values`.
        heading: What it is called in words, such as its label; mostly its own field.
        value: Its numbers, or what it is instead.
    """

    name: str
    heading: str
    value: Stored | str


def leaves(variables: Mapping[str, Nested], joint: str = ".") -> list[Leaf]:
    """Return every variable; a struct without any number is one itself.

    Args:
        variables: By name, as a reader found them.
        joint: What stands between the names of a struct and of its field.
    """
    return [leaf for name, value in variables.items() for leaf in _leaves(name, name, value, joint)]


def _leaves(name: str, heading: str, value: Nested, joint: str) -> list[Leaf]:
    if isinstance(value, Stored | str):
        return [Leaf(name, heading, value)]
    if isinstance(value, Mapping):
        found = list(_of_struct(name, heading, value, joint))
        kind = f"struct with the fields {', '.join(value)}"
    else:
        found = []
        for number, one in enumerate(value, 1):
            called = f"{heading} {number}" if len(value) > 1 else heading
            found += _leaves(f"{name}({number})", called, one, joint)
        kind = "cell"
    return found if any(isinstance(one.value, Stored) for one in found) else [Leaf(name, "", kind)]


def _of_struct(name: str, heading: str, fields: Mapping[str, Nested], joint: str) -> Iterator[Leaf]:
    texts = {key.casefold(): one.strip() for key, one in fields.items() if isinstance(one, Text)}
    is_signal = any(key.casefold() in VALUES and _is_course(one) for key, one in fields.items())
    named = None if heading == TIME else next(filter(None, map(texts.get, NAMES)), None)
    unit = next(filter(None, (texts.get(key) for key in UNITS)), None) if is_signal else None
    for key, one in fields.items():
        path = f"{name}{joint}{key}"
        if key.casefold() in VALUES and isinstance(one, Stored) and is_signal:
            yield Leaf(path, named or heading, replace(one, unit=one.unit or unit))
        elif isinstance(one, Text) or (is_signal and _is_said(one)):
            continue  # what is said of the signal beside its values
        else:
            word = TIME if key == "X" and "Y" in fields else key
            yield from _leaves(path, word, one, joint)


def _is_course(value: Nested) -> bool:
    return isinstance(value, Stored) and value.values.size > 1


def _is_said(value: Nested) -> bool:
    return isinstance(value, Stored | str) and not _is_course(value)


def courses(leaf: Leaf, length: int) -> list[tuple[str, str, np.ndarray]] | None:
    """Return name, heading and values of each column of a variable, None if it has no such.

    Args:
        leaf: The variable.
        length: Number of samples.
    """
    if isinstance(leaf.value, str):
        return None
    values = leaf.value.values
    if is_vector(values):
        return [(leaf.name, leaf.heading, values.ravel())] if values.size == length else None
    values = values.squeeze()
    if (
        values.ndim != 2
        or sorted(values.shape)[0] > MOST_COLUMNS
        or values.shape[0] == values.shape[1]
    ):
        return None
    if values.shape[0] == length:
        return [
            (f"{leaf.name}(:,{k})", f"{leaf.heading} {k}", values[:, k - 1])
            for k in range(1, values.shape[1] + 1)
        ]
    if values.shape[1] == length:
        return [
            (f"{leaf.name}({k},:)", f"{leaf.heading} {k}", values[k - 1])
            for k in range(1, values.shape[0] + 1)
        ]
    return None


def is_vector(values: np.ndarray) -> bool:
    """Return whether an array has one dimension that counts, and several numbers."""
    return values.size > 1 and values.size == max(values.shape)
