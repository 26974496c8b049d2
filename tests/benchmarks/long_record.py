"""A record of a million samples from the file to weighted draws, in a process of its own.

    python tests/benchmarks/long_record.py MOTOR.toml FILE.csv

Prints the peak memory [MB] after each stage as one JSON object. No ensemble: whether the guard of
the weighted draws holds is a matter of the record, and an ensemble would decide the time.
"""

import json
import sys
from pathlib import Path

from heatrun.checks import check_record
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import weighted_draws
from heatrun.posterior.predict import predict
from heatrun.readers.joined import read_test
from heatrun.record.reduction import reduce


def main() -> None:
    peaks = {}

    def note(stage: str) -> None:
        # not ru_maxrss, which a new process takes over from the one that started it
        status = Path("/proc/self/status").read_text()
        peaks[stage] = int(status.split("VmHWM:")[1].split()[0]) / 1024

    motor = load_motor(Path(sys.argv[1]))
    note("imports")
    record = read_test(Path(sys.argv[2]), motor)
    note("reading")
    check_record(record, motor)
    note("checks")
    blocks = reduce(record, motor)
    note("reduction")
    found = fit(Problem.of(Model.of("second", motor), motor, [blocks]))
    note("fit")
    draws = weighted_draws(found)
    note("draws")
    predict(draws, blocks)
    note("bands")
    print(json.dumps(peaks))


if __name__ == "__main__":
    main()
