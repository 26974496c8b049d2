"""A small run that is killed before each of its file operations in turn, in processes of its own.

`started.Hook` hears of every opening, renaming, making and removing of a file before it happens;
the n-th is where SIGKILL comes. Nothing here loads JAX, so forking is safe, and each
kill costs milliseconds.
"""

import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path

import emcee
import numpy as np
from started import Hook, Strike
from wholeness import differs_from_manifest, files_of

from heatrun.posterior.ensemble import Checkpoint
from heatrun.runs.run_folder import MANIFEST, RunFolder

NUM_CHUNKS = 3
IDENTITY = {"motor": "m", "seed": 1}


def small_run(path: Path, text: str) -> list[int]:
    """Do what a calibration does with its folder; return the chunks that were taken up."""
    folder = RunFolder.begin(path, IDENTITY | {"text": text}, is_replacing=True)
    checkpoint = Checkpoint(folder.checkpoints, "key")
    taken = len(checkpoint.load())
    for number in range(taken, NUM_CHUNKS):
        state = emcee.State(
            np.full((4, 2), number, dtype=float),
            log_prob=np.zeros(4),
            random_state=np.random.RandomState(number).get_state(),
        )
        checkpoint.save(number, np.full((5, 4, 2), number, dtype=float), np.zeros((5, 4)), state)
    chunks = checkpoint.load()
    folder.write_json("fit.json", {"text": text, "chain": [c["chain"].sum() for c in chunks]})
    (folder.partial / "figures").mkdir(exist_ok=True)
    folder.write_json("figures/course.json", {"text": text})
    folder.finish({"text": text})
    return [taken]


def in_child(job) -> int:
    """Run a job in a process of its own and return the status that it ended with."""
    child = os.fork()
    if child == 0:
        try:
            job()
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def tell(
    folder: Path, begin: Callable[[Path, str | None], None], work: Callable[[Path], object],
    seen: Callable[[Path], dict],
) -> None:  # fmt: skip
    """Begin a home and work in it, killed before its n-th file operation, until it is not killed.

    With and without something earlier at the place. Prints the status that the work ended with in
    each turn, and what is seen then.
    """
    outcomes = []
    for earlier in (None, "old"):
        for number in count(1):
            home = folder / f"{earlier}_{number}"
            begin(home, earlier)

            def killed(home=home, last=number):
                strike = Strike(signal.SIGKILL, "operation", operation=last)
                sys.addaudithook(Hook(home, os.open(os.devnull, os.O_WRONLY), strike, 0))
                work(home)

            status = in_child(killed)
            turn = {"earlier": earlier, "operation": number, "status": status}
            outcomes.append(turn | seen(home))
            shutil.rmtree(home)
            if status != -signal.SIGKILL:
                break
    print(json.dumps(outcomes))


def state_of(path: Path) -> str:
    """Return whose whole run lies at a place, `"nothing"`, or `"torn"`."""
    if not path.exists():
        return "nothing"
    if differs_from_manifest(path):
        return "torn"
    manifest = json.loads((path / MANIFEST).read_text())
    is_whole = files_of(path).keys() - {MANIFEST} == manifest["files"].keys()
    return manifest["text"] if is_whole else "torn"


def begin(home: Path, earlier: str | None) -> None:
    """Leave an earlier run at the place, or nothing."""
    if earlier is not None:
        small_run(home / "run", earlier)


def seen(home: Path) -> dict:
    """Look at a run after its turn, and do the same again."""
    path = home / "run"
    return {
        "after": state_of(path),
        "chunks": len(list((home / "run.partial").rglob("chunk_*.npz"))),
        "resumed": in_child(lambda: small_run(path, "new")),
        "finally": state_of(path),
        "left": sorted(p.name for p in home.iterdir()),
        "fit": (path / "fit.json").read_text(),
    }


if __name__ == "__main__":
    tell(Path(sys.argv[1]), begin, lambda home: small_run(home / "run", "new"), seen)
