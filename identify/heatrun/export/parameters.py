"""The parameters of the C of a run as other programs see them: names, units, 95 % intervals."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..model.model import Model
from .c_file import CSource
from .laws import MEMBERS, links_of


@dataclass(frozen=True)
class Entry:
    """One number among the parameters of the C."""

    name: str  # In letters, digits and points, each once.
    member: str  # Of `heatrun_parameters`.
    index: int | None  # Its place there; None for a member that is one number.
    unit: str  # Its unit, `"1"` for none.
    meaning: str  # What it is.
    value: float  # What the run states [unit].
    # Its 95 % interval [unit]; None where the run has none for it.
    interval_95: tuple[float, float] | None

    @property
    def bounds(self) -> tuple[float, float]:
        """Between which it may be set: half and twice, and all of the interval [unit]."""
        values = (self.value, *(self.interval_95 or ()))
        about = (0.5 * self.value, 2.0 * self.value)
        low, high = min(*about, *values), max(*about, *values)
        is_share = self.member.endswith("share")
        return low, min(high, 0.5 * (1.0 + max(values))) if is_share else high

    @property
    def words(self) -> str:
        """Meaning with value and interval."""
        if self.interval_95 is None:
            return self.meaning
        low, high = self.interval_95
        return f"{self.meaning}; 95 % interval {low:.4g} to {high:.4g}"


def entries(source: CSource, model: Model, ends: Iterable[CSource] = ()) -> list[Entry]:
    """Return the parameters that a run has found, in the order of the C, with their intervals where
    it is there at the ends of these.
    """
    tables = [each.parameters() for each in (source, *ends)]
    kept = []
    for member, values in tables[0].items():
        for place in np.ndindex(values.shape):
            value, *limits = (float(table[member][place]) for table in tables)
            is_there = any((value, *limits)) if member != "share" else len({value, *limits}) > 1
            if is_there:
                index = place[0] if place else None
                interval = (min(limits), max(limits)) if limits else None
                name, unit, meaning = _said(source, model, member, index)
                kept.append(Entry(name, member, index, unit, meaning, value, interval))
    names = unique((each.name for each in kept), ["time"])
    return [replace(each, name=name) for each, name in zip(kept, names, strict=True)]


def _said(source: CSource, model: Model, member: str, index: int | None) -> tuple[str, str, str]:
    """Return name, unit and meaning."""
    form, nodes, links = model.form, source.nodes, links_of(source.found)
    if member == "capacitance_J_per_K":
        node = nodes[index or 0]
        parameter = dict(form.capacitance).get(node)
        if parameter is None:  # a body that an effect adds
            return f"C_{node}", "J/K", f"heat capacity of {node}"
        return parameter.name, parameter.unit, parameter.meaning
    if member == "resistance_K_per_W":
        a, b = links[index or 0]
        parameter = dict(form.resistance).get((a, b))
        if parameter is None:
            return f"R_{a}_{b}", "K/W", f"resistance from {a} to {b}"
        return parameter.name, parameter.unit, parameter.meaning
    if member == "Rs0_ohm":
        return "Rs0", "Ohm", f"phase resistance at {float(source.found['Tref']):g} degC"
    name, unit, meaning = MEMBERS[member]
    node = nodes[index] if "{0}" in name and index is not None else ""
    return name.format(node), unit, meaning.format(node)


def unique(names: Iterable[str], taken: Iterable[str] = (), point: str = ".") -> Iterator[str]:
    """Give names in letters and digits that any program reads, each once, also beside those that
    are taken; points part them, or what stands for a point afterwards.
    """
    used = set(taken)
    for name in names:
        parts = name.split(".")
        plain = point.join(re.sub(r"\W|^(?=\d)|^$", "_", each, flags=re.ASCII) for each in parts)
        while plain in used:
            plain += "_"
        used.add(plain)
        yield plain
