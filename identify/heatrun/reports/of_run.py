"""From a run to its parameter sheet and figures."""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
from matplotlib.figure import Figure

from ..errors import InputError
from ..io.texts import LANGUAGES, Texts
from ..io.whole_files import is_other, refuse_replacing, together, writable, write_whole
from ..motor.certificate import stated_in_all
from ..record.findings import OUTPUT_FAILED, Attempts, new_findings
from ..record.motor import LIMIT_DEGC, Certificate, Instrument
from ..results import FitResult, to_json
from ..runs.netcdf import by_name
from ..runs.run import CERTIFICATE, Run, certificate_of, open_run
from ..runs.run_folder import MANIFEST, RunFolder, listed_anew
from ..runs.verdict import favoured, judged
from .content import sheet_content
from .dcc import dcc_text
from .dcc_schema import validate
from .figures import certificate_figure, draw, drawn
from .pdf import aspect_on_page_1, write_pdf
from .xlsx import write_xlsx

DCC = "dcc.xml"
"""Name of the Digital Calibration Certificate."""


@dataclass(frozen=True)
class Sheet:
    """What was written."""

    result: FitResult  # What it says: that of the run, with a finding for each part that failed.
    files: list[Path]  # The files, figures last.


def write_sheet(run: Run, folder: Path, certificate: Certificate | None = None) -> Sheet:
    """Write sheet and figures of a run; a part that fails is left out, with a finding.

    They are made of the files of the run and of nothing else, so that `heatrun sheet` makes the
    same bytes of them at any later time.

    Args:
        run: The run.
        folder: Where they go.
        certificate: What the laboratory states; None for what the run holds.
    """
    result = run.result
    attempts = Attempts(OUTPUT_FAILED)
    names = [(test.name, test.role) for test in result.tests]
    tables = [(*each, table) for each, table in zip(names, run.courses(), strict=True)]
    certified = favoured(result)
    stated = certificate_of(run) if certificate is None else certificate
    say = Texts(stated.language or LANGUAGES[0])
    model = result.models[certified]
    values = by_name(run.arrays(certified))
    draws = {name: values[name] for name, entry in model.parameters.items() if not entry.fixed}
    units = {name: entry.unit for name, entry in model.parameters.items()}
    titles = {name: each.title for name, each in result.models.items()}
    figures = draw(tables, draws, units, titles, certified, say, folder / "figures", attempts)

    def whole() -> FitResult:
        found = new_findings(attempts.findings, result.findings)
        return judged(replace(result, findings=(*result.findings, *found)))

    @cache
    def content(num_failed: int) -> dict[str, Any]:
        """Return the words of the sheet, anew for each part that has failed so far."""
        return sheet_content(whole(), stated, say)

    def first_figure() -> Figure:
        return _first_figure(run, tables, say, aspect_on_page_1(content(len(attempts.findings))))

    first = drawn(first_figure, folder / "figures" / "certificate.png", attempts)
    figures = [*filter(None, [first]), *figures]
    courses = [each for each in figures if each.name.startswith(("certificate", "course_"))]

    parts: dict[str, Callable[[dict[str, Any], Path], Any]] = {
        "sheet.pdf": lambda words, path: write_pdf(words, courses, path),
        "sheet.xlsx": lambda words, path: write_xlsx(result, words, tables, path, say),
        "sheet.json": lambda words, path: write_whole(path, (to_json(words) + "\n").encode()),
    }
    for name, write in parts.items():
        attempts.of(
            "the sheet",
            lambda write=write, name=name: write(content(len(attempts.findings)), folder / name),
            None,
            where=name,
        )
    written = [folder / name for name in parts if (folder / name).exists()]
    return Sheet(whole(), [*written, *figures])


def with_sheet(run: Run, folder: RunFolder) -> FitResult:
    """Write sheet and figures into an unfinished run; return its result, which says what failed."""
    result = write_sheet(run, folder.partial).result
    if result != run.result:
        folder.write_json("fit.json", result)
    return result


def _first_figure(
    run: Run, tables: Sequence[tuple[str, str, pd.DataFrame]], say: Texts, aspect: float
) -> Figure:
    """Return the figure of page 1: the first test that was fitted."""
    result = run.result
    network = favoured(result)
    letter = result.motor.insulation_class
    name, _, table = next((each for each in tables if each[1] == "calibration"), tables[0])
    limits = []
    sink_degC = float(np.nanmean(table["sink_degC"]))
    if permitted := run.motor.permitted_rise(sink_degC):
        text = say("limit_of_rise", letter=permitted[0], K=f"{permitted[1]:.0f}")
        limits.append((text, sink_degC + permitted[1]))
    if letter is not None:
        text = say("limit_of_class", letter=letter, T=f"{LIMIT_DEGC[letter]:.0f}")
        limits.append((text, LIMIT_DEGC[letter]))
    stated = (network, result.models[network].title)
    return certificate_figure(name, table, stated, limits, say, aspect)


def rewrite_sheet(
    run: Path,
    folder: Path,
    meta: Path | None = None,
    *,
    language: str = "",
    with_dcc: bool = False,
    schema: Path | None = None,
    is_replacing: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Write the sheet of a run again from its files.

    Args:
        run: The run folder.
        folder: Where the sheet and the figures go: all of them, or none.
        meta: File with the keys of `[certificate]`, before what the motor file says; the run keeps
            them where the sheet is written into it. None for what the run holds.
        language: Of the sheet; empty for that which the run holds. The run keeps it where the
            sheet is written into it.
        with_dcc: Write the Digital Calibration Certificate too; always where the run that the
            sheet is written into has one.
        schema: `dcc.xsd` to validate it with; None for no validation.
        is_replacing: Whether the sheet of another run in `folder` is replaced, and what the run was
            told before by what `meta` says.
        tell: Told which files held something else before.

    Raises:
        InputError: If the folder is no run, or misses one of its files; if something is not given
            that a Digital Calibration Certificate must say, or it violates the schema; if the
            sheet of another run would be lost, or something that this one was told.
    """
    opened = open_run(run)
    told = certificate_of(opened) if meta is None else opened.motor.certificate
    certificate = stated_in_all(told, meta, language)
    is_own = folder.resolve() == run.resolve()
    if is_own and meta is not None and not is_replacing:
        _refuse_other_words(certificate_of(opened), certificate, folder)
    document = None
    if with_dcc or schema is not None or (is_own and DCC in opened.manifest["files"]):
        document = dcc_text(opened.result, certificate)
    if document is not None and schema is not None:
        validate(document, schema)
    # a damaged file is named before anything is written
    opened.arrays()
    opened.courses()
    try:
        with writable("the sheet", folder), together(folder, "sheet") as files:
            sheet = write_sheet(opened, files.aside, certificate)
            written = sheet.files
            for finding in new_findings(sheet.result.findings, opened.result.findings):
                tell(finding.sentence())
            if document is not None:
                write_whole(files.aside / DCC, document)
                written.append(files.aside / DCC)
            if not is_own and not is_replacing:
                _refuse_loss(files.aside, folder)
            replaced = [
                name
                for name in (str(path.relative_to(files.aside)) for path in written)
                if is_other(folder / name, (files.aside / name).read_bytes())
            ]
            if is_own:
                if meta is not None or language:
                    text = tomli_w.dumps(certificate.as_section()).encode()
                    write_whole(files.aside / CERTIFICATE, text)
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
    if replaced:
        tell(f"replaced in {folder}: {', '.join(sorted(replaced))}")
    return [folder / path.relative_to(files.aside) for path in written]


def _refuse_loss(made: Path, folder: Path) -> None:
    """Refuse to replace the sheet of another run."""
    for name in ("sheet.json", "sheet.pdf", "sheet.xlsx"):
        if (made / name).exists() and is_other(folder / name, (made / name).read_bytes()):
            refuse_replacing(folder / name, "the sheet of another run")


def _refuse_other_words(told: Certificate, new: Certificate, folder: Path) -> None:
    """Refuse to let a certificate say otherwise, or less; blank lines may be filled in."""
    changes = [
        f"{key} {_shown(before)} would {f'become {_shown(after)}' if after else 'be left out'}"
        for key, (before, after) in told.lost_to(new).items()
    ]
    if changes:
        raise InputError(
            f"the sheet of this run says otherwise: {', '.join(changes)}; it is left as it is.",
            where=str(folder),
            remedy="Write the other sheet elsewhere with --out DIR, or pass --force to replace "
            "this one.",
        )


def _shown(value: str | tuple[Instrument, ...]) -> str:
    if isinstance(value, str):
        return f"'{value}'"
    return f"'{'; '.join(' '.join(filter(None, astuple(one))) for one in value)}'"
