"""Compiled programs that are kept whole from one process to the next, and whether they are right.

JAX's own cache keeps what the compiler made; the next process still traces and lowers each
function, which takes longer than to run it. Here the executable itself is kept, under all that it
was made of: the sources that it may come from, JAX, the processor and its flags, the arguments
that are compiled in, and the shapes of the others. At any doubt about a file it is made anew.

A program is code that runs: only files of the user's own, that nobody else may write, are taken.

Whether compiled sums are right on this machine is asked once per process: NumPy adds the same
numbers. jaxlib 0.10.2 on CPUs joins a small matrix product with the sum behind it. Of more than
16 384 rows in float64, those behind them come out wrong, in silence: with the options of
`heatrun.runtime` and without, on one core and several, with wide and narrow vectors (jax-ml/jax,
issue 39103). `pyproject.toml` excludes that version; this is for environments that have it all the
same, and for others that err alike.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import platform
import re
import stat
import sys
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, wraps
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.experimental.serialize_executable import deserialize_and_load, serialize
from jaxtyping import Array, Float

from ..errors import InputError
from .ahead import taken
from .caches import PROGRAM, PROGRAMS_FOLDER
from .whole_files import whole

R = TypeVar("R")

COUNTS: Counter[str] = Counter()
"""Programs of this process: `compiled`, `loaded` from the folder; not kept are those that are
`nameless`, which no text stands for, and `unwritable`, which JAX cannot write out."""

LEVEL, LEVEL_OF_SELDOM = 1, 0
"""Optimisation of the compiler: a fifth less of its time than by default, and programs that run as
fast; and a third of its time, for programs that run several times as long."""

CACHE_OF_JAX = "jax_enable_compilation_cache"
"""Setting of JAX that has it keep what was compiled."""

UNKEPT: set[str] = set()
"""Why programs could not be written."""

_IMPORT = re.compile(rb"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|[^\n#]*)", re.M)

_MADE: list[dict[Hashable, Callable[..., Any]]] = []


def compiled(
    *static: str, is_seldom: bool = False
) -> Callable[[Callable[..., R]], Callable[..., R]]:
    """Return a decorator that compiles as `jax.jit`, and keeps what is compiled.

    The arguments of the names are hashable and compiled in. What is seldom runs a few times, so
    that compiling takes longer than all of them. Arrays of NumPy are as good as JAX's: nothing is
    compiled to turn one into the other.
    """
    options = {"xla_backend_optimization_level": LEVEL_OF_SELDOM if is_seldom else LEVEL}

    def decorate(function: Callable[..., R]) -> Callable[..., R]:
        signature = inspect.signature(function)
        names = list(signature.parameters)
        places = [place for place, name in enumerate(names) if name in static]
        jitted = jax.jit(function, static_argnames=static)
        programs: dict[Hashable, Callable[[tuple[Any, ...], list[Any]], Any]] = {}
        guard, making = threading.Lock(), dict[Hashable, threading.Lock]()
        _MADE.append(programs)

        @wraps(function)
        def call(*given: Any, **kwargs: Any) -> R:
            if kwargs or len(given) < len(names):
                bound = signature.bind(*given, **kwargs)
                bound.apply_defaults()
                given = bound.args
            fixed = tuple(given[place] for place in places)
            free = tuple(arg for place, arg in enumerate(given) if place not in places)
            leaves, tree = jax.tree.flatten(free)
            if any(isinstance(leaf, Tracer) for leaf in leaves):
                return jitted(*given)
            key = fixed, tree, tuple(map(_kind, leaves))
            if key not in programs:
                with guard:
                    mine = making.setdefault(key, threading.Lock())
                with mine:  # others that want the same one wait for it
                    if key not in programs:
                        programs[key] = _program(function, jitted, given, fixed, free, options)
            return programs[key](free, leaves)

        return call

    return decorate


def forget() -> None:
    """Drop the programs of this process from its memory, as `jax.clear_caches` does with others."""
    for programs in _MADE:
        programs.clear()


def _kind(leaf: Any) -> Hashable:
    """Return what a program depends on of an array or number that is not compiled in."""
    if isinstance(leaf, (jax.Array, np.ndarray, np.generic)):
        return leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)
    return type(leaf)


def _program(
    function: Callable[..., Any],
    jitted: Any,
    given: tuple[Any, ...],
    fixed: tuple[Any, ...],
    free: tuple[Any, ...],
    options: dict[str, int],
) -> Callable[[tuple[Any, ...], list[Any]], Any]:
    """Return the program for some arguments: the one that was kept, or a new one.

    It takes the arguments that are not compiled in, and the arrays and numbers in them.
    """
    folder = os.environ.get(PROGRAMS_FOLDER)
    path = None if not folder else _path(Path(folder), function, fixed, free)
    found = None if path is None else _read(path)
    if found is not None:
        COUNTS["loaded"] += 1
        return found
    program = jitted.lower(*given).compile(options)
    COUNTS["compiled"] += 1
    # what JAX has read from a cache of its own, it writes out without what the compiler made of it
    if path is not None and not getattr(jax.config, CACHE_OF_JAX, True):
        try:
            _write(path, program)
        except OSError as error:
            UNKEPT.add(f"{path.parent}: {error.strerror}")
        except Exception:  # JAX cannot write out every program; this process has it all the same
            COUNTS["unwritable"] += 1
    return lambda free, _: program(*free)


def _path(
    folder: Path, function: Callable[..., Any], fixed: tuple[Any, ...], free: tuple[Any, ...]
) -> Path | None:
    """Return where the program of a function is kept; None if no text stands for an argument."""
    try:
        arguments = f"{_text(fixed, free=False)}\n{_text(free, free=True)}"
    except _Nameless:
        COUNTS["nameless"] += 1
        return None
    name = f"{function.__module__}.{function.__qualname__}"
    made_of = f"{_surroundings()}\n{_sources(function.__module__)}\n{name}\n{arguments}"
    digest = hashlib.sha256(made_of.encode()).hexdigest()
    return folder / f"{name.rpartition('.')[2]}-{digest[:40]}{PROGRAM}"


@cache
def _surroundings() -> str:
    """Return what every program depends on: JAX, the processor, and their flags."""
    parts = [jax.__version__, version("jaxlib"), platform.python_version(), platform.machine()]
    parts += [
        jax.default_backend(),
        str(jax.device_count()),
        str(jax.config.read("jax_enable_x64")),
    ]
    parts += [f"{k}={v}" for k, v in sorted(os.environ.items()) if k.startswith(("XLA_", "JAX_"))
              and k != PROGRAMS_FOLDER]  # fmt: skip
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
        parts += sorted({line for line in lines if line.startswith(("flags", "model name"))})
    return "\n".join(parts)


@cache
def _sources(module: str) -> str:
    """Return a digest of the files that a module of ours may draw on, by what they import."""
    found, left = dict[str, bytes](), [module]
    while left:
        name = left.pop()
        if name not in found and (source := _source(name)) is not None:
            found[name], imported = source
            left += imported
    digest = hashlib.sha256()
    for name, of_file in sorted(found.items()):
        digest.update(f"{name}\n".encode() + of_file)
    return digest.hexdigest()


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]] | None:
    """Return the digest of a module of ours, and the names that it may import; None of others."""
    path = _file_of(module)
    if path is None:
        return None
    source = path.read_bytes()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    return hashlib.sha256(source).digest(), tuple(_imports(source, package))


def _imports(source: bytes, package: str) -> Iterator[str]:
    """Yield the names of modules that a source may import; what is none has no file."""
    for origin, names in _IMPORT.findall(source):
        base = origin.decode()
        dots = len(base) - len(base.lstrip("."))
        if dots:
            parts = package.split(".")
            base = ".".join([*parts[: len(parts) - dots + 1], *filter(None, [base[dots:]])])
        if base:
            yield base
        for name in re.findall(rb"[\w.]+", names):
            yield f"{base}.{name.decode()}" if base else name.decode()


@cache
def _file_of(module: str) -> Path | None:
    """Return the file of a module of ours; None for any other name."""
    top, _, rest = module.partition(".")
    home = sys.modules.get(top)
    if top not in OURS or home is None or home.__file__ is None:
        return None
    place = Path(home.__file__).parent.joinpath(*filter(None, rest.split(".")))
    found = (place / "__init__.py", place.with_suffix(".py"))
    return next((path for path in found if path.is_file()), None)


OURS = ("heatrun", "lptn", "heatrun_fleet", "heatrun_reports", "heatrun_view")


class _Nameless(Exception):
    """No text stands for a value in every process."""


def _text(value: Any, *, free: bool) -> str:
    """Return a text that stands for a value, the same in every process.

    Of arrays and numbers that are free arguments only the kind counts.

    Raises:
        _Nameless: If there is none.
    """
    if isinstance(value, (jax.Array, np.ndarray, np.generic)):
        kind = f"{value.dtype}{value.shape}{getattr(value, 'weak_type', False)}"
        return kind if free else kind + hashlib.sha256(np.asarray(value).tobytes()).hexdigest()
    if free and isinstance(value, (bool, int, float, complex)):
        return type(value).__name__
    if value is None or isinstance(value, (str, bytes, bool, int, float, Enum, PurePath)):
        return repr(value)
    if isinstance(value, type) or inspect.isfunction(value):
        return _definition(value)
    if isinstance(value, Mapping):
        return f"{{{','.join(f'{k!r}:{_text(v, free=free)}' for k, v in value.items())}}}"
    if isinstance(value, (tuple, list)):
        return f"{_definition(type(value))}[{','.join(_text(v, free=free) for v in value)}]"
    if isinstance(value, (set, frozenset)):
        return f"{{{','.join(sorted(_text(v, free=False) for v in value))}}}"
    if hasattr(value, "compiled_as"):
        return f"{_definition(type(value))}{_text(value.compiled_as(), free=False)}"
    if is_dataclass(value):
        parts = [
            _text(getattr(value, f.name), free=free and not f.metadata.get("static"))
            for f in fields(value)
        ]
        return f"{_definition(type(value))}({','.join(parts)})"
    raise _Nameless


@cache
def _definition(value: Any) -> str:
    """Return the name of a class or function; one that is not ours, with a digest of its file."""
    name = f"{value.__module__}.{value.__qualname__}"
    if "<" in name:
        raise _Nameless
    if value.__module__.partition(".")[0] in (*OURS, "builtins"):
        return name
    try:
        return name + hashlib.sha256(Path(inspect.getfile(value)).read_bytes()).hexdigest()
    except (OSError, TypeError) as error:
        raise _Nameless from error


def _read(path: Path) -> Callable[[tuple[Any, ...], list[Any]], Any] | None:
    """Return a program that was kept; None at any doubt about it."""
    found = taken(path, executable)
    if found is None:
        return None
    run, skeleton = found
    try:
        tree = jax.tree.structure(pickle.loads(skeleton))
    except Exception:  # what ever it is, the program can be made anew
        return None
    return lambda _, leaves: jax.tree.unflatten(tree, run(*leaves))


def executable(path: Path) -> tuple[Callable[..., list[Any]], bytes] | None:
    """Return what was compiled, of the arrays and numbers alone that go in and come out, and a
    pickle of what comes out with numbers in their places; None at any doubt about it.

    Nothing is imported.
    """
    try:
        status = path.stat()
        is_mine = not hasattr(os, "getuid") or status.st_uid == os.getuid()
        if not is_mine or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return None
        content = path.read_bytes()
        if hashlib.sha256(content[32:]).digest() != content[:32]:
            return None
        _know_lapack()
        payload, num_in, num_out, skeleton = pickle.loads(content[32:])
        tree_in = jax.tree.structure(((0,) * num_in, {}))
        return deserialize_and_load(payload, tree_in, jax.tree.structure([0] * num_out)), skeleton
    except Exception:  # likewise
        return None


@cache
def _know_lapack() -> None:
    """Lower a factorisation: JAX tells XLA where LAPACK is when it first does so, and a program
    that calls LAPACK before would end the process.
    """
    jax.jit(jax.numpy.linalg.cholesky).lower(np.eye(2))


def _write(path: Path, program: Any) -> None:
    payload, tree_in, tree = serialize(program)
    skeleton = pickle.dumps(jax.tree.unflatten(tree, range(tree.num_leaves)))
    body = pickle.dumps((payload, tree_in.num_leaves, tree.num_leaves, skeleton))
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with whole(path) as partial:
        partial.touch(mode=0o600)  # also where files are made for a group to write
        partial.write_bytes(hashlib.sha256(body).digest() + body)


NUM_ROWS = 20_000
"""Rows of the check: of so many, 3616 come out wrong. Of 16 384 or fewer, and of 48 000 or more,
none were seen to."""

SIZE = 3
"""Rows and columns of its matrix: sums were wrong with 2 to 6 rows and 3, 5 or 6 columns."""

BELOW = 64
"""The numbers are whole and below this: no sum of theirs is rounded, in whatever order it is taken,
in float32 either."""


@cache
def refuse_wrong_sums() -> None:
    """Refuse to go on where sums are wrong; at the start of all that fits, in some 50 ms, once.

    Raises:
        InputError: If compiled sums are not those of NumPy.
    """
    rng = np.random.default_rng(0)
    rows = rng.integers(BELOW, size=(NUM_ROWS, SIZE)).astype(float)
    matrix = np.tri(SIZE)
    found = np.asarray(sums_of_squares(matrix, rows))
    num_wrong = int(np.sum(found != np.sum((rows @ matrix.T) ** 2, axis=1)))
    if num_wrong:
        here = version("jaxlib")
        raise InputError(
            f"jaxlib {here} computes wrong sums on this machine: {num_wrong} of {NUM_ROWS} sums "
            "of squares are not those of NumPy, so no fit could be relied on.",
            remedy=f'Install another version: pip install "jax!={here}" "jaxlib!={here}"',
        )


@compiled()
def sums_of_squares(
    matrix: Float[Array, "sum column"], rows: Float[Array, "row column"]
) -> Float[Array, " row"]:
    """Return, of each row, the sum of squares of a matrix times the row."""
    return jax.vmap(lambda row: jnp.sum((matrix @ row) ** 2))(rows)
