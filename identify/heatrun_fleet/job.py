"""A fleet from its file to its folder: `machines.parquet`, `timing.json` and `manifest.json`.

The folder grows in place. Parts, one per batch, are written as they are finished; a killed run goes
on from them, and a fleet with further machines works out what is new. In the end the parts are
joined in the order of the fleet file, and the three files take their places together.
"""

import hashlib
import json
import platform
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from heatrun.errors import InputError
from heatrun.io.caches import FolderLock
from heatrun.io.open_file import digest
from heatrun.io.quantities import printed_unit, rounded
from heatrun.io.whole_files import (
    folder_name,
    is_aside,
    moment,
    numbered,
    refuse_replacing,
    together,
    writable,
    write_whole,
)
from heatrun.results.values import to_json
from heatrun.runs.run_folder import environment, refuse_unwritable
from heatrun.work import Progress, Work

from .cluster import Workers, connected, over_workers, require_dask
from .fleet_file import Batch, Fleet, batches_of, digests_of, numerics
from .machine import Done, work_out
from .results import FleetDiscoveryResult
from .rows import FITTED, FOLDER, LOST, Parts, join, read_columns, read_part, schema
from .shared_effects.job import NAME as DISCOVERY
from .shared_effects.job import discover_fleet, read_discovery

FORMAT = "heatrun-fleet/1"
MACHINES, TIMING, MANIFEST = "machines.parquet", "timing.json", "manifest.json"

BATCH = 64
"""Machines in a batch, if nothing is said."""

USUAL_S = 2.0
"""What a machine usually takes [s]; only shares of it matter."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class FleetResult:
    """What a fleet's calibrations left."""

    path: Path  # The folder.
    manifest: dict[str, Any]  # What stands in its `manifest.json`.

    @property
    def machines_path(self) -> Path:
        """The rows of all machines, a Parquet file."""
        return self.path / MACHINES

    def table(self) -> Any:
        """Return the rows of all machines as an Arrow table, as `heatrun_fleet.rows` has them."""
        return read_part(self.machines_path)

    def frame(self) -> Any:
        """Return the rows of all machines as a data frame; lists are arrays."""
        return self.table().to_pandas()

    def discovery(self) -> FleetDiscoveryResult:
        """Return the effects that the machines share, where the fleet was told to `discover`.

        Raises:
            InputError: If it was not, or the file cannot be read.
        """
        return read_discovery(self.path)


def calibrate_fleet_into(
    path: Path,
    fleet: Fleet,
    *,
    workers: Workers = Workers(),  # noqa: B008  it is frozen
    batch: int = BATCH,
    discover: bool = False,
    seed: int = 0,
    command: str = "",
    is_named: bool = True,
    is_replacing: bool = False,
    say: Say = lambda sentence: None,
    progress: Progress | None = None,
) -> FleetResult:
    """Calibrate the machines of a fleet and write its folder.

    As `heatrun.calibrate_fleet`. An unfinished or finished folder of the same fleet is taken up;
    where `path` is not what the user has named, another result gives it a number. The command is
    what stands in the manifest; `say` is told what is being done, `progress` the share done.

    Raises:
        InputError: If pyarrow or dask is needed and not installed, the folder holds something
            else, a file was changed meanwhile, or workers cannot be reached.
        OSError: If the disk is full; what was finished is kept.
    """
    schema()  # before any work: pyarrow may be missing
    if not workers.is_here:
        require_dask()
    refuse_unwritable(path)
    say(f"{fleet.name}: {_count(len(fleet.entries), 'machine')}; taking the digests of their files")
    digests = digests_of(fleet)
    batches = batches_of(fleet, digests, batch, seed=seed, discovers=discover,
                         numerics=numerics(**workers.settings))  # fmt: skip
    identity = _digest([each.name for each in batches])
    if not is_named and not is_replacing:
        path = next(place for place in numbered(path) if not _holds_another(place, identity))
    if _holds_another(path, identity):
        if not _manifest(path):
            raise InputError(
                f"{path} exists and is not the folder of a fleet (it has no {MANIFEST} of one).",
                remedy="Choose another --out.",
            )
        if not is_replacing:
            refuse_replacing(path, "another fleet, or this one with other inputs or settings")
    with writable("the folder of the fleet", path.parent):
        lock = FolderLock.take(path / FOLDER)
    try:
        done = _finished(path, identity)
        if done is not None:
            say(f"{path} holds this fleet already: nothing is left to do")
            return done
        parts = Parts(path / FOLDER)
        _work_out(batches, parts, workers, say=say, progress=progress)
        result = _assemble(path, fleet, batches, parts, digests, identity, command, seed, batch)
        parts.sweep(each.name for each in batches)
    finally:
        lock.release()
    if progress is not None:
        progress("done", 1.0)
    return result


def default_folder(fleet: Fleet) -> Path:
    """Return where a fleet goes if no folder is given: named after it."""
    return Path("results") / "fleets" / (folder_name(fleet.name) or "fleet")


def _work_out(
    batches: Sequence[Batch], parts: Parts, workers: Workers, *, say: Say,
    progress: Progress | None,
) -> None:  # fmt: skip
    """Write the parts that are not there yet."""
    names = {each.name: [e.machine for e in each.entries] for each in batches}
    left = [each for each in batches if not parts.holds(each.name, names[each.name])]
    num = sum(len(each.entries) for each in batches)
    finished = num - sum(len(each.entries) for each in left)
    if len(left) < len(batches):
        say(f"{finished} of {_count(num, 'machine')} were worked out before")
    if not left:
        return
    work = Work({each.name: USUAL_S * len(each.entries) for each in left}, progress)
    changed: list[str] = []

    def done(batch: Batch, result: Done) -> None:
        nonlocal finished
        if result.changed:
            changed.append(result.changed)
            return
        parts.write(batch.name, result.part, result.timing, is_lost=bool(result.lost))
        finished += len(batch.entries)
        work.done(batch.name, f"{finished} of {_count(num, 'machine')}")

    work.at(left[0].name, f"{finished} of {_count(num, 'machine')}")
    with work:
        if workers.is_here:
            for each in left:
                done(each, work_out(each))
        else:
            with connected(workers, len(left)) as pool:
                over_workers(pool, left, done)
    if changed:
        more = f" ({len(changed)} batches)" if len(changed) > 1 else ""
        raise InputError(f"{changed[0]}{more}", remedy="All others were worked out and are kept.")


def _assemble(
    path: Path, fleet: Fleet, batches: Sequence[Batch], parts: Parts, digests: dict[str, str],
    identity: str, command: str, seed: int, size: int,
) -> FleetResult:  # fmt: skip
    """Join the parts and let the files of the result take their places together."""
    places = [
        whole if (whole := parts.path(each.name)).is_file() else parts.lost_path(each.name)
        for each in batches
    ]
    timing = {
        "unit": "s",
        "batches": [
            {"name": each.name, **json.loads(parts.timing_path(each.name).read_bytes())}
            for each in batches
        ],
    }
    with together(path, "fleet") as files:
        join(places, files.aside / MACHINES)
        status = Counter(row["status"] for row in read_columns(files.aside / MACHINES, ["status"]))
        write_whole(files.aside / TIMING, (to_json(timing) + "\n").encode())
        names = (MACHINES, TIMING)
        if batches[0].discovers:
            shared = discover_fleet(files.aside / MACHINES, fleet.name, seed=seed)
            write_whole(files.aside / DISCOVERY, (to_json(shared) + "\n").encode())
            names = (*names, DISCOVERY)
        manifest = {
            "format": FORMAT,
            "fleet": fleet.name,
            "command": command,
            "seed": seed,
            "batch": size,
            "model": fleet.network.name,
            "date": moment().isoformat(timespec="seconds"),
            "platform": platform.system(),
            "machines": {"all": len(fleet.entries), **dict(sorted(status.items()))},
            "inputs": {
                **fleet.inputs,
                "tests and motor files": _digest([f"{k} {v}" for k, v in sorted(digests.items())]),
            },
            "identity": identity,
            "is_whole": not any(place.name.endswith(LOST) for place in places),
            "numerics": dict(batches[0].numerics),
            **environment(),
            "fleet_packages": {name: _version(name) for name in ("pyarrow", "dask", "distributed")},
            "files": {name: digest(files.aside / name) for name in names},
        }
        write_whole(files.aside / MANIFEST, (to_json(manifest) + "\n").encode())
    if DISCOVERY not in names:
        (path / DISCOVERY).unlink(missing_ok=True)  # of a fleet that was replaced
    return FleetResult(path, json.loads(to_json(manifest)))


def _digest(lines: Sequence[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode(errors="backslashreplace")).hexdigest()


def _manifest(path: Path) -> dict[str, Any]:
    """Return the manifest of a fleet's folder; empty where there is none."""
    try:
        content = json.loads((path / MANIFEST).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("format") == FORMAT else {}


def _holds_another(path: Path, identity: str) -> bool:
    """Whether something stands at a path that is no folder of this fleet."""
    if not path.is_dir():
        return path.exists()
    if manifest := _manifest(path):
        return manifest.get("identity") != identity
    # an unfinished one holds nothing but parts
    return not all(entry.name == FOLDER or is_aside(Path(entry.name)) for entry in path.iterdir())


def _finished(path: Path, identity: str) -> FleetResult | None:
    """Return what stands there already, if it is this fleet, whole and undamaged."""
    manifest = _manifest(path)
    if manifest.get("identity") != identity or not manifest.get("is_whole"):
        return None
    try:
        is_sound = all(digest(path / name) == sha for name, sha in manifest["files"].items())
    except (OSError, KeyError, AttributeError):
        return None
    return FleetResult(path, manifest) if is_sound else None


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _count(num: int, what: str) -> str:
    return f"{num} {what}{'' if num == 1 else 's'}"


MOST_NAMED = 10
"""Machines that are named with their reason on the terminal; all stand in the file."""

COLUMNS = ("machine", "type", "status", "findings", "result", "parameters", "parameter_units",
           "parameter_values", "is_converged")  # fmt: skip


def summary(result: FleetResult) -> dict[str, Any]:
    """Return the object that `heatrun fleet --json` prints."""
    rows = read_columns(result.machines_path, COLUMNS)
    done = [row for row in rows if row["status"] == FITTED]
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    units: dict[str, str] = {}
    for row in done:
        units |= dict(zip(row["parameters"], row["parameter_units"], strict=True))
        for name, value in zip(row["parameters"], row["parameter_values"], strict=True):
            values[row["type"]][name].append(value)
    return {
        **{key: result.manifest[key] for key in ("format", "fleet", "model", "machines")},
        "not_converged": [row["machine"] for row in done if not row["is_converged"]],
        "apart": [
            {**{key: row[key] for key in ("machine", "status", "result")},
             "findings": json.loads(row["findings"])}
            for row in rows if row["status"] != FITTED
        ],
        "types": {
            type: {name: _spread(each, units[name]) for name, each in parameters.items()}
            for type, parameters in values.items()
        },
        "run": str(result.path),
    }  # fmt: skip


def summary_text(found: dict[str, Any]) -> str:
    """Return what `summary` gives as plain text for the terminal."""
    machines, apart = found["machines"], found["apart"]
    lines = [
        f"{found['fleet']}: {machines.get(FITTED, 0)} of {machines['all']} machines fitted "
        f"(network: {found['model']})."
    ]
    if names := found["not_converged"]:
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        lines.append(f"Not converged: {', '.join(names[:MOST_NAMED])}{more}.")
    for each in apart[:MOST_NAMED]:
        errors = [f for f in each["findings"] if f["severity"] == "error"]
        why = errors[0] if errors else {"message": each["result"], "where": "", "id": "failed"}
        head = f"{why['where']}: " if why["where"] else ""
        lines.append(
            f"{each['status']:<8} {each['machine']}: {head}{why['message']}  ({why['id']})"
        )
    if len(apart) > MOST_NAMED:
        lines.append(f"         and {len(apart) - MOST_NAMED} more, all in the file.")
    for type, parameters in found["types"].items():
        lines.append(f"\n{'Type ' + type if type else 'All machines'}: median, and 90 % of the "
                     "machines between")  # fmt: skip
        for name, each in parameters.items():
            low, high = each["interval_90"]
            lines.append(f"  {name:<16} {rounded(each['median'], 4):>10}   {rounded(low, 4)} … "
                         f"{rounded(high, 4)} {printed_unit(each['unit'])}".rstrip())  # fmt: skip
    return "\n".join(lines)


def _spread(values: list[float], unit: str) -> dict[str, Any]:
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return {"median": float(middle), "interval_90": [float(low), float(high)], "unit": unit,
            "num_machines": len(values)}  # fmt: skip
