"""A set of files that is killed before each of its file operations in turn; see `kill_points`."""

import sys
from pathlib import Path

from kill_points import in_child, tell

from heatrun.io.whole_files import READY, names_begun, together

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


def begin(folder: Path, earlier: str | None) -> None:
    """Leave a foreign file at the place, and an earlier set or none."""
    (folder / FOREIGN).parent.mkdir(parents=True)
    (folder / FOREIGN).write_text("mine")
    if earlier is not None:
        write(folder, earlier)


def start(folder: Path) -> None:
    """Begin another set, which ends or drops what a kill has left."""
    with together(folder, "another"):
        assert names_begun(folder, "report") == []


def seen(folder: Path) -> dict:
    """Look at a set after its turn, and at what the next start makes of it."""
    return {
        "after": words_in(folder),
        "is_ready": any(path.name.endswith(READY) for path in folder.iterdir()),
        "started": in_child(lambda: start(folder)),
        "settled": words_in(folder),
        "left": sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()),
        "hidden": [path.name for path in folder.iterdir() if path.name[0] == "."],
    }


if __name__ == "__main__":
    tell(Path(sys.argv[1]), begin, lambda folder: write(folder, "new"), seen)
