"""The winding at switch-off as a Digital Calibration Certificate, with its uncertainty budget."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from ..errors import InputError
from ..io.quantities import clean, quantity
from ..record.motor import Certificate
from ..reports.dcc import (
    add,
    add_budget,
    add_method,
    add_named,
    add_result,
    add_statements,
    add_text,
    add_uncertain,
    as_bytes,
    begun,
)
from ..reports.printed import TestDays
from ..version import __version__
from .printed import budget_sum
from .result import ShutdownResult

METHOD = "Extrapolation of readings after switch-off to the instant of switch-off"

HOW = (
    "The winding cools by several exponentials whose time constants have wide physical priors or "
    "those of a calibrated run; the errors of the instruments and the moment of switch-off are "
    "sampled with them. The standard uncertainty is that of the draws, the budget of first order."
)


def dcc_text(result: ShutdownResult, certificate: Certificate) -> bytes:
    """Return the certificate of a temperature at switch-off.

    Args:
        result: The result.
        certificate: What the laboratory states; its days are those of the readings.

    Raises:
        InputError: If the temperature is not determinable, or something is not stated that such a
            certificate must say.
    """
    if not result.is_determinable:
        raise InputError(
            f"no certificate of a temperature that is not determinable: {result.reason}",
            remedy="Leave --dcc out.",
        )
    begin = certificate.test_from or certificate.test_until
    root, about = begun(
        certificate, TestDays(begin, certificate.test_until or begin), result.motor
    )  # fmt: skip
    use = f"Determinable: {budget_sum(result)}. {' '.join(map(clean, result.notes))}"
    add_statements(add(about, "statements"), use.strip(), certificate)
    measured = add(add(root, "measurementResults"), "measurementResult")
    add_text(measured, "name", "Temperature of the winding at switch-off")
    references = ("JCGM 100:2008", "JCGM 101:2008")
    add_method(measured, METHOD, HOW, references, __version__, certificate)
    found = add(measured, "results")
    _answer(found, result)
    add_budget(found, "the temperature", result.budget, "K", label="u_combined")
    held = add(add(measured, "measurementMetaData"), "metaData")
    add_text(held, "name", f"Readings {clean(result.readings)}")
    add_text(held, "declaration", f"SHA-256: {result.sha256}.")
    return as_bytes(root)


def _answer(parent: Element, result: ShutdownResult) -> None:
    data = add_result(parent, "Winding at switch-off")
    sd = result.standard_uncertainty_K
    winding = add_named(data, "temperature of the winding at switch-off")
    add_uncertain(winding, result.winding_degC, sd, result.winding_95_degC, "degC", label="winding")
    for name, value, (low, high), label in (
        (f"rise over the sink of {result.sink_degC:.1f} °C", result.rise_K, result.rise_95_K,
         "rise"),
        *((f"left to {one.name} {quantity(f'{one.value:g}', one.unit)}", one.margin_K,
           one.margin_95_K, "") for one in result.limits),
    ):  # fmt: skip
        # their draws are not kept: of a normal distribution the interval is 3.92 of it
        spread = (high - low) / 3.92
        add_uncertain(add_named(data, name), value, spread, (low, high), "K", label=label)
