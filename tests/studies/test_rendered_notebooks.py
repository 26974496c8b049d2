"""Notebooks as pages: what a cell printed and drew stands under it."""

import base64

from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from rendered_notebooks import HERE, LONGEST, rendered

PNG = b"\x89PNG of a figure"


def test_text_figures_and_fences():
    many = "\n".join(f"row {n}" for n in range(LONGEST + 5))
    book = new_notebook(
        cells=[
            new_markdown_cell("# Title"),
            new_code_cell(
                "print(1)",
                outputs=[
                    new_output("stream", text=f"\x1b[31mred\x1b[0m {HERE}/results\n```\n"),
                    new_output(
                        "display_data",
                        data={"image/png": base64.b64encode(PNG).decode(), "text/plain": "<Fig>"},
                    ),
                ],
            ),
            new_code_cell("many", outputs=[new_output("stream", text=many)]),
            new_code_cell(""),
        ]
    )
    text, images = rendered(book, "book")
    assert "# Title\n\n```python\nprint(1)\n```\n\n````text\nred …/results\n```\n````" in text
    assert "![Figure 1 of this notebook](book_1.png)" in text
    assert "<Fig>" not in text
    assert images == {"book_1.png": PNG}
    assert f"row {LONGEST - 1}\n… 5 more lines\n" in text
    assert text.count("```python") == 2
