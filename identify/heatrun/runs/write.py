"""What a run folder holds beside its reports: result, models, draws, motor, courses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from ..attempts import OUTPUT_FAILED, Attempts
from ..io.whole_files import write_whole
from ..posterior.posterior import Posterior
from ..posterior.predict import Prediction
from ..record.motor import Motor
from ..results import FitResult, from_json, to_json
from . import netcdf
from .courses import band_table
from .densities import densities as densities_of
from .motor_text import motor_text
from .run import MOTOR, ModelOfRun, Run, course_name, draws_name, model_name, model_text
from .run_folder import RunFolder
from .verdict import judged


def write_run(
    folder: RunFolder,
    motor: Motor,
    result: FitResult,
    posteriors: Mapping[str, Posterior],
    predictions: Mapping[str, Sequence[Prediction]],
) -> Run:
    """Write everything that `heatrun.open_run` reads into an unfinished run folder.

    Args:
        folder: The folder.
        motor: The machine.
        result: What stands in `fit.json`.
        posteriors: By name of the network.
        predictions: By name of the network, one per test.

    Returns:
        The run as it is in its unfinished folder.

    Raises:
        OSError: If a file cannot be written.
    """
    attempts = Attempts(OUTPUT_FAILED)
    write_whole(folder.partial / MOTOR, motor_text(motor))
    for name, posterior in posteriors.items():
        problem = posterior.fit.problem
        found = ModelOfRun(problem.model, problem.parameters)
        write_whole(folder.partial / model_name(name), model_text(found))
        path = folder.partial / draws_name(name)
        # a quick run is for a look
        densities = None
        if posterior.method == "emcee":
            densities = attempts.of(
                "the pointwise log likelihood", partial(densities_of, posterior), None, where=name
            )
        netcdf.write(posterior, path, densities)
    for index in range(len(result.tests)):
        table = band_table({name: rows[index] for name, rows in predictions.items()})
        text = table.to_csv(index=False)  # to all digits
        write_whole(folder.partial / course_name(index + 1), text.encode())
    result = judged(replace(result, findings=(*result.findings, *attempts.findings)))
    folder.write_json("fit.json", result)
    # as it will be read, so that a sheet made now and one made later are the same
    read_back = from_json(to_json(result).encode(), FitResult, "fit.json", str(folder.path))
    return Run(folder.partial, read_back, is_finished=False)
