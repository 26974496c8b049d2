"""`heatrun view` in full, with a way to queue what its buttons queue and to hear of it.

The command, its signal handling, its queue and its processes are the product's; only the press of
the button is replaced: lines of JSON with the words on stdin, lines with the state on stdout.

    python tests/faults/view_with_jobs.py view DIR --no-browser --port 0 --out RUNS
"""

import json
import sys
import threading
import time
from typing import Any

from heatrun import cli
from heatrun_view import running_jobs as jobs

POLL_S = 0.02
queues: list[jobs.JobQueue] = []
make = jobs.JobQueue.__init__


def kept(self: jobs.JobQueue, *arguments: Any, **keywords: Any) -> None:
    """Make the queue as ever and remember it."""
    make(self, *arguments, **keywords)
    queues.append(self)


def tell(**content: object) -> None:
    """Print a line for the campaign."""
    sys.__stdout__.write(json.dumps(content) + "\n")  # type: ignore[union-attr]
    sys.__stdout__.flush()  # type: ignore[union-attr]


def serve_lines() -> None:
    """Queue each line's words; a line that is `null` cancels the last one."""
    while not queues:
        time.sleep(POLL_S)
    tell(state="ready")
    job = None
    for line in sys.stdin:
        words = json.loads(line)
        if words is None:
            assert job is not None
            queues[0].cancel(job)
            continue
        job = queues[0].submit(words)
        threading.Thread(target=follow, args=(job,), daemon=True).start()


def follow(job: jobs.Job) -> None:
    """Tell how a job goes on until it is over."""
    last = None
    while True:
        pid = job.process.pid if job.process is not None else 0
        now = {"state": job.state, "pid": pid, "said": [*job.lines, job.doing][-40:]}
        if now != last:
            tell(**now)
            last = now
        if job.is_over:
            return
        time.sleep(POLL_S)


if __name__ == "__main__":
    jobs.JobQueue.__init__ = kept  # type: ignore[method-assign]
    threading.Thread(target=serve_lines, daemon=True).start()
    sys.exit(cli.main())
