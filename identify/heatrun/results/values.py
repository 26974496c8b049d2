"""What all results share: their text in JSON, values of many fields, the uncertainty budget of GUM.

There is one writer and one reader of JSON for all of them.

In a budget every source stands with its uncertainty, its sensitivity and its share.
The sources are what stands behind an estimate and is independent of all else: the scatter of the
readings, and how far each prior mean (a stated instrument, a usual size) may be off. For an
estimate that is linear in these the budget is exact. With the Jacobian $J$ of the readings over
their scatter and $g$ of the answer, both by standard normal numbers, and $S = (1 + J^T J)^{-1}$,
the mean of number $i$ moves the answer by $(S g)_i$ and the scatter by $|J S g|$; their squares
add up to $g^T S g$.

What the readings themselves tell of a source is taken into account: its share is what its prior
mean still moves, not what would go if it were known exactly. The two are one where the readings
tell nothing of it, as of most instruments.

Reference: JCGM 100:2008 (GUM), 4.3 and 5.1.2.
"""

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from ..errors import InputError

T = TypeVar("T")


def to_json(content: Any) -> str:
    """Return JSON text; numbers that are not finite become null, arrays lists.

    Args:
        content: A result, or mappings, sequences, arrays and results in one another. Fields of a
            result that are unset are left out.
    """
    return json.dumps(to_plain(content), indent=1, ensure_ascii=False, allow_nan=False)


def from_json(content: bytes, kind: type[T], name: str, where: str) -> T:
    """Return a result from the JSON text of its file.

    Keys that the type does not know are passed over: a later version may have written them.

    Args:
        content: The file.
        kind: Type of the result, with a field `format` of one possible value.
        name: Name of the file in its run, for errors.
        where: The run, for errors.

    Raises:
        InputError: If it is no JSON, of another format, or a field is missing or ill-typed; the
            field is named by its path.
    """
    try:
        found = msgspec.json.decode(content)
        (expected,) = get_args(get_type_hints(kind)["format"])
        if not isinstance(found, dict) or found.get("format") != expected:
            raise InputError(
                f"{name} is of another format than {expected}.",
                where=where,
                remedy="Calibrate again with this version.",
            )
        return msgspec.convert(found, kind)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{name} of the run cannot be read ({error}).",
            where=where,
            remedy="Calibrate again with this version.",
        ) from error


def to_plain(value: Any) -> Any:
    """Return mappings, lists, texts and finite numbers; arguments as `to_json`."""
    if isinstance(value, str):
        # bytes of a file name that are no UTF-8 are carried as halves of characters
        return value.encode(errors="backslashreplace").decode()
    if isinstance(value, Mapping):
        return {to_plain(str(key)): to_plain(item) for key, item in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return {k: to_plain(item) for k, item in fields.items() if item is not msgspec.UNSET}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


Interval = tuple[float, float]
"""Lower and upper limit of a 95 % interval [unit of the value]."""

NonNegative = Annotated[float, Meta(ge=0)]
"""A number that cannot be below 0."""

Probability = Annotated[float, Meta(ge=0, le=1)]
"""A probability or a share [1]."""

Count = Annotated[int, Meta(ge=0)]
"""A number of things."""

Role = Literal["calibration", "holdout"]
"""Whether a test was fitted or only predicted."""


def number(value: float | None) -> float:
    """Return a number of a result, NaN where the file holds null: it was not finite."""
    return math.nan if value is None else value


def known(value: T | UnsetType) -> T | None:
    """Return what a field of a result says, None where it is unset."""
    return None if value is UNSET else value


Type = Literal["A", "B"]
"""How a source is evaluated: by the scatter of the readings, or otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetRow:
    """One source of the uncertainty."""

    source: str  # In words.
    type: Type  # A for what the scatter of the readings brings, B for what a prior mean does.
    unit: str  # Of the source; empty where several numbers stand behind it.
    # Of the source alone [unit]; null where it has no unit.
    standard_uncertainty: NonNegative | None
    sensitivity: float | None  # Of the answer to one unit [its unit per unit]; null likewise.
    contribution: NonNegative  # Standard uncertainty that it brings to the answer [its unit].
    share: Probability  # Of the variance [1].


class Part(NamedTuple):
    """What a source brings."""

    source: str  # In words.
    type: Type  # As `BudgetRow.type`.
    moves: float  # By how much the answer moves with one standard uncertainty of the source.
    # Standard uncertainty of the source [unit]; None where several numbers stand behind it.
    sd: float | None = None
    unit: str = ""  # Of the source.


def budget(parts: Iterable[Part]) -> tuple[BudgetRow, ...]:
    """Return the budget of what independent sources bring, the largest first."""
    parts = list(parts)
    whole = math.hypot(*(part.moves for part in parts)) or 1.0
    rows = [
        BudgetRow(
            source=part.source,
            type=part.type,
            unit=part.unit,
            standard_uncertainty=part.sd,
            sensitivity=part.moves / part.sd if part.sd else None,
            contribution=abs(part.moves),
            share=min(1.0, (part.moves / whole) ** 2),
        )
        for part in parts
    ]
    return tuple(sorted(rows, key=lambda row: -row.share))


def combined(rows: Iterable[BudgetRow]) -> float:
    """Return the standard uncertainty to first order, the root of the sum of a budget."""
    return math.hypot(*(row.contribution for row in rows))
