"""A heatrun command in a process of its own, and what it took."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]

# what the children of a process have taken is known to their parent only
MEASURE = """
import json, resource, subprocess, sys, time
begin = time.perf_counter()
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
wall = time.perf_counter() - begin
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps({"code": done.returncode, "said": done.stderr[-2000:], "wall_s": wall,
                  "processor_s": used.ru_utime + used.ru_stime, "peak_MB": used.ru_maxrss / 1024}))
"""


@dataclass(frozen=True)
class Measured:
    """What a command took: by the clock and of all processors [s], and its largest process [MB]."""

    wall_s: float
    processor_s: float
    peak_MB: float


def heatrun(words: list[str], cache: Path) -> Measured:
    """Run a command to its end."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, sys.executable, "-m", "heatrun.cli", *words],
        check=True, capture_output=True, text=True, cwd=ROOT, env=environment(cache),
    )  # fmt: skip
    found = json.loads(done.stdout)
    code, said = found.pop("code"), found.pop("said")
    if code != 0:
        raise RuntimeError(f"heatrun {' '.join(words)} ended with code {code}: {said}")
    return Measured(**found)


def environment(cache: Path) -> dict[str, str]:
    paths = os.pathsep.join(str(ROOT / part) for part in ("identify", "models"))
    own = {**os.environ, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(cache),
           "OPENBLAS_NUM_THREADS": "1"}  # fmt: skip
    own.pop("JAX_COMPILATION_CACHE_DIR", None)
    return own
