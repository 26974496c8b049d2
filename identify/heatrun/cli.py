"""The command line: parse, call one function, print."""

import argparse
import io
import os
import shlex
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from importlib import import_module

from .commands import COMMANDS, all_commands
from .commands.console import DONE, INTERRUPTED, NOT_ALLOWED, SENTENCE, WRONG_USE, ends_at_once
from .commands.words import AnyOrder
from .errors import InputError, UsageError, of_file
from .io.caches import use_caches
from .io.whole_files import check_stated_moment
from .runtime import (
    collect_garbage_seldom,
    leave_garbage_at_the_end,
    one_thread_for_small_matrices,
    share_one_heap,
)
from .version import __version__


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: The words after `heatrun`; those of the process if None.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    with ends_at_once():
        parser = _parser(words[0] if words else "")
        if not words:  # whoever types the bare name wants to know what there is
            parser.print_help(sys.stderr)
            return WRONG_USE
        options = parser.parse_args(words)
        options.command_line = shlex.join(["heatrun", *words])
    # a command that serves until it is stopped says `set_defaults(handles_interrupt=True)`
    handles_interrupt = getattr(options, "handles_interrupt", False)
    is_last = arguments is None
    if is_last:
        leave_garbage_at_the_end()
    with nullcontext() if handles_interrupt else ends_at_once(is_last=is_last):
        return _call(options)


def _call(options: argparse.Namespace) -> int:
    """Run the command of the options and turn what it raises into messages and exit codes."""
    from .commands.console import print_error, printable, say
    from .commands.words import cut_tests, tell_tests

    use_caches(say)
    one_thread_for_small_matrices()
    collect_garbage_seldom()
    share_one_heap()
    as_json = getattr(options, "json", False)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a terminal or pipe of few characters is no reason to lose a result; JSON is UTF-8
        encoding = "utf-8" if as_json else None
        sys.stdout.reconfigure(encoding=encoding, errors="backslashreplace")
    try:
        check_stated_moment()
        tell_tests(options)
        cut_tests(options)
        code = int(options.run_command(options))
        if (programs := sys.modules.get("heatrun.io.programs")) and programs.UNKEPT:
            say(f"compiled programs cannot be kept for the next run ({programs.UNKEPT.pop()})")
        sys.stdout.flush()
    except UsageError as error:
        print(f"heatrun: {printable(str(error))}", file=sys.stderr)
        return WRONG_USE
    except InputError as error:
        print_error(error, as_json=as_json)
        return NOT_ALLOWED
    except KeyboardInterrupt:
        print(SENTENCE, end="", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _drop_output()
        return DONE
    except OSError as error:
        print_error(of_file(error), as_json=as_json)
        _drop_output()
        return NOT_ALLOWED
    except (MemoryError, ImportError) as error:
        if isinstance(error, ImportError) and not _is_for_lack_of_memory(error):
            raise
        print_error(
            InputError(
                "the job needs more memory than there is.",
                remedy="Give fewer or shorter records, or records at a lower rate; or raise the "
                "limit of the process.",
            ),
            as_json=as_json,
        )
        return NOT_ALLOWED
    return code


def _is_for_lack_of_memory(error: ImportError) -> bool:
    """Return whether a package could not be loaded because the address space is used up."""
    said = str(error).lower()
    return "failed to map segment" in said or "cannot allocate memory" in said


def _drop_output() -> None:
    """Throw away what standard output could not take, or Python fails on it again at its end."""
    with suppress(OSError):
        sys.stdout.flush()
        return
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser(name: str = "") -> argparse.ArgumentParser:
    """Return the parser of all commands; of one alone where it is asked for, which is faster."""
    parser = argparse.ArgumentParser(
        prog="heatrun",
        description="Thermal networks of motors from bench transients, with 95 % intervals.",
    )
    parser.add_argument("--version", action="version", version=f"heatrun {__version__}")
    subparsers = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=AnyOrder
    )
    if name in COMMANDS:
        commands = [import_module(f".commands.{name}", __package__)]
    else:
        commands = [load() for load in all_commands().values()]
    for command in commands:
        command.add_parser(subparsers).set_defaults(run_command=command.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
