"""The studies: what each shows, how long it takes, and what it runs.

`make study` lists them, `make study NAME=ordinary` or `make study-ordinary` runs one. Hours are
rough: of one process on two shared cores, compilation included.
"""

import os
import shlex
import subprocess
import sys
from typing import NamedTuple


class Study(NamedTuple):
    """One study: what it shows, its hours, and what Python runs, in the root of the checkout."""

    shows: str
    hours: str
    scripts: tuple[str, ...]


STUDIES = {
    "accidents": Study("accidents of bench records: named, and clean records left alone", "0.5",
        ("tests/studies/accidents.py",)),
    "bodies": Study("measured bodies, powers, heaters, short tests, 1 W to 1 MW", "3",
        ("tests/studies/bodies.py",)),
    "coverage": Study("95 % intervals and bands against the truth of simulated records", "1.5",
        ("tests/studies/coverage_study.py",)),
    "crosschecks": Study("the same posterior by NUTS, fit by SciPy, simulation by diffrax", "0.5",
        ("tests/crosschecks/study.py",)),
    "discovery": Study("hidden causes named by `heatrun discover`", "2.5",
        ("tests/studies/discovery.py --clean 72 --unknown 32 --pairs 32",)),
    "evidence": Study("Laplace's evidence of effects against importance sampling", "0.5",
        ("tests/studies/evidence.py",)),
    "exam": Study("the public set \"Electric Motor Temperature\": FILE=measures_v2.csv, TRAIN=24 "
        "or all", "1 to 12", ("tests/studies/exam.py",)),
    "faults": Study("commands killed, on full disks, short of memory", "1.5",
        ("tests/faults/campaign.py", "tests/faults/memory.py")),
    "first-hour": Study("from five unlike files to a certificate", "0.3",
        ("tests/studies/first_hour.py",)),
    "fleet": Study("populations of simulated fleets against their truth", "1.5",
        ("tests/studies/fleet_one_stage.py", "tests/studies/fleet.py --fleets 12 --machines 200",
         "tests/studies/fleet_noise.py")),
    "fleet-discovery": Study("effects that the machines of a fleet share", "1",
        ("tests/studies/fleet_discovery.py",)),
    "fleet-kills": Study("a fleet whose client and workers are killed at random", "1",
        ("tests/fleet/kills_campaign.py --kills 60",)),
    "fuzz": Study("mutated files, and properties on random examples", "0.5",
        ("-m pytest --hypothesis-profile random -m hypothesis", "tests/fuzz/campaign.py")),
    "misfit": Study("mild causes that the network lacks: told or not", "2.5",
        ("tests/studies/misfit.py",)),
    "observer": Study("the exported observer: its band, broken sensors, false alarms", "0.7",
        ("tests/studies/observer.py", "tests/studies/observer_real.py")),
    "ordinary": Study("ordinary machines with two to four imperfections at once", "4",
        ("tests/studies/ordinary.py --discover 0.33",)),
    "paderborn": Study("parts of one real record against each other, where it is at hand", "0.5",
        ("tests/studies/paderborn.py",)),
    "readings": Study("files made to be hard, each read against its truth", "0.2",
        ("tests/readings/study.py",)),
    "real": Study("real records under ../shared/bench, where they are at hand", "1",
        ("tests/studies/real_records.py",)),
    "shutdown": Study("the winding at switch-off against the truth, and methods by hand", "0.5",
        ("tests/studies/shutdown.py", "tests/studies/shutdown_real.py")),
    "view": Study("the live view on long records", "0.2", ("tests/studies/view_speed.py",)),
}  # fmt: skip


def commands(name: str) -> list[list[str]]:
    """The commands of a study; what the exam is to read comes from the environment."""
    scripts = [shlex.split(script) for script in STUDIES[name].scripts]
    if name == "exam":
        scripts[0].append(os.environ.get("FILE", "measures_v2.csv"))
        scripts[0] += ["--train", os.environ["TRAIN"]] if os.environ.get("TRAIN") else []
    return [[sys.executable, *script] for script in scripts]


def main(names: list[str]) -> int:
    if len(names) != 1 or names[0] not in STUDIES:
        print("make study NAME=…")
        for name, study in STUDIES.items():
            print(f"  {name:16s}{study.shows} ({study.hours} h)")
        return 2 if names else 0
    return next((code for one in commands(names[0]) if (code := subprocess.call(one))), 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
