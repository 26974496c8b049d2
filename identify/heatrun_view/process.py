"""A command of the page, which ends when the server does, however the server ended.

Run as `python -m heatrun_view.process WORDS…`; the words are those after `heatrun`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

from heatrun.cli import main

from .running_jobs import SERVER

LOOK_S = 0.5


def _end_with(server: int) -> None:
    """End this process and what it has started, once its server is gone."""
    while os.getppid() == server:
        time.sleep(LOOK_S)
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    asked = os.environ.pop(SERVER, "")
    if asked.isdigit():
        threading.Thread(target=_end_with, args=(int(asked),), daemon=True).start()
    sys.exit(main())
