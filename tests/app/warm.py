"""Starts `heatrun` many times for the price of one import, as the live view takes 5 s to import.

    python tests/app/warm.py

Imports what the view does, and then forks for every line of JSON on standard input: `words` are
those after `heatrun`, `environment` its variables, `log` the file of what it prints, `constants`
values by `module:NAME` or `module:Class.NAME` that it finds there instead of its own. The answer is
the number of its process. Asked for the `code` of a number, the answer is the exit code, negative
for a signal, or null while it runs. All of them end with this process, which ends with its
standard input.
"""

import ctypes
import gc
import json
import os
import signal
import sys
import tempfile
from importlib import import_module
from typing import Any

PR_SET_PDEATHSIG = 1


def main() -> int | None:
    """Answer until nobody asks; in a process that was forked, become the command."""
    from heatrun import cli
    from heatrun_view import serving  # noqa: F401

    gc.freeze()
    for line in sys.stdin.buffer:  # read by no thread, so that a fork finds nothing half-read
        asked = json.loads(line)
        if "code" in asked:
            number, status = os.waitpid(asked["code"], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if number else None
        else:
            parent, answer = os.getpid(), os.fork()
            if not answer:
                _become(asked, parent)
                return cli.main()
        print(json.dumps(answer), flush=True)
    return None


def _become(asked: dict[str, Any], parent: int) -> None:
    """Make this process look as if the command had been started by itself."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(1)
    for number, path, how in (
        (0, os.devnull, os.O_RDONLY),
        (1, asked["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC),
    ):
        opened = os.open(path, how, 0o644)
        os.dup2(opened, number)
        os.close(opened)
    os.dup2(1, 2)
    os.environ.clear()
    os.environ.update(asked["environment"])
    tempfile.tempdir = None  # of that environment
    sys.argv = ["heatrun", *asked["words"]]
    for place, value in asked["constants"].items():
        module, name = place.split(":")
        owner, _, name = name.rpartition(".")
        found = import_module(module)
        setattr(getattr(found, owner) if owner else found, name, value)


if __name__ == "__main__":
    sys.exit(main())
