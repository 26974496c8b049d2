"""Results as JSON text and back: one writer and one reader for all of them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np

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
