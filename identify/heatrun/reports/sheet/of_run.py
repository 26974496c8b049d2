"""From a run to its parameter sheet and figures."""

from __future__ import annotations

from pathlib import Path

from ...errors import InputError
from ...io.file_set import together
from ...io.free_names import is_other, refuse_replacing
from ...io.whole_files import writable, write_whole
from ...results import to_json
from ...runs.run import Run, open_run
from ...runs.run_folder import MANIFEST, listed_anew
from .content import sheet_content
from .figures import draw
from .pdf import write_pdf
from .xlsx import write_xlsx


def write_sheet(run: Run, folder: Path) -> list[Path]:
    """Write sheet and figures of a run.

    They are made of the files of the run and of nothing else, so that `heatrun sheet` makes the
    same bytes of them at any later time.

    Args:
        run: The run.
        folder: Where they go.
    """
    result = run.result
    names = [(test.name, test.role) for test in result.tests]
    tables = [(*each, table) for each, table in zip(names, run.courses(), strict=True)]
    main = run.choose()
    free = [n for n, e in result.models[main].parameters.items() if not e.fixed]
    values = run.draws(main).values()
    draws = {name: values[name] for name in free}
    units = {
        name: entry.unit
        for model in result.models.values()
        for name, entry in model.parameters.items()
    }
    titles = {name: model.title for name, model in result.models.items()}
    figures = draw(tables, draws, units, titles, folder / "figures")
    write_whole(folder / "sheet.json", (to_json(sheet_content(result)) + "\n").encode())
    return [
        write_pdf(result, figures, folder / "sheet.pdf"),
        write_xlsx(result, tables, folder / "sheet.xlsx"),
        folder / "sheet.json",
        *figures,
    ]


def rewrite_sheet(run: Path, folder: Path, *, is_replacing: bool = False) -> list[Path]:
    """Write the sheet of a run again from its files.

    Args:
        run: The run folder.
        folder: Where the sheet and the figures go: all of them, or none.
        is_replacing: Whether the sheet of another run in `folder` is replaced.

    Raises:
        InputError: If the folder is no run or misses one of its files, or the sheet of another
            run would be lost.
    """
    opened = open_run(run)
    # a damaged file is named before anything is written
    opened.posterior()
    opened.courses()
    try:
        with writable("the sheet", folder), together(folder, "sheet") as files:
            written = write_sheet(opened, files.aside)
            is_own = folder.resolve() == run.resolve()
            if not is_own and not is_replacing:
                _refuse_loss(files.aside, folder)
            if is_own:
                # what stands in the run and in its manifest changes together
                write_whole(files.aside / MANIFEST, listed_anew(run, files.aside))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"the run does not hold what a sheet needs ({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again with this version.",
        ) from error
    return [folder / path.relative_to(files.aside) for path in written]


def _refuse_loss(made: Path, folder: Path) -> None:
    """Refuse to replace the sheet of another run."""
    for name in ("sheet.json", "sheet.pdf", "sheet.xlsx"):
        if is_other(folder / name, (made / name).read_bytes()):
            refuse_replacing(folder / name, "the sheet of another run")
