"""The errors that reach a user: what was expected, what came, where, and what to do."""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Bad input from outside: a file, a channel, a setting. The command ends with exit code 1.

    Args:
        problem: One sentence: what was expected and what came, with units.
        where: File, column, row or time span; empty if the problem names it.
        remedy: What the user can do about it, as an imperative sentence.
    """

    def __init__(self, problem: str, *, where: str = "", remedy: str = "") -> None:
        self.problem = problem
        self.where = where
        self.remedy = remedy
        sentence = f"{where}: {problem}" if where else problem
        super().__init__(f"{sentence} {remedy}".strip())


class UsageError(ValueError):
    """The command or function was called in a way it does not offer. Exit code 2."""


def of_file(error: OSError) -> InputError:
    """Return the message of a file that the system did not let be read or written.

    Args:
        error: What the system raised, such as for a full disk.
    """
    named = error.filename
    return InputError(
        f"a file could not be read or written: {error.strerror or error}.",
        where=named.decode(errors="replace") if isinstance(named, bytes) else str(named or ""),
        remedy="Make room or choose another folder; the same command goes on from what was "
        "finished.",
    )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "Did you mean a or b?" for the known words nearest to a word, or an empty text.

    Args:
        word: What came.
        known: What was expected.
    """
    folded = {candidate.casefold(): candidate for candidate in known}
    near = difflib.get_close_matches(word.casefold(), folded, n=3, cutoff=0.5)
    return f"Did you mean {' or '.join(repr(folded[key]) for key in near)}?" if near else ""
