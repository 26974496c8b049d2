"""A set of files that is killed before each of its file operations in turn; see `kill_points`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from kill_points import in_child, killed_in_turn

from heatrun.io.file_set import READY, names_begun, together

NAMES = ("table.csv", "figures/one.png", "figures/two.png", "report.json", "report.pdf")
FOREIGN = "figures/mine.txt"


def write(folder: Path, text: str) -> None:
    """Write a set whose every file holds the same text."""
    with together(folder, "report") as files:
        for name in NAMES:
            path = files.aside / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)


def words_in(folder: Path) -> list[str | None]:
    """Return what each file of the set holds; None where it is not there."""
    paths = [folder / name for name in NAMES]
    return [path.read_text() if path.is_file() else None for path in paths]


def main(home: Path) -> None:
    """Kill at every operation, with and without an earlier set at the place; print what came."""
    outcomes = []
    for earlier in (None, "old"):

        def begin(folder, earlier=earlier):
            (folder / FOREIGN).parent.mkdir(parents=True)
            (folder / FOREIGN).write_text("mine")
            if earlier is not None:
                write(folder, earlier)

        turns = killed_in_turn(home, str(earlier), begin, lambda folder: write(folder, "new"))
        for folder, _, status in turns:

            def start(folder=folder):
                with together(folder, "another"):
                    assert names_begun(folder, "report") == []

            outcomes.append(
                {
                    "earlier": earlier,
                    "status": status,
                    "after": words_in(folder),
                    "is_ready": any(path.name.endswith(READY) for path in folder.iterdir()),
                    "started": in_child(start),
                    "settled": words_in(folder),
                    "left": sorted(
                        str(path.relative_to(folder))
                        for path in folder.rglob("*")
                        if path.is_file()
                    ),
                    "hidden": [path.name for path in folder.iterdir() if path.name[0] == "."],
                }
            )
    print(json.dumps(outcomes))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
