"""Words of column names that stand where a unit may stand and are none."""

from __future__ import annotations

MEANS = frozenset(
    ("mean", "avg", "average", "avrg", "ave", "mittel", "mittelwert", "mw", "media", "medio",
     "moyenne", "moy")
)  # fmt: skip
"""A channel averaged is the channel: a name that ends in one of these is known without it."""

EFFECTIVE = frozenset(("rms", "eff", "effective", "effektiv"))
"""The same for a phase current, which is taken as rms."""

PEAKS = frozenset(("peak", "pk", "ampl", "amplitude", "crest", "scheitel", "spitze", "pp", "p-p"))

STATISTICS = (
    MEANS
    | EFFECTIVE
    | PEAKS
    | frozenset(
        ("min", "max", "minimum", "maximum", "median", "med", "std", "sd", "stdev", "filt",
         "filtered", "smooth", "smoothed", "raw", "act", "actual", "ist", "meas", "measured",
         "gemessen", "inst", "calc", "calculated", "corr", "corrected", "total", "sum", "abs",
         "value", "val", "signal", "sig")
    )
)  # fmt: skip
"""What may stand behind the unit of a name."""

PLACES = frozenset(
    (
        "air", "ambient", "aussen", "außen", "back", "bearing", "bearings", "between", "body",
        "bottom", "box", "cabinet", "cable", "case", "center", "centre", "chamber", "channel",
        "circuit", "coil", "control", "controller", "coolant", "cooler", "cooling", "core", "de",
        "drive", "electronics", "end", "engine", "exit", "flow", "fluid", "front", "fuel", "gap",
        "gear", "gearbox", "gehäuse", "head", "hot", "house", "housing", "hub", "in", "inlet",
        "inner", "inside", "inverter", "iron", "jacket", "lab", "layer", "left", "line", "link",
        "load", "luft", "machine", "magnet", "magnets", "mid", "middle", "mode", "module",
        "motor", "nde", "neutral", "nut", "oel", "oil", "out", "outer", "outlet", "outside",
        "phase", "pipe", "pipes", "plate", "point", "position", "primary", "pump", "rear",
        "right", "room", "rotor", "secondary", "sensor", "set", "shaft", "side", "sink", "slot",
        "spot", "state", "stationary", "stator", "steel", "supply", "surface", "system", "tank",
        "teeth", "temp", "temperature", "test", "the", "tooth", "top", "turn", "wall", "wasser",
        "water", "wicklung", "winding", "windings", "wire", "yoke", "zone", "öl",
    )
)  # fmt: skip
"""Where something was measured: "temperature in stator" names no unit."""


def is_name(text: str) -> bool:
    """Return whether a text is made of words of a name, so that it can be no unit.

    Args:
        text: Such as `"the housing"` or `"slot 3"`.
    """
    words = text.casefold().replace("_", " ").replace("-", " ").replace("/", " ").split()
    return any(word in PLACES or word in STATISTICS or word.isdigit() for word in words)
