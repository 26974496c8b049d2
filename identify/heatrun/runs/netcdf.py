"""The draws of a run as they lie in its files, NetCDF with units in the groups of ArviZ.

They are read as arrays without what made them: xarray reads the same, in ten times the time that it
takes to load h5py. They are written by xarray, and handed to ArviZ, 0.23 and 1.x.

With them go log densities of the draws, for prior sensitivity and leave-one-out cross-validation.
`arviz.loo(run.idata, var_name="winding")` predicts windows of some minutes that are left out, and
`arviz.psens(run.idata)` (0.23) or `arviz.psense_summary(run.idata)` (1.x) tells which parameters
the priors hold and which the data.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ..io.whole_files import stated_moment, write_whole
from ..model.network_form import WINDING
from ..model.parameters import ParameterSet
from ..record.channels import body_name
from ..record.motor import Adequacy

if TYPE_CHECKING:
    from ..model.draws import PlausibleEffect, PlausibleEffects
    from ..posterior.posterior import Posterior

Groups = Mapping[str, Mapping[str, np.ndarray]]
"""Arrays by group and name, those of draws of shape (chain, draw) or (chain, draw, test)."""

ABSENT = -12.0
"""Score of unmodelled heat in a run that was made before there was any: nothing of the loss."""

SIZE = "maybe_missing_size"
"""Name of the sizes of the effects behind each draw."""


def groups_of(data: bytes) -> Groups:
    """Return the draws and what belongs to each of them, from the bytes of a NetCDF file."""
    import h5py

    with h5py.File(io.BytesIO(data)) as file:
        return {
            group: {name: np.asarray(each) for name, each in held.items()}
            for group, held in file.items()
            if group in ("posterior", "sample_stats") and isinstance(held, h5py.Group)
        }


def by_name(groups: Groups) -> dict[str, np.ndarray]:
    """Return the draws of what was free by the name of its slot [their units], shape (draw,)."""
    group = groups["posterior"]
    found = {name: each.ravel() for name, each in group.items() if each.ndim == 2}
    for name, each in group.items():
        if each.ndim == 3:
            tests = group.get(f"test_of_{name}", group.get("test", np.array([])))
            for place, test in enumerate(tests):
                found[f"{name}[{test.decode()}]"] = each[..., place].ravel()
    return found


def vectors(
    groups: Groups, parameters: ParameterSet, adequacy: Adequacy
) -> Float[np.ndarray, "chain draw all"]:
    """Return the scores of parameters and noise of the draws in the groups of a run.

    Args:
        groups: From `groups_of`.
        parameters: What stands in which place.
        adequacy: Prior of the heat.
    """
    group = groups["posterior"]
    from ..model.noise import NOISE, noise_parameters

    columns = []
    for slot in parameters.slots:
        values = np.asarray(group[slot.parameter.name], dtype=float)
        if slot.test is not None:
            held = [s.name for s in parameters.slots if s.parameter.name == slot.parameter.name]
            values = values[..., held.index(slot.name)]
        columns.append(slot.parameter.score(values))
    for parameter in noise_parameters(adequacy):
        if parameter.name in group:
            columns.append(parameter.score(np.asarray(group[parameter.name], dtype=float)))
        else:  # runs of old have no unmodelled heat
            columns.append(np.full(np.shape(group[NOISE[0].name]), ABSENT))
    return np.stack(columns, axis=-1)


def plausible(groups: Groups, effects: tuple[PlausibleEffect, ...]) -> PlausibleEffects | None:
    """Return the effects behind the draws of a run, None where there are none.

    Args:
        groups: From `groups_of`.
        effects: As they stand in the result.
    """
    if not effects:
        return None
    from ..model.draws import PlausibleEffects

    size = np.asarray(groups["sample_stats"][SIZE], dtype=float)
    return PlausibleEffects(effects, size.reshape(-1, len(effects)))


def groups(posterior: Posterior, found: Densities | None = None) -> Any:
    """Return the draws in the groups of ArviZ, as an xarray `DataTree`.

    Group `posterior` holds every free parameter and those of the noise in their units (attribute
    `units`), those that each test has for itself with a dimension `test`, those that only some
    tests have with a dimension `test_of_NAME` over these; `sample_stats` the log density;
    `observed_data` the block means by test; `log_prior` and `log_likelihood` what `densities` says.
    Where the draws are averaged over effects that the network may miss, `sample_stats` says how
    large each is in each draw (0: not there).

    Args:
        posterior: The draws.
        found: From `densities`, which takes seconds; None for no `log_prior` and `log_likelihood`.
    """
    from ..model.noise import noise_parameters

    tests = posterior.fit.problem.tests
    names = [test.name for test in tests]
    of_noise = noise_parameters(posterior.fit.problem.model.adequacy)
    noise = [
        np.asarray(p.value(posterior.vectors[..., i - len(of_noise)]))
        for i, p in enumerate(of_noise)
    ]
    columns = [*posterior.values().values(), *noise]
    variables, dims, coords = _variables(posterior, columns, names)
    observed = {
        f"{body_name(channel)}_{index}": rows
        for index, test in enumerate(tests)
        for channel, rows in zip(
            (WINDING, *test.fitted), test.by_sensor(test.measured), strict=True
        )
    }
    dims |= {name: [f"{name}_block"] for name in observed}
    content = {
        "posterior": variables,
        "sample_stats": {"lp": posterior.log_density, **_plausible(posterior)},
        "observed_data": observed,
    }
    if found is not None:
        of_priors = list(np.moveaxis(found.prior.astype(np.float32), -1, 0))
        content["log_prior"] = _variables(posterior, of_priors, names)[0]
        content["log_likelihood"] = {"winding": found.winding, "dependence": found.dependence}
        coords["window"] = list(found.windows)
        dims["winding"] = ["window"]
    import xarray

    known = dict(zip(("chain", "draw"), map(np.arange, posterior.vectors.shape), strict=False))
    known |= coords

    def dataset(group: str, arrays: Mapping[str, np.ndarray]) -> Any:
        of_draws = () if group == "observed_data" else ("chain", "draw")
        rows = {}
        for name, values in arrays.items():
            more = [f"{name}_dim_{n}" for n in range(np.ndim(values) - len(of_draws))]
            rows[name] = ((*of_draws, *dims.get(name, more)), values)
        used = {dim for axes, _ in rows.values() for dim in axes}
        return xarray.Dataset(rows, {dim: known[dim] for dim in known if dim in used})

    data = xarray.DataTree.from_dict({name: dataset(name, each) for name, each in content.items()})
    _label(data, posterior)
    return data


def write(posterior: Posterior, path: Path, found: Densities | None = None) -> None:
    """Write the groups as NetCDF, whole or not at all; arguments as `groups`.

    Raises:
        OSError: If the file cannot be written.
    """
    write_whole(path, _netcdf(groups(posterior, found)))


def from_bytes(data: bytes) -> Any:
    """Return the groups of the bytes of a NetCDF file, in memory, as an xarray `DataTree`."""
    import xarray

    with xarray.open_datatree(io.BytesIO(data), engine="h5netcdf") as tree:
        return tree.load()


def as_arviz(tree: Any) -> Any:
    """Return groups as ArviZ knows them: `InferenceData` on 0.23, a `DataTree` on 1.x."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # 0.23 announces 1.0 when it is imported
        import arviz
    if int(arviz.__version__.split(".")[0]) >= 1:
        return tree
    return arviz.InferenceData(**{name: group.to_dataset() for name, group in tree.items()})


def _plausible(posterior: Posterior) -> dict[str, np.ndarray]:
    if posterior.plausible is None:
        return {}
    size = posterior.plausible.size
    return {SIZE: size.reshape(*posterior.log_density.shape, size.shape[-1])}


def _netcdf(tree: Any) -> bytes:
    """Return the bytes of a NetCDF file: HDF5 on a full disk ends the process with a fault."""
    packed = {"zlib": True, "complevel": 4}
    encoding = {
        group.path: {str(name): packed for name in group.data_vars} for group in tree.subtree
    }
    return bytes(tree.to_netcdf(engine="h5netcdf", encoding=encoding))


def _variables(
    posterior: Posterior, columns: Sequence[np.ndarray], tests: Sequence[str]
) -> tuple[dict[str, np.ndarray], dict[str, list[str]], dict[str, list[str]]]:
    """Return columns, one for each slot and each of the noise, with dimensions and coordinates."""
    from ..model.noise import NOISE

    slots = posterior.fit.slots
    values = dict(zip((s.name for s in slots), columns[: len(slots)], strict=True))
    variables: dict[str, np.ndarray] = {}
    dims: dict[str, list[str]] = {}
    coords = {"test": list(tests)}
    for slot in slots:
        name = slot.parameter.name
        if slot.test is None:
            variables[name] = values[slot.name]
        elif name not in variables:
            same = [s for s in slots if s.parameter.name == name]
            variables[name] = np.stack([values[s.name] for s in same], axis=-1)
            # an event, or the timing of a slow logger, belongs to some of the tests alone
            held = [tests[s.test] for s in same if s.test is not None]
            dims[name] = ["test" if held == list(tests) else f"test_of_{name}"]
            coords[dims[name][0]] = held
    variables |= dict(zip((p.name for p in NOISE), columns[len(slots) :], strict=True))
    return variables, dims, coords


def _label(data: Any, posterior: Posterior) -> None:
    from ..model.noise import NOISE

    units = {s.parameter.name: s.parameter for s in posterior.fit.slots}
    units |= {parameter.name: parameter for parameter in NOISE}
    group = data["posterior"]
    for name, parameter in units.items():
        group[name].attrs["units"] = parameter.unit
        group[name].attrs["long_name"] = parameter.meaning
    group.attrs["method"] = posterior.method
    group.attrs["verdict"] = posterior.sentence()
    names = ["posterior", "sample_stats", "observed_data"]
    if "log_prior" in data.children:
        data["log_prior"].attrs["meaning"] = PRIOR
        data["log_likelihood"]["winding"].attrs["meaning"] = LEFT_OUT
        data["log_likelihood"]["dependence"].attrs["meaning"] = DEPENDENCE
        names += ["log_prior", "log_likelihood"]
    stated = stated_moment()
    for name in names:
        attributes = data[name].attrs
        attributes.pop("created_at", None)
        if stated is not None:
            attributes["created_at"] = stated.isoformat()


LEFT_OUT = (
    "Log density [nat] of a window of block means given all others and the draw, shape "
    "(chain, draw, window): exact for correlated noise, so loo over it is leave-one-window-out. Of "
    "the network alone, also where the posterior is averaged over effects that it may miss."
)
DEPENDENCE = (
    "Log likelihood of all block means less the sum over the windows [nat]: what windows have in "
    "common, as they share their noise. Both variables together are the log likelihood of a draw."
)
PRIOR = (
    "Log density of each parameter's prior [nat], of its standard score: of the logarithm of the "
    "value where the prior is lognormal."
)


@dataclass(frozen=True)
class Densities:
    """Log densities of draws [nat]."""

    prior: Float[np.ndarray, "chain draw all"]  # Of the score of each parameter and of the noise.
    winding: Float[np.ndarray, "chain draw window"]  # Of each window given all other readings.
    dependence: Float[np.ndarray, "chain draw"]  # Log likelihood less the sum of these.
    windows: tuple[str, ...]  # Test and times of each window, in words.


def densities(posterior: Posterior) -> Densities:
    """Return the log densities of the draws of a posterior.

    Where it is averaged over effects that the network may miss, of the draws of the network alone.
    """
    from ..model.discrepancy import left_out, windows

    posterior = posterior.alone or posterior
    problem = posterior.fit.problem
    cut = windows(problem)
    shape = posterior.vectors.shape
    winding = left_out(problem, cut, posterior.flat).reshape(*shape[:2], -1)
    prior = -0.5 * posterior.vectors**2 - 0.5 * np.log(2 * np.pi)
    likelihood = posterior.log_density - prior.sum(axis=-1)
    names = [
        f"{problem.tests[test].name}, {low:.0f} to {high:.0f} s"
        for test, low, high in zip(cut.test, cut.from_s, cut.to_s, strict=True)
    ]
    # half the size, and 1e-6 nat is nothing
    halved = winding.astype(np.float32)
    return Densities(prior, halved, likelihood - halved.sum(axis=-1, dtype=float), tuple(names))
