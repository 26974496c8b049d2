"""Every notebook runs from top to bottom, and is stored without outputs."""

import warnings
from pathlib import Path

import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))

each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


@each
def test_no_outputs_are_stored(path):
    book = nbformat.read(path, as_version=4)
    assert len(book.cells) <= 14
    for cell in book.cells:
        assert not cell.get("outputs")


def _marked(path):
    """The one that calibrates nothing runs with the other tests; the others take minutes."""
    marks = [] if path.stem.startswith("06") else [pytest.mark.notebook]
    return pytest.param(path, marks=marks, id=path.stem)


@pytest.mark.parametrize("path", [_marked(path) for path in NOTEBOOKS])
def test_it_runs(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the kernel's own machinery
        from nbclient import NotebookClient

        book = nbformat.read(path, as_version=4)
        NotebookClient(
            book, timeout=400, resources={"metadata": {"path": str(path.parent)}}
        ).execute()
    outputs = [out for cell in book.cells for out in cell.get("outputs", [])]
    assert any("image/png" in out.get("data", {}) for out in outputs)
