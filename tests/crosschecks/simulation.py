"""The same simulation by `lptn`, by scipy and by diffrax."""

from pathlib import Path

import independent
import jax.numpy as jnp
import numpy as np

import lptn
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_test
from heatrun.record.reduction import reduce
from lptn.effects.heat_paths import InsulationConductivity, Radiation, SpeedCooling
from lptn.effects.losses import AcCopperLoss, StrayLoadLoss

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"


def bundled_inputs(test: str, step_s: float, num: int | None = None) -> lptn.Inputs:
    """Return the inputs of a bundled record on steps of a length [s], the first `num` of them."""
    motor = load_motor(SYNTHETIC / "motor.toml")
    full = reduce(read_test(SYNTHETIC / f"{test}.csv.gz", motor), motor, step_s=step_s).inputs
    assert full.speed is not None
    kept = {name: getattr(full, name)[:num]
            for name in ("current_squared", "losses", "ambient", "speed")}  # fmt: skip
    whole = {name: getattr(full, name) for name in ("step", "rated_speed", "rated_current")}
    return lptn.Inputs(**kept, **whole)


def plain(inputs: lptn.Inputs) -> tuple[np.ndarray, np.ndarray]:
    current, speed = np.asarray(inputs.current_squared), np.asarray(inputs.speed)
    columns = [
        current,
        np.asarray(inputs.losses),
        np.asarray(inputs.ambient),
        np.abs(speed) / float(inputs.rated_speed),
        current / float(inputs.rated_current) ** 2,
    ]
    edges = float(inputs.step) * np.arange(current.size + 1)
    return edges, np.stack(columns, axis=1)


def cases() -> dict[str, tuple]:
    """Return by name: network, effects, and the same balance written independently."""
    p = independent
    parts = p.FOUR_C, p.FOUR_R, p.FOUR_SHARE
    parts = ({name: jnp.asarray(each) for name, each in part.items()} for part in parts)
    four = lptn.Network(*parts)
    e = {name: jnp.asarray(value) for name, value in p.EFFECTS.items()}
    effects = (
        Radiation(eA=e["eA"], node="yoke"),
        SpeedCooling(g=e["g"], m=e["m"], link=("yoke", "ambient")),
        AcCopperLoss(k=e["ac"]),
        StrayLoadLoss(k=e["stray"]),
        InsulationConductivity(b=e["insulation"], link=("winding", "tooth")),
    )
    return {
        "first order": (lptn.first_order(**p.FIRST), (), p.first_order),
        "second order": (lptn.second_order(**p.SECOND), (), p.second_order),
        "four nodes, five effects": (four, effects, p.four_nodes),
    }


def ours(network, effects, inputs, function) -> dict[str, np.ndarray]:
    """Return temperatures at the edges by node [degC] by `lptn.simulate` or `lptn.reference`."""
    start = {node: jnp.asarray(20.0) for node in network.nodes}
    losses = lptn.CopperLosses(Rs0=jnp.asarray(independent.RS0))
    trace = function(network, losses, inputs, start, effects=effects)
    return {node: np.asarray(T) for node, T in trace.temperature.items()}


NODES = {
    "first order": ("winding",),
    "second order": ("winding", "stator"),
    "four nodes, five effects": ("winding", "tooth", "yoke", "magnet"),
}
"""Order of the nodes in `independent`."""


def gaps(name: str, inputs: lptn.Inputs) -> dict[str, float]:
    """Return the largest differences over nodes and edges [K] between ours and theirs."""
    network, effects, slope = cases()[name]
    edges, drive = plain(inputs)
    start = [20.0] * len(NODES[name])
    theirs = {
        "scipy DOP853": independent.by_scipy(slope, start, edges, drive),
        "diffrax Dopri8": independent.by_diffrax(slope, start, edges, drive),
    }
    result = {}
    for label, function in (("simulate", lptn.simulate), ("reference", lptn.reference)):
        found = ours(network, effects, inputs, function)
        stacked = np.stack([found[node] for node in NODES[name]], axis=1)
        for rival, values in theirs.items():
            result[f"{label} / {rival}"] = float(np.max(np.abs(stacked - values)))
    result["scipy DOP853 / diffrax Dopri8"] = float(
        np.max(np.abs(theirs["scipy DOP853"] - theirs["diffrax Dopri8"]))
    )
    return result
