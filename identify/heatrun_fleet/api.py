"""What `import heatrun` gives of fleets: `heatrun.calibrate_fleet`."""

from pathlib import Path

from heatrun.model.network_form import NetworkForm

from .cluster import Workers
from .fleet_file import load_fleet
from .job import BATCH, FleetResult, calibrate_fleet_into, default_folder


def calibrate_fleet(
    fleet: str | Path,
    *,
    model: str | NetworkForm | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    batch: int = BATCH,
    scheduler: str = "",
    memory: str = "auto",
    discover: bool = False,
    seed: int = 0,
    force: bool = False,
) -> FleetResult:
    """Calibrate all machines of a fleet, one row each; a bad machine never stops the others.

    Args:
        fleet: Fleet file, or the table of its machines alone (CSV or Parquet).
        model: Network in place of the file's.
        out: The folder; None for one under `results/fleets`, named after the fleet. What was
            finished there is not done again.
        workers: Processes of this machine, 0 for this process; None for one per core. A script
            that starts processes needs `if __name__ == "__main__":` around its work.
        batch: Machines in a batch.
        scheduler: Address of a Dask scheduler that runs already, in place of own processes.
        memory: Memory that a worker may take, such as `"4GB"`.
        discover: Whether effects are sought that the machines of a type share; the result's
            `discovery()` gives them.
        seed: Random seed.
        force: Whether another result in `out` is replaced.

    Returns:
        The folder; `frame()` and `table()` give the rows that `heatrun_fleet.rows` describes.

    Raises:
        InputError: If the fleet file is wrong, or something that is needed is not installed.
    """
    loaded = load_fleet(fleet, model)
    return calibrate_fleet_into(
        default_folder(loaded) if out is None else Path(out), loaded,
        workers=Workers(workers, scheduler, memory), batch=batch, discover=discover, seed=seed,
        command="heatrun.calibrate_fleet", is_named=out is not None, is_replacing=force,
    )  # fmt: skip
