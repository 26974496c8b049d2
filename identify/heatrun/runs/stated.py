"""What the laboratory states of a run, beside its results."""

from __future__ import annotations

from ..certificate import Certificate
from ..certificate_file import parse_meta
from .run import Run

CERTIFICATE = "certificate.toml"
"""What `heatrun sheet --meta` stated of a run; it goes before what its motor file says."""


def certificate_of(run: Run) -> Certificate:
    """Return what `[certificate]` of the motor file and later `--meta` said of a run.

    Args:
        run: The run.

    Raises:
        InputError: If a file of the run is damaged or was changed.
    """
    if not run.is_finished or CERTIFICATE not in run.manifest["files"]:
        return run.motor.certificate
    stated = parse_meta(run.file(CERTIFICATE), str(run.path / CERTIFICATE))
    return run.motor.certificate.beneath(stated)
