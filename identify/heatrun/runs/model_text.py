"""The text form of a fitted model: TOML in the run folder that reads back to the same value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..inference.catalogue import effects_named
from ..inference.model import Model
from ..inference.networks.text import network_of, network_text
from ..inference.parameters import Parameter, ParameterSet, collect
from ..io.toml_text import parse_toml
from ..motor import Adequacy

FORMAT = "heatrun-model/1"


@dataclass(frozen=True)
class ModelOfRun:
    """A model with its priors over the tests that it was fitted to.

    Attributes:
        model: Network with effects and nuisances.
        parameters: Parameters with priors, fixed values and tests.
    """

    model: Model
    parameters: ParameterSet


def model_text(found: ModelOfRun) -> bytes:
    """Return the TOML text of a model."""
    import tomli_w

    model = found.model
    distinct: list[Parameter] = []
    tests = []
    for name, parameters in zip(found.parameters.tests, found.parameters.by_test, strict=True):
        places = []
        for parameter in parameters.values():
            if parameter not in distinct:
                distinct.append(parameter)
            places.append(distinct.index(parameter))
        tests.append({"name": _utf8(name), "parameters": places})
    own = set(model.form.effects)
    content = {
        "format": FORMAT,
        "effects": [kind.card.id for kind in model.effects if kind.card.id not in own],
        **network_text(model.form),
        "losses": {
            "kind": model.kind,
            "phases": model.phases,
            "reference_temperature_degC": float(model.reference_temperature),
            "coefficient_degC": float(model.coefficient),
        },
        "adequacy": asdict(model.adequacy),
        "change_sd": model.change_sd,
        "fitted": {"parameters": [_entry(each) for each in distinct], "tests": tests},
    }
    return tomli_w.dumps(content).encode()


def read_model(data: bytes, where: str, files: Sequence[Path] = ()) -> ModelOfRun:
    """Return the model of a text.

    Args:
        data: The bytes of the file.
        where: The file, for messages.
        files: Python files with effects of the user's own.

    Raises:
        InputError: If the text is damaged, or names an effect that is not there.
    """
    content = parse_toml(data, where, "model file")
    if content["format"] != FORMAT:
        raise ValueError(f"format {content['format']!r}, expected {FORMAT}")
    form = network_of(content, where)
    losses, fitted = content["losses"], content["fitted"]
    model = Model(
        form=form,
        kind=losses["kind"],
        phases=losses["phases"],
        reference_temperature=losses["reference_temperature_degC"],
        coefficient=losses["coefficient_degC"],
        effects=effects_named([*form.effects, *content["effects"]], where, files),
        adequacy=Adequacy(**content.get("adequacy", {})),  # runs of old do not say
        change_sd=content.get("change_sd", 0.0),
    )
    distinct = [Parameter(**{"fixed": None, **entry}) for entry in fitted["parameters"]]
    by_test = [
        {distinct[place].name: distinct[place] for place in test["parameters"]}
        for test in fitted["tests"]
    ]
    names = [test["name"] for test in fitted["tests"]]
    return ModelOfRun(model, collect(names, by_test))


def _entry(parameter: Parameter) -> Mapping[str, Any]:
    return {
        key: float(value) if isinstance(value, float) else value
        for key, value in asdict(parameter).items()
        if value is not None
    }


def _utf8(text: str) -> str:
    """Return text that TOML can hold: bytes of a file name that are no UTF-8 are escaped."""
    return text.encode(errors="backslashreplace").decode()
