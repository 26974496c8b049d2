"""The bundled data are what their descriptions say, and can be made again."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("name", ["thesis"])
def test_checksums_of_the_description_hold(name: str) -> None:
    folder = DATA / name
    stated = dict(
        re.findall(
            r"\| `([^`]+)` \| `([0-9a-f]{64})` \|", (folder / "README.md").read_text("utf-8")
        )
    )
    assert set(stated) == {path.name for path in folder.glob("*.*")} - {"README.md"}
    for file, digest in stated.items():
        assert hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest, file
