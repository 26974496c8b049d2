"""From readings after switch-off to the winding's temperature at the instant of switch-off."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..record.motor import Motor
    from .result import ShutdownResult


def winding_at_switch_off(
    motor: str | Path | Motor,
    readings: str | Path,
    *,
    run: str | Path | None = None,
    model: str | None = None,
    at: str = "",
    within_K: float | None = None,
    seed: int = 0,
) -> ShutdownResult:
    """Return what `heatrun shutdown` says of a file of readings.

    Args:
        motor: Motor file, or what it says.
        readings: File of resistances, or of a sensor in the winding, over the time since then.
        run: Run folder of this machine, whose time constants are the prior; None for those of
            machines in general.
        model: Network of the run; its last one by default.
        at: Moment of switch-off in the time of the file, such as `"10min"` or `"14:32:05"`; 0 by
            default.
        within_K: Half-width of the 95 % interval of the extrapolation beyond which the temperature
            counts as not determinable [K]; 5 by default.
        seed: Of the draws.

    Raises:
        InputError: If a file cannot be read, or the run's network does not cool.
    """
    from ..motor.file import load_motor
    from ..shutdown.readings import read_readings  # `.readings` would be the argument to pyright
    from .result import WITHIN_K, winding_at_shutdown

    machine = load_motor(Path(motor)) if isinstance(motor, str | Path) else motor
    read = read_readings(Path(readings), machine, at)
    modes = None
    if run is not None:
        from .of_run import modes_of_run

        said = machine.shutdown
        is_turning = said.run_down_s == 0.0 and said.losses_after > 0.0
        modes = modes_of_run(Path(run), read, model, is_turning=is_turning)
    limit = WITHIN_K if within_K is None else within_K
    return winding_at_shutdown(machine, read, modes, within_K=limit, seed=seed)
