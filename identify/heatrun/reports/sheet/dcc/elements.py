"""Elements of the DCC and of D-SI: names, texts, quantities."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement, register_namespace

from ....errors import InputError

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
XSI = "http://www.w3.org/2001/XMLSchema-instance"

for prefix, space in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
    register_namespace(prefix, space)

LANGUAGE = "en"
"""In which heatrun writes."""

NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 has no way to write (section 2.2)."""

UNITS: dict[str, str] = {
    "1": r"\one",
    "%": r"\percent",
    "K": r"\kelvin",
    "degC": r"\degreecelsius",
    "W": r"\watt",
    "A": r"\ampere",
    "V": r"\volt",
    "s": r"\second",
    "ohm": r"\ohm",
    "J/K": r"\joule\per\kelvin",
    "K/W": r"\kelvin\per\watt",
    "W/K": r"\watt\per\kelvin",
    "1/K": r"\per\kelvin",
    "K/h": r"\kelvin\per\hour",
    "1/h": r"\per\hour",
    "m^2": r"\metre\tothe{2}",
    "N m": r"\newton\metre",
    "rpm": r"\per\minute",
}
"""Units as D-SI writes them, by the way heatrun does."""


def add(parent: Element, name: str, text: str | None = None) -> Element:
    """Add an element of the DCC to another one.

    Args:
        parent: The other one.
        name: Its name.
        text: What stands in it; None for nothing.
    """
    return _add(parent, DCC, name, text)


def add_text(parent: Element, name: str, text: str) -> Element:
    """Add an element that holds a text in the language of the certificate."""
    element = add(parent, name)
    add(element, "content", text).set("lang", LANGUAGE)
    return element


def add_real(
    parent: Element,
    value: str,
    unit: str,
    *,
    label: str = "",
    expanded: str = "",
    interval: tuple[str, str, str] | None = None,
) -> Element:
    """Add a quantity as D-SI.

    Args:
        parent: What it belongs to.
        value: The number as it is printed.
        unit: As heatrun writes it.
        label: Its name, or empty.
        expanded: Expanded uncertainty with k = 2 for 95 %, or empty.
        interval: Standard uncertainty and both ends of the 95 % interval, where that is not value
            ± expanded.

    Raises:
        InputError: If D-SI has no word for the unit.
    """
    if unit not in UNITS:
        raise InputError(
            f"The unit {unit} has no form in the Digital Calibration Certificate.",
            remedy="Write the sheet without --dcc.",
        )
    real = _add(parent, SI, "real")
    if label:
        _add(real, SI, "label", label)
    _add(real, SI, "value", value)
    _add(real, SI, "unit", UNITS[unit])
    if expanded:
        held = _add(_add(real, SI, "measurementUncertaintyUnivariate"), SI, "expandedMU")
        parts = (("valueExpandedMU", expanded), ("coverageFactor", "2"))
    elif interval is not None:
        held = _add(_add(real, SI, "measurementUncertaintyUnivariate"), SI, "coverageIntervalMU")
        names = ("valueStandardMU", "intervalMin", "intervalMax")
        parts = tuple(zip(names, interval, strict=True))
    else:
        return real
    for name, text in (*parts, ("coverageProbability", "0.95")):
        _add(held, SI, name, text)
    return real


def _add(parent: Element, space: str, name: str, text: str | None = None) -> Element:
    element = SubElement(parent, f"{{{space}}}{name}")
    if text is not None:
        element.text = " ".join(NOT_IN_XML.sub("\ufffd", text).split())
    return element
