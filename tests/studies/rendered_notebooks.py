"""The notebooks with their outputs as Markdown pages: `make notebooks-rendered`.

Runs every notebook from top to bottom in its folder and writes
`results/notebooks/NAME.md` with the figures beside it, so that they can be read where no Python
is. The notebooks themselves are stored without outputs.
"""

import argparse
import base64
import re
import tempfile
import warnings
from pathlib import Path
from typing import Any

import nbformat

HERE = Path(__file__).parents[2]
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
LONGEST = 60
"""Lines of an output that are kept; what is left out is told."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("notebook", nargs="*", type=Path, help="by default all of them")
    parser.add_argument("--out", type=Path, default=Path("results") / "notebooks")
    options = parser.parse_args()
    for path in options.notebook or sorted((HERE / "notebooks").glob("*.ipynb")):
        book = nbformat.read(path, as_version=4)
        executed(book, path.parent)
        options.out.mkdir(parents=True, exist_ok=True)
        text, images = rendered(book, path.stem)
        (options.out / f"{path.stem}.md").write_text(text, encoding="utf-8")
        for name, content in images.items():
            (options.out / name).write_bytes(content)
        print(f"{options.out / path.stem}.md, {len(images)} figures", flush=True)


def executed(book: Any, folder: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the kernel's own machinery
        from nbclient import NotebookClient

        metadata = {"metadata": {"path": str(folder)}}
        NotebookClient(book, timeout=900, resources=metadata).execute()


def rendered(book: Any, name: str) -> tuple[str, dict[str, bytes]]:
    parts = [f"*`notebooks/{name}.ipynb` as it ran: `make notebooks-rendered`.*"]
    images: dict[str, bytes] = {}
    for cell in book.cells:
        source = cell.source.strip()
        if cell.cell_type == "markdown":
            parts.append(source)
            continue
        if not source:
            continue
        parts.append(_fenced(source, "python"))
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                file = f"{name}_{len(images) + 1}.png"
                images[file] = base64.b64decode(data["image/png"])
                parts.append(f"![Figure {len(images)} of this notebook]({file})")
            elif text := output.get("text", data.get("text/plain", "")):
                parts.append(_fenced(_shortened(COLOURS.sub("", text).rstrip()), "text"))
    return "\n\n".join(parts) + "\n", images


def _fenced(text: str, language: str) -> str:
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{text}\n{fence}"


def _shortened(text: str) -> str:
    """Return a text's first lines without this machine's folders, with how many follow."""
    for folder in (str(HERE), tempfile.gettempdir()):
        text = text.replace(folder, "…")
    lines = text.splitlines()
    if len(lines) <= LONGEST:
        return "\n".join(lines)
    return "\n".join([*lines[:LONGEST], f"… {len(lines) - LONGEST} more lines"])


if __name__ == "__main__":
    main()
