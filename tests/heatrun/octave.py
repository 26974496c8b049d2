"""GNU Octave, for the tests that run an exported script in it."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

OCTAVE = shutil.which("octave-cli")
needs_octave = pytest.mark.skipif(OCTAVE is None, reason="GNU Octave is not installed")


def octave(script: Path | str, home: Path, *options: str, timeout: float = 120, **variables: str):
    """Run a script, and return what it prints."""
    assert OCTAVE is not None
    done = subprocess.run(
        [OCTAVE, "--no-init-file", *options, str(script)],
        capture_output=True, text=True, timeout=timeout, check=False,
        env={**os.environ, "HOME": str(home), "XDG_DATA_HOME": str(home), **variables},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout
