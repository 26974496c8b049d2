"""How large the house is: files, lines and rooms; who may import whom, `lint-imports` holds.

    python tests/studies/house.py [--profile] [--tree FOLDER]

A room is a folder with an `__init__.py`. Code is what is left of the lines without blanks, comments
and docstrings. `--profile` adds what a `calibrate --quick` of bundled data enters.
"""

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
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

ROOT = Path(__file__).parents[2]
FOLDERS = ("models", "identify")


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


def entered(tree: Path) -> str:
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
    parser = argparse.ArgumentParser(description="How large the house is.")
    parser.add_argument("--profile", action="store_true", help="add what a calibration enters")
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout of another commit")
    options = parser.parse_args()
    modules = modules_of(options.tree.resolve())
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
    if options.profile:
        print(f"\nA quick calibration enters {entered(options.tree.resolve())}.")


if __name__ == "__main__":
    main()
