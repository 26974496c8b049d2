"""`population.parquet`: each machine of a type before and after, a row each.

Parameters stand as parallel lists in the order of `parameters`, as in a fleet's `machines.parquet`;
the two are joined by the name of the machine. Machines that were left out have a row with the
reason and empty lists. So do the columns of the noise, which is a population of its own; they are
empty where a machine's noise does not count.
"""

from functools import cache
from typing import Any

from ..results import PopulationMachine, PopulationResult
from ..rows import LIST, Column, arrow, arrow_schema, empty_row

FORMAT = "heatrun-population-rows/2"

USED, LEFT_OUT = "used", "left out"

COLUMNS: tuple[Column, ...] = (
    ("machine", "text", "", "name of the machine"),
    ("type", "text", "", "what it is one of; empty if not said"),
    ("status", "text", "", "used or left out"),
    ("reason", "text", "", "why it was left out; empty if it was not"),
    ("outlier_probability", "number", "1", "probability that it does not belong to the type"),
    ("is_outlier", "truth", "", "whether that is above one half"),
    ("different", "list of text", "", "parameters more than 3 standard deviations from what is "
     "expected of the machine"),
    ("clipped", "number", "1", "how far its posterior was wider than its prior; more than a "
     "trifle puts its row in doubt"),
    ("parameters", "list of text", "", "names of the thermal parameters"),
    ("parameter_units", "list of text", "", "unit of each"),
    ("transforms", "list of text", "", "log or linear: the space in which they are normal"),
    ("alone_values", LIST, "parameter_units", "median by the machine's own calibration"),
    ("alone_low_95", LIST, "parameter_units", "lower limit of its 95 % interval"),
    ("alone_high_95", LIST, "parameter_units", "upper limit"),
    ("given_values", LIST, "parameter_units", "median given all machines of the type"),
    ("given_low_95", LIST, "parameter_units", "lower limit of its 95 % interval"),
    ("given_high_95", LIST, "parameter_units", "upper limit"),
    ("distance_sd", LIST, "1", "how far its tests put each from what is expected, in standard "
     "deviations over machines with what the tests leave open"),
    ("noise", "list of text", "", "names of the parameters of noise and unmodelled heat"),
    ("noise_units", "list of text", "", "unit of each"),
    ("noise_alone_values", LIST, "noise_units", "median by the machine's own calibration"),
    ("noise_given_values", LIST, "noise_units", "median given all machines of the type"),
    ("noise_given_low_95", LIST, "noise_units", "lower limit of its 95 % interval"),
    ("noise_given_high_95", LIST, "noise_units", "upper limit"),
    ("noise_outlier_probability", "number", "1", "probability that its noise is not that of the "
     "type"),
    ("noise_different", "list of text", "", "of them, those more than 3 standard deviations from "
     "what is expected of the machine"),
)  # fmt: skip
"""Name, kind, unit and meaning of each column, in order."""


@cache
def schema() -> Any:
    """Return the Arrow schema of the rows; units and meanings stand in the fields' metadata.

    Raises:
        InputError: If pyarrow is not installed.
    """
    return arrow_schema(COLUMNS, FORMAT)


def table_of(result: PopulationResult) -> Any:
    """Return the rows as an Arrow table: machines that count first, then those left out."""
    noise = {each.name: each for each in result.noise.machines} if result.noise else {}
    rows = []
    for machine in result.machines:
        row = {
            "machine": machine.name,
            "status": USED,
            "reason": "",
            "outlier_probability": machine.outlier_probability,
            "is_outlier": machine.is_outlier,
            "different": machine.different,
            "clipped": machine.clipped,
            "parameters": list(machine.parameters),
            **_values(machine),
            "parameter_units": [result.parameters[name].unit for name in machine.parameters],
            "transforms": [result.parameters[name].transform for name in machine.parameters],
        }
        if result.noise and (own := noise.get(machine.name)):
            kinds = result.noise.parameters
            row |= {f"noise_{k}": v for k, v in _values(own).items()} | {
                "noise": list(own.parameters),
                "noise_units": [kinds[name].unit for name in own.parameters],
                "noise_outlier_probability": own.outlier_probability,
                "noise_different": own.different,
            }
        rows.append(row)
    rows += [
        {"machine": each.name, "status": LEFT_OUT, "reason": each.reason}
        for each in result.left_out
    ]
    of_type, empty = {"type": result.type}, empty_row(COLUMNS)
    return arrow().Table.from_pylist([empty | of_type | row for row in rows], schema=schema())


def _values(machine: PopulationMachine) -> dict[str, Any]:
    own = machine.parameters.values()
    return {
        "alone_values": [each.alone_value for each in own],
        "alone_low_95": [each.alone_interval_95[0] for each in own],
        "alone_high_95": [each.alone_interval_95[1] for each in own],
        "given_values": [each.value for each in own],
        "given_low_95": [each.interval_95[0] for each in own],
        "given_high_95": [each.interval_95[1] for each in own],
        "distance_sd": [each.distance_sd for each in own],
    }
