"""How large the house is: files, lines, rooms, and who imports whom.

    python tests/studies/house.py [--profile] [--tree FOLDER]

A room is a folder with an `__init__.py`. All imports of one room by another are one arrow; those
between a room and one inside it are none, unless upwards: where a module imports what stands behind
it in `ROAD`. Code is what is left of the lines without blanks, comments and docstrings.
`--profile` adds what a `calibrate --quick` of bundled data enters.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import inspect
import io
import os
import sys
import tempfile
import threading
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

ROOT = Path(__file__).parents[2]
FOLDERS = ("models", "identify")
ROAD = (
    "lptn", "heatrun.errors", "heatrun.io", "heatrun.record", "heatrun.motor", "heatrun.results",
    "heatrun.checks", "heatrun.readers", "heatrun.init", "heatrun.model", "heatrun.fit",
    "heatrun.posterior", "heatrun.effects", "heatrun.runs", "heatrun.calibration",
    "heatrun.discovery", "heatrun.reports", "heatrun.simulation", "heatrun.shutdown",
    "heatrun.export", "heatrun.jobs", "heatrun.api", "heatrun.commands",
    "heatrun.cli", "heatrun_fleet", "heatrun_reports", "heatrun_view",
)  # fmt: skip
"""Rooms and modules from the physics to the live view."""


def code_lines(text: str) -> int:
    """Return the number of lines that are neither blank, comment nor docstring."""
    docstrings = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    code = (each for each in tokens if each.string.strip() and each.type != tokenize.COMMENT)
    return len({n for each in code for n in range(each.start[0], each.end[0] + 1)} - docstrings)


def modules_of(tree: Path) -> dict[str, Path]:
    """Return all modules by their dotted names; a package has the name of its folder."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((tree / folder).rglob("*.py")):
            dotted = ".".join(path.relative_to(tree / folder).with_suffix("").parts)
            found[dotted.removesuffix(".__init__")] = path
    return found


def room_of(name: str, path: Path) -> str:
    """Return the room of a module."""
    return name if path.name == "__init__.py" else name.rpartition(".")[0]


def imports(name: str, modules: dict[str, Path]) -> Iterator[str]:
    """Yield the modules of the house that a module imports, inside functions and for types too."""
    here = room_of(name, modules[name]).split(".")
    for node in ast.walk(ast.parse(modules[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = here[: len(here) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                yield inner if inner in modules else source
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def place(name: str) -> int | None:
    """Return where a module stands on the road; None where the road does not say."""
    parts = name.split(".")
    names = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
    return next((ROAD.index(each) for each in names if each in ROAD), None)


def entered(tree: Path) -> str:
    """Return what a quick calibration of bundled data enters, in words."""
    sys.path[:0] = [str(tree / folder) for folder in FOLDERS]
    seen: set[CodeType] = set()

    def see(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            seen.add(frame.f_code)

    threading.setprofile(see)
    sys.setprofile(see)
    from heatrun import cli

    data = tree / "data" / "synthetic"
    words = [str(data / "motor.toml"), str(data / "duty_30min.csv.gz"), "--quick"]
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        code = cli.main(["calibrate", *words, "--out", f"{folder}/run"])
    sys.setprofile(None)
    assert code == 0, "the calibration failed"
    roots = tuple(f"{tree / folder}{os.sep}" for folder in FOLDERS)
    ours = {each for each in seen if each.co_filename.startswith(roots)}
    named = (each for each in ours if each.co_flags & inspect.CO_OPTIMIZED)  # no body of a class
    functions = {(f.co_filename, f.co_qualname) for f in named if not f.co_name.startswith("<")}
    files, loaded = {file for file, _ in functions}, {each.co_filename for each in ours}
    return f"{len(functions)} functions in {len(files)} files; {len(loaded)} files are loaded"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="How large the house is.")
    parser.add_argument("--profile", action="store_true", help="add what a calibration enters")
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout of another commit")
    options = parser.parse_args()
    modules = modules_of(options.tree.resolve())
    rooms = {name: room_of(name, path) for name, path in modules.items()}
    sizes: dict[str, Counter[str]] = {}
    for name, path in modules.items():
        text = path.read_text(encoding="utf-8")
        size = sizes.setdefault(name.partition(".")[0], Counter())
        size.update(files=1, lines=len(text.splitlines()), code=code_lines(text))
        size["rooms"] += path.name == "__init__.py"
    sizes["all"] = sum(sizes.values(), Counter())
    print("| package | files | lines | code | rooms |\n|---|---|---|---|---|")
    for name, size in sizes.items():
        print(f"| {name} | {size['files']} | {size['lines']} | {size['code']} | {size['rooms']} |")
    arrows, upwards = set(), Counter[tuple[str, str]]()
    for name in modules:
        for target in imports(name, modules):
            if target not in modules or rooms[name] == rooms[target]:
                continue
            arrow = rooms[name], rooms[target]
            if not any(a.startswith(f"{b}.") for a, b in (arrow, arrow[::-1])):
                arrows.add(arrow)
            begin, end = place(name), place(target)
            upwards[arrow] += begin is not None and end is not None and begin < end
    upward = sorted(" → ".join(arrow) for arrow, num in upwards.items() if num)
    pairs = sorted(" ↔ ".join(arrow) for arrow in arrows if arrow < arrow[::-1] in arrows)
    print(f"\nArrows between rooms: {len(arrows)}; upwards: {len(upward)}; "
          f"pairs of rooms that import each other: {len(pairs)}.\n")  # fmt: skip
    for each in [
        *(f"upwards: {arrow}" for arrow in upward),
        *(f"mutual: {pair}" for pair in pairs),
    ]:
        print("-", each)
    if options.profile:
        print(f"\nA quick calibration enters {entered(options.tree.resolve())}.")


if __name__ == "__main__":
    main()
