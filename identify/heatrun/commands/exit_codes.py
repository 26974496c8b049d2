"""Exit codes of the commands."""

DONE, NOT_ALLOWED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130
