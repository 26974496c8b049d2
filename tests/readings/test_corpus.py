"""Every file of the corpus: none is misread in silence, none ends in a traceback, few are asked."""

import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from reading_corpus.case import Truth
from reading_corpus.corpus import SOURCES
from reading_corpus.oracle import ASKED, MISREAD, NEEDLESS, REFUSED, TRACEBACK, Outcome, judge

LARGEST_NEEDLESS_SHARE = 0.05
"""Of the files that leave nothing open: a tool that refuses everything misreads nothing, too."""


EVERY = 5
"""One file of so many is read by `make test`, the others by `make test-slow`."""

READ = [pytest.param(EVERY, id="a fifth"), pytest.param(1, id="all", marks=pytest.mark.slow)]


@cache
def read(kind: str, every: int) -> tuple[tuple[str, ...], tuple[Outcome, ...]]:
    """Make the files of a kind and read every so many of them, once for all tests.

    Returns:
        The labels of all, and the outcomes of those that were read.
    """
    if every > 1 and "of benches" in kind:  # all of these are read by a test of their own
        labels, found = read(kind, 1)
        return labels, found[::every]
    labels, found = [], []
    with tempfile.TemporaryDirectory() as folder:
        for i, case in enumerate(SOURCES[kind]()):
            labels.append(case.label)
            if i % every == 0:
                found.append(judge(case, Path(folder), i))
    return tuple(labels), tuple(found)


def outcomes(kind: str, every: int) -> tuple[Outcome, ...]:
    """Return what came of every so many files of a kind."""
    return read(kind, every)[1]


def words(found: list[Outcome]) -> str:
    """Return one line for each."""
    return "\n".join(f"{o.verdict}: {o.case.label}: {o.said}" for o in found)


@pytest.mark.parametrize("every", READ)
@pytest.mark.parametrize("kind", list(SOURCES))
def test_no_file_is_misread_in_silence(kind, every):
    wrong = [o for o in outcomes(kind, every) if o.verdict in (MISREAD, TRACEBACK)]
    assert not words(wrong)


@pytest.mark.parametrize("every", READ)
def test_few_files_that_leave_nothing_open_are_asked_about(every):
    clear = [o for kind in SOURCES for o in outcomes(kind, every)
             if o.case.truth in (Truth.READ, Truth.PLAIN)]  # fmt: skip
    needless = [o for o in clear if o.verdict == NEEDLESS]
    assert len(needless) <= LARGEST_NEEDLESS_SHARE * len(clear), words(needless)


@pytest.mark.parametrize("every", READ)
def test_no_ordinary_file_is_asked_about(every):
    needless = [o for kind in SOURCES for o in outcomes(kind, every)
                if o.case.truth is Truth.PLAIN and o.verdict == NEEDLESS]  # fmt: skip
    assert not words(needless)


def test_what_benches_send_is_named_and_each_kind_has_six_members():
    found = [o for kind in SOURCES if "of benches" in kind for o in outcomes(kind, 1)]
    members = Counter(outcome.case.cause for outcome in found)
    assert len(members) == 10
    assert min(members.values()) >= 6
    unnamed = [o for o in found if o.verdict in (ASKED, REFUSED) and not o.named]
    assert not words(unnamed)


def test_the_corpus_is_large_and_its_names_are_unique():
    labels = [label for kind in SOURCES for label in read(kind, EVERY)[0]]
    assert len(labels) >= 400
    assert len(set(labels)) == len(labels)
