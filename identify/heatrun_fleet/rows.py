"""A machine of a fleet as a row: what its calibration found, in one Arrow schema for all.

The thermal parameters, the network's and those of its effects, stand as parallel lists in the order
of `parameters`. Beside values in their units, each row carries their posterior as a normal law in
the space in which the fit's prior is normal: the natural logarithm for parameters whose
`transforms` entry is `"log"` (of the value in its unit), the value itself for `"linear"`. In that
space the prior is normal too, parameter by parameter: `prior_mean` and `prior_sd`. The
two together give the tests' own evidence back: precision inv(log_covariance) - diag(prior_sd^-2).
All other parameters, those of instruments and starts, are integrated out of `log_covariance`.
Nothing in a row depends on when, where or on how many processes it was worked out.

The rows of a batch are a part: one Parquet file under a name that says what it was made of. A part
is there whole or not at all. Its name is the SHA-256 of inputs, settings and versions, so it is
found again by whoever asks for the same. A part with a machine that workers died on is kept under
another ending, for what it holds, and is worked out again by the next run.
"""

import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from heatrun.errors import InputError
from heatrun.fit.fit_result import RESULT, Fit
from heatrun.io.whole_files import write_whole
from heatrun.model.noise import noise_parameters
from heatrun.model.parameters import Parameter
from heatrun.record.record import Finding
from heatrun.results.values import to_json, to_plain

from .entries import Entry
from .shared_effects.pooled import Evidence

LIST = "list of number"
"""The kind of a column that holds numbers side by side."""

Column = tuple[str, str, str, str]
"""Name, kind, unit and meaning."""

Row = dict[str, Any]


def arrow() -> Any:
    """Return pyarrow.

    Raises:
        InputError: If it is not installed.
    """
    try:
        import pyarrow
    except ImportError as error:
        raise InputError(
            "Fleets are written as Parquet, which needs pyarrow, and it is not installed.",
            remedy='Run: pip install "heatrun[fleet]"',
        ) from error
    return pyarrow


def arrow_schema(columns: Sequence[Column], table_format: str) -> Any:
    """Return the Arrow schema of rows; units and meanings stand in the fields' metadata, name and
    version of the table in the schema's.

    Raises:
        InputError: If pyarrow is not installed.
    """
    pa = arrow()
    text, number = pa.string(), pa.float64()
    kinds = {
        "text": text,
        "truth": pa.bool_(),
        "number": number,
        "count": pa.int64(),
        "map": pa.map_(text, text),
        "list of text": pa.list_(text),
        LIST: pa.list_(number),
        "list of file": pa.list_(pa.struct([("path", text), ("role", text), ("sha256", text)])),
    }
    fields = []
    for name, kind, unit, meaning in columns:
        said = {"meaning": meaning} | ({"unit": unit} if unit else {})
        fields.append(pa.field(name, kinds[kind], metadata=said))
    return pa.schema(fields, metadata={"format": table_format})


def empty_row(columns: Sequence[Column]) -> Row:
    """Return a row that says nothing: empty lists, and no value in any other column."""
    return {name: [] if kind.startswith("list") else None for name, kind, _, _ in columns}


OF_EFFECTS: tuple[Column, ...] = (
    ("effect_parameters", "list of text", "", "with --discover: free parameters that effects are "
     "told from, tests by number in brackets"),
    ("effects", "list of text", "", "likewise: effects that the tests could show, each with a "
     "setting of its shape"),
    ("effect_scale", LIST, "", "amplitude of each effect at a score of 1, in its own unit"),
    ("effect_score", LIST, "1", "derivative of the log likelihood by the scores of "
     "effect_parameters, then of effects"),
    ("effect_information", LIST, "1", "its precision: upper triangle, row by row"),
    ("effect_visible_K", LIST, "K", "what each effect leaves of a refitted network at "
     "a score of 1, root mean square"),
)  # fmt: skip
"""Name, kind, unit and meaning of each column, in order."""


def effect_columns(evidence: Evidence) -> dict[str, Any]:
    """Return the columns of `OF_EFFECTS` in a machine's row."""
    return {
        "effect_parameters": list(evidence.parameters),
        "effects": list(evidence.effects),
        "effect_scale": evidence.scale.tolist(),
        "effect_score": evidence.score.tolist(),
        "effect_information": evidence.information[np.triu_indices(evidence.score.size)].tolist(),
        "effect_visible_K": evidence.visible_K.tolist(),
    }


def evidence_in(row: Mapping[str, Any]) -> Evidence:
    """Return the evidence on effects that a row with the columns of `OF_EFFECTS` holds."""
    score = np.asarray(row["effect_score"], dtype=float)
    half = np.zeros((score.size, score.size))
    half[np.triu_indices(score.size)] = row["effect_information"]
    return Evidence(
        parameters=tuple(row["effect_parameters"]),
        effects=tuple(row["effects"]),
        scale=np.asarray(row["effect_scale"], dtype=float),
        score=score,
        information=half + np.triu(half, 1).T,
        visible_K=np.asarray(row["effect_visible_K"], dtype=float),
    )


FORMAT = "heatrun-fleet-rows/3"

THERMAL = ("network", "effect", "known")
"""Roles of the parameters that a population is made of."""

FITTED, REFUSED, FAILED = "fitted", "refused", "failed"
"""States of a machine: fitted; its rows, files or records do not allow it; the fit led nowhere."""

COLUMNS: tuple[Column, ...] = (
    ("machine", "text", "", "name of the machine, unique in the fleet"),
    ("type", "text", "", "what it is one of; empty if not said"),
    ("covariates", "map", "", "further columns of the fleet file, as texts"),
    ("status", "text", "", "fitted, refused (by its row, files or records) or failed"),
    ("findings", "text", "", "JSON list of id, severity, message, where, remedy, test"),
    ("model", "text", "", "name of the network"),
    ("is_converged", "truth", "", "whether the fit converged"),
    ("result", "text", "", "how the fit ended, in a sentence"),
    ("parameters", "list of text", "", "names of the thermal parameters"),
    ("parameter_units", "list of text", "", "unit of each"),
    ("transforms", "list of text", "", "log or linear: the space of the columns log_… and prior_…"),
    ("parameter_values", LIST, "parameter_units", "most probable value of each"),
    ("parameter_sd", LIST, "parameter_units", "standard deviation of each, to first order"),
    ("log_mean", LIST, "by transforms", "mean of ln(value / unit), or of the value if linear"),
    ("log_covariance", LIST, "by transforms", "covariance, row by row, all else integrated out"),
    ("prior_mean", LIST, "by transforms", "centre of the prior in that space"),
    ("prior_sd", LIST, "by transforms", "its standard deviation; independent parameters"),
    ("others", "list of text", "", "names of the other free parameters: resistance, instruments, "
     "starts, test by test in brackets"),
    ("other_units", "list of text", "", "unit of each"),
    ("other_values", LIST, "other_units", "most probable value of each"),
    ("other_sd", LIST, "other_units", "standard deviation of each, to first order"),
    ("noise", "list of text", "", "names of the parameters of noise and unmodelled heat"),
    ("noise_units", "list of text", "", "unit of each"),
    ("noise_values", LIST, "noise_units", "most probable value of each"),
    ("noise_log_mean", LIST, "1", "mean of ln(value / unit)"),
    ("noise_log_covariance", LIST, "1", "their covariance, row by row"),
    ("noise_prior_mean", LIST, "1", "centre of the prior of ln(value / unit)"),
    ("noise_prior_sd", LIST, "1", "its standard deviation"),
    ("noise_level_K", "number", "K", "standard deviation of the noise of a 20 s mean"),
    ("rmse_K", "number", "K", "root mean square residual of the winding's block means"),
    ("log_evidence", "number", "nat", "marginal likelihood by Laplace's method"),
    ("num_tests", "count", "1", "records that were fitted"),
    ("duration_s", "number", "s", "their length in all"),
    ("num_blocks", "count", "1", "block means that were fitted"),
    ("holdout_tests", "list of text", "", "names of the records that were predicted only"),
    ("holdout_rmse_K", LIST, "K", "root mean square error of each"),
    ("holdout_coverage_95", LIST, "1", "share of its block means inside the 95 % band"),
    ("inputs", "list of file", "", "files: path as in the fleet file, role, SHA-256 (empty: none)"),
    *OF_EFFECTS,
)  # fmt: skip
"""Name, kind, unit and meaning of each column, in order."""


@cache
def schema() -> Any:
    """Return the Arrow schema of the rows; units and meanings stand in the fields' metadata.

    Raises:
        InputError: If pyarrow is not installed.
    """
    return arrow_schema(COLUMNS, FORMAT)


def unfitted(
    entry: Entry, model: str, status: str, findings: Sequence[Finding], inputs: Sequence[Row]
) -> Row:
    """Return the row of a machine without a fit, with its findings and files, and the network's
    name; the status is `REFUSED` or `FAILED`.
    """
    return {
        **empty_row(COLUMNS),
        "machine": entry.machine,
        "type": entry.type,
        "covariates": list(entry.covariates),
        "status": status,
        "findings": findings_text(findings),
        "model": model,
        "is_converged": False,
        "result": next((f.message for f in findings if f.severity == "error"), ""),
        "inputs": list(inputs),
    }


def fitted(
    entry: Entry,
    fit: Fit,
    findings: Sequence[Finding],
    inputs: Sequence[Row],
    *,
    duration_s: float,
    holdout: Sequence[tuple[str, float, float]] = (),
) -> Row:
    """Return the row of a fit.

    Args:
        entry: The machine.
        fit: As `heatrun.fit.fit.fit` gives it.
        findings: Of its rows and records; those of the fit are added.
        inputs: Its files.
        duration_s: Length of the fitted records in all [s].
        holdout: Name, RMSE [K] and coverage [1] of each record that was predicted only.
    """
    is_sound = fit.result is not RESULT.no_start
    row = unfitted(entry, fit.problem.model.name, FITTED if is_sound else FAILED, (), inputs)
    every = [*findings, *fit.findings]
    if not is_sound:
        every.append(Finding("fit_failed", "error", fit.result.value, fit.problem.label))
        return {**row, "findings": findings_text(every), "result": fit.result.value}
    places = [i for i, slot in enumerate(fit.slots) if slot.parameter.role in THERMAL]
    others = [i for i in range(len(fit.slots)) if i not in places]
    kinds = [fit.slots[i].parameter for i in places]
    noise = noise_parameters(fit.problem.model.adequacy)
    num = len(fit.slots)
    return {
        **row,
        "findings": findings_text(every),
        "is_converged": fit.result is RESULT.converged,
        "result": fit.result.value,
        **_values(fit, places, "parameters", "parameter"),
        "transforms": [each.transform for each in kinds],
        "log_mean": _means(kinds, fit.z[places]),
        "log_covariance": _covariance(kinds, fit.covariance[np.ix_(places, places)]),
        "prior_mean": _means(kinds, np.zeros(len(kinds))),
        "prior_sd": [each.sd for each in kinds],
        **_values(fit, others, "others", "other"),
        "noise": [each.name for each in noise],
        "noise_units": [each.unit for each in noise],
        "noise_values": [float(p.value(z)) for p, z in zip(noise, fit.noise_z, strict=True)],
        "noise_log_mean": _means(noise, fit.noise_z),
        "noise_log_covariance": _covariance(noise, fit.covariance[num:, num:]),
        "noise_prior_mean": _means(noise, np.zeros(len(noise))),
        "noise_prior_sd": [each.sd for each in noise],
        "noise_level_K": float(fit.noise.total()),
        "rmse_K": fit.rmse_K(),
        "log_evidence": fit.log_evidence,
        "num_tests": len(fit.problem.tests),
        "duration_s": duration_s,
        "num_blocks": int(np.sum(fit.problem.is_observed)),
        "holdout_tests": [name for name, _, _ in holdout],
        "holdout_rmse_K": [rmse for _, rmse, _ in holdout],
        "holdout_coverage_95": [coverage for _, _, coverage in holdout],
    }


def _values(fit: Fit, places: Sequence[int], names: str, prefix: str) -> Row:
    """Return names, units, values and standard deviations of some of the free parameters."""
    slots = [fit.slots[i] for i in places]
    fitted = fit.values()
    values = [fitted[slot.name] for slot in slots]
    sds = [slot.parameter.sd * float(np.sqrt(fit.covariance[i, i]))
           for i, slot in zip(places, slots, strict=True)]  # fmt: skip
    return {
        names: [slot.name for slot in slots],
        f"{prefix}_units": [slot.parameter.unit for slot in slots],
        f"{prefix}_values": values,
        f"{prefix}_sd": [
            sd * abs(value) if slot.parameter.transform == "log" else sd
            for slot, value, sd in zip(slots, values, sds, strict=True)
        ],
    }


def _means(kinds: Sequence[Parameter], z: np.ndarray) -> list[float]:
    """Return scores in the space of the transforms: logarithms, or values."""
    return [
        float((np.log(each.centre) if each.transform == "log" else each.centre) + each.sd * score)
        for each, score in zip(kinds, z, strict=True)
    ]


def _covariance(kinds: Sequence[Parameter], of_scores: np.ndarray) -> list[float]:
    scale = np.array([each.sd for each in kinds])
    whole = of_scores * scale[:, None] * scale
    return (0.5 * (whole + whole.T)).ravel().tolist()


def findings_text(findings: Sequence[Finding]) -> str:
    """Return findings as JSON text, those that were made twice once."""
    keys = ("id", "severity", "message", "where", "remedy", "test")
    every = [{key: getattr(finding, key) for key in keys} for finding in findings]
    return json.dumps(to_plain([f for i, f in enumerate(every) if f not in every[:i]]),
                      ensure_ascii=False)  # fmt: skip


FOLDER, LOST = "parts", ".lost.parquet"
ROW_GROUP = 512
"""Rows of a group of the joined file; it does not depend on the size of the batches."""


@dataclass(frozen=True)
class Parts:
    """The folder of the parts."""

    folder: Path

    def path(self, name: str) -> Path:
        """Return where the part of a batch is once it is whole."""
        return self.folder / f"{name}.parquet"

    def lost_path(self, name: str) -> Path:
        """Return where the part of a batch is in which a machine was lost."""
        return self.folder / f"{name}{LOST}"

    def timing_path(self, name: str) -> Path:
        """Return where the times of a batch stand."""
        return self.folder / f"{name}.json"

    def write(self, name: str, part: bytes, timing: dict[str, Any], *, is_lost: bool) -> None:
        """Write a part, whole or not at all; the times first, so that each part has them.

        Raises:
            OSError: If it cannot be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self.timing_path(name), (to_json(timing) + "\n").encode())
        write_whole(self.lost_path(name) if is_lost else self.path(name), part)
        if not is_lost:
            self.lost_path(name).unlink(missing_ok=True)

    def holds(self, name: str, machines: Sequence[str]) -> bool:
        """Whether the part of a batch is there, undamaged, with just these machines."""
        path = self.path(name)
        if not path.is_file():
            return False
        try:
            found = read_part(path).column("machine").to_pylist()
        except (OSError, ValueError, KeyError):  # pyarrow's errors are kinds of these
            return False
        return found == list(machines)

    def sweep(self, names: Iterable[str]) -> None:
        """Remove the parts of other batches than these, and pieces of killed processes."""
        ways = (self.path, self.lost_path, self.timing_path)
        kept = {way(name) for name in names for way in ways}
        for path in list(self.folder.iterdir()):
            if path not in kept and path.is_file():
                path.unlink()


def part_bytes(rows: Sequence[Row]) -> bytes:
    """Return rows as a Parquet file: the same bytes for the same rows."""
    return table_bytes([arrow().Table.from_pylist(list(rows), schema=schema())])


def table_bytes(tables: Sequence[Any]) -> bytes:
    """Return tables of rows, in order, as one Parquet file."""
    whole = arrow().concat_tables(tables).combine_chunks()
    held = io.BytesIO()
    with _writer(held) as writer:
        writer.write_table(whole, row_group_size=ROW_GROUP)
    return held.getvalue()


def read_part(source: Path | bytes) -> Any:
    """Return the table of a part.

    Raises:
        OSError: If it is damaged.
    """
    from pyarrow.parquet import ParquetFile

    opened = io.BytesIO(source) if isinstance(source, bytes) else source
    with ParquetFile(opened, page_checksum_verification=True) as file:
        table = file.read()
    if table.schema != schema():
        raise ValueError("the part has other columns")
    return table


def join(paths: Iterable[Path], target: Path) -> None:
    """Write the rows of parts, in order, into one file; memory holds two groups at most."""
    pa = arrow()
    waiting: list[Any] = []
    num = 0
    with _writer(target) as writer:
        for path in paths:
            waiting.append(read_part(path))
            num += waiting[-1].num_rows
            while num >= ROW_GROUP:
                whole = pa.concat_tables(waiting)
                writer.write_table(whole.slice(0, ROW_GROUP).combine_chunks(),
                                   row_group_size=ROW_GROUP)  # fmt: skip
                waiting, num = [whole.slice(ROW_GROUP)], num - ROW_GROUP
        if num:
            writer.write_table(pa.concat_tables(waiting).combine_chunks(), row_group_size=ROW_GROUP)


def read_columns(path: Path, columns: Sequence[str]) -> list[Row]:
    """Return some columns of the rows in a file."""
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        return file.read(columns=list(columns)).to_pylist()


def _writer(target: Any) -> Any:
    from pyarrow.parquet import ParquetWriter

    return ParquetWriter(target, schema(), compression="zstd", write_page_checksum=True)
