import json
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def outcomes(request, tmp_path_factory):
    """What the script of a file of tests prints, which kills before each file operation."""
    script = Path(__file__).with_name(request.module.SCRIPT)
    words = [sys.executable, str(script), str(tmp_path_factory.mktemp("kills"))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
