"""What build_models.m builds, read from its text, and integrated block by block.

Simulink is not to be had here, so this is an independent stand-in: the calls of the script become a
graph of blocks, which is checked against what the blocks of the base library have for ports and
parameters, and integrated by classical Runge-Kutta steps as `ode4` does it.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

FROM, TO = "simulink/Sources/From Workspace", "simulink/Sinks/To Workspace"
CONSTANT, SCOPE = "simulink/Sources/Constant", "simulink/Sinks/Scope"
SUM, GAIN = "simulink/Math Operations/Sum", "simulink/Math Operations/Gain"
PRODUCT, MUX = "simulink/Math Operations/Product", "simulink/Signal Routing/Mux"
INTEGRATOR = "simulink/Continuous/Integrator"

PARAMETERS = {
    FROM: {"VariableName", "SampleTime", "Interpolate", "OutputAfterFinalValue"},
    TO: {"VariableName", "SaveFormat", "MaxDataPoints"},
    CONSTANT: {"Value"},
    SCOPE: set(),
    SUM: {"Inputs", "IconShape"},
    GAIN: {"Gain"},
    PRODUCT: {"Inputs"},
    MUX: {"Inputs"},
    INTEGRATOR: {"InitialCondition"},
}
"""Blocks of Simulink's base library, with those of their programmatic parameters that are used:
Simulink reference, "Block-Specific Parameters"."""

CALL = re.compile(r"^\s*(new_system|add_block|add_line|set_param|save_system)\((.*)\);$")
TEXT = r"'((?:[^']|'')*)'"
NAME = rf"\[m {TEXT}\]"


@dataclass
class Diagram:
    """A model: blocks with library path and parameters, lines from port to port, settings."""

    blocks: dict[str, tuple[str, dict[str, str]]] = field(default_factory=dict)
    lines: list[tuple[str, str]] = field(default_factory=list)
    settings: dict[str, str] = field(default_factory=dict)

    def num_inputs(self, name: str) -> int:
        library, given = self.blocks[name]
        if library == SUM:
            return len(given["Inputs"])
        if library in (PRODUCT, MUX):
            return int(given["Inputs"])
        return 0 if library in (FROM, CONSTANT) else 1

    def num_outputs(self, name: str) -> int:
        return 0 if self.blocks[name][0] in (TO, SCOPE) else 1

    def sources(self, name: str) -> list[str]:
        """Return the blocks that drive the inputs of a block, in the order of its ports."""
        found = {int(end.rpartition("/")[2]): start.rpartition("/")[0]
                 for start, end in self.lines if end.rpartition("/")[0] == name}  # fmt: skip
        return [found[port + 1] for port in range(self.num_inputs(name))]


def parse(script: str) -> dict[str, Diagram]:
    """Return the models that a script builds; what stands under a condition counts as built."""
    joined = re.sub(r"\.\.\.[^\n]*\n", " ", script)
    variables = dict(re.findall(rf"^(\w+) = {TEXT};$", joined, re.MULTILINE))
    models: dict[str, Diagram] = {}
    name = ""
    for line in joined.splitlines():
        if found := re.fullmatch(rf"m = {TEXT};", line):
            name = found[1]
        call = CALL.match(line)
        if call is None:
            continue
        what, words = call[1], call[2]
        if what == "new_system":
            models[name] = Diagram()
        elif what == "add_block":
            library, block, rest = re.match(rf"{TEXT}, {NAME}, (.*)", words).groups()
            pairs = re.findall(rf"{TEXT}, ('[^']*'|\[[^]]*\]|\w+)", rest)
            given = {key: text[1:-1] if text.startswith("'") else variables.get(text, text)
                     for key, text in pairs}  # fmt: skip
            models[name].blocks[block.removeprefix("/")] = (library, given)
        elif what == "add_line":
            start, end = re.match(rf"m, {TEXT}, {TEXT}, 'autorouting', 'on'$", words).groups()
            models[name].lines.append((start, end))
        elif what == "set_param":
            pairs = re.findall(rf"{TEXT}, {TEXT}", words)
            models[name].settings |= dict(pairs)
    return models


def problems(diagram: Diagram) -> list[str]:
    """Return what Simulink would refuse of a model: blocks, parameters, ports and lines."""
    found = []
    for name, (library, given) in diagram.blocks.items():
        if library not in PARAMETERS:
            found.append(f"{name}: no block {library}")
            return found
        unknown = set(given) - PARAMETERS[library] - {"Position"}
        found += [f"{name}: no parameter {key}" for key in sorted(unknown)]
        if "/" in name:
            found.append(f"{name}: a slash parts blocks from systems")
    driven: list[str] = []
    for start, end in diagram.lines:
        for port, count in ((start, diagram.num_outputs), (end, diagram.num_inputs)):
            block, _, number = port.rpartition("/")
            if block not in diagram.blocks:
                found.append(f"{port}: there is no such block")
            elif not 1 <= int(number) <= count(block):
                found.append(f"{port}: there is no such port")
        driven.append(end)
    ports = [f"{name}/{port + 1}" for name in diagram.blocks
             for port in range(diagram.num_inputs(name))]  # fmt: skip
    found += [f"{port} is driven {driven.count(port)} times" for port in ports
              if driven.count(port) != 1]  # fmt: skip
    used = {start.rpartition("/")[0] for start, _ in diagram.lines}
    found += [f"{name} goes nowhere" for name in diagram.blocks
              if diagram.num_outputs(name) and name not in used]  # fmt: skip
    boxes = {name: [int(edge) for edge in given["Position"].strip("[]").split()]
             for name, (_, given) in diagram.blocks.items()}  # fmt: skip
    found += [
        f"{a} covers {b}" for a in boxes for b in boxes if a < b and _touch(boxes[a], boxes[b])
    ]
    return found


def _touch(a: list[int], b: list[int]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def evaluate(expression: str, workspace: Mapping[str, np.ndarray]):
    """Return a MATLAB expression of a block's parameter, of the few forms that the script has."""
    text = re.sub(r"(\w+)\(isfinite\((\w+)\)\)", r"\1[isfinite(\2)]", expression)
    text = re.sub(r"^\[(.*)\]$", r"(\1)", text).replace(".^", "**")
    names = {n: v.ravel() if v.size > 1 else float(v.item()) for n, v in workspace.items()}
    return eval(text, {"__builtins__": {}, "isfinite": np.isfinite}, names)


def integrate(
    diagram: Diagram, workspace: Mapping[str, np.ndarray], step: float
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return time, and by variable what the model sends to the workspace at each step.

    Args:
        diagram: The model.
        workspace: The variables of `prova.mat`.
        step: Fixed step [s].
    """
    states = [n for n, (library, _) in diagram.blocks.items() if library == INTEGRATOR]
    order = _order(diagram, states)
    rules = {name: _rule(diagram, name, workspace) for name in order}
    sources = {name: diagram.sources(name) for name in [*order, *states]}

    def outputs(time: float, T: np.ndarray) -> dict[str, float]:
        values = dict(zip(states, T.tolist(), strict=True))
        for name in order:
            values[name] = rules[name](time, [values[source] for source in sources[name]])
        return values

    def slope(time: float, T: np.ndarray) -> np.ndarray:
        values = outputs(time, T)
        return np.array([values[sources[name][0]] for name in states])

    start, end = workspace["t"].ravel()[[0, -1]]
    time = np.linspace(start, end, round((end - start) / step) + 1)
    T = np.array([float(evaluate(diagram.blocks[n][1]["InitialCondition"], workspace))
                  for n in states])  # fmt: skip
    sinks = {given["VariableName"]: name for name, (library, given) in diagram.blocks.items()
             if library == TO}  # fmt: skip
    rows = []
    for at in time:
        values = outputs(at, T)
        rows.append([values[diagram.sources(name)[0]] for name in sinks.values()])
        s1 = slope(at, T)
        s2 = slope(at + 0.5 * step, T + 0.5 * step * s1)
        s3 = slope(at + 0.5 * step, T + 0.5 * step * s2)
        s4 = slope(at + step, T + step * s3)
        T = T + step / 6.0 * (s1 + 2.0 * s2 + 2.0 * s3 + s4)
    columns = np.array(rows).T
    return time, dict(zip(sinks, columns, strict=True))


def _order(diagram: Diagram, states: list[str]) -> list[str]:
    """Return the blocks without states so that each comes after those that drive it."""
    known, order = set(states), []
    left = [n for n, (library, _) in diagram.blocks.items()
            if n not in known and library not in (TO, SCOPE, MUX)]  # fmt: skip
    while left:
        ready = [name for name in left if known.issuperset(diagram.sources(name))]
        assert ready, f"algebraic loop through {left}"
        order += ready
        known |= set(ready)
        left = [name for name in left if name not in known]
    return order


def _rule(
    diagram: Diagram, name: str, workspace: Mapping[str, np.ndarray]
) -> Callable[[float, list[float]], float]:
    library, given = diagram.blocks[name]
    if library == FROM:
        time, values = evaluate(given["VariableName"], workspace)
        return lambda at, _: float(np.interp(at, time, values))
    if library == CONSTANT:
        constant = evaluate(given["Value"], workspace)
        return lambda _, __: constant
    if library == GAIN:
        gain = evaluate(given["Gain"], workspace)
        return lambda _, x: gain * x[0]
    if library == SUM:
        signs = [1.0 if sign == "+" else -1.0 for sign in given["Inputs"]]
        return lambda _, x: sum(s * v for s, v in zip(signs, x, strict=True))
    assert library == PRODUCT, library
    return lambda _, x: float(np.prod(x))
