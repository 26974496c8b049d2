"""Every file of the corpus: none is misread in silence, none ends in a traceback, few are asked."""

from __future__ import annotations

import pytest
from reading_corpus.case import Truth
from reading_corpus.corpus import SOURCES, corpus
from reading_corpus.oracle import MISREAD, NEEDLESS, TRACEBACK, judge

LARGEST_NEEDLESS_SHARE = 0.10
"""Of the clear files of a kind: a tool that refuses everything misreads nothing and is no use."""


def test_the_corpus_is_large_and_its_names_are_unique():
    labels = [case.label for case in corpus()]
    assert len(labels) >= 400
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize("kind", list(SOURCES))
def test_no_file_is_misread_in_silence(kind, tmp_path):
    outcomes = [judge(case, tmp_path, number) for number, case in enumerate(SOURCES[kind]())]
    wrong = [f"{o.verdict}: {o.case.label}: {o.said}" for o in outcomes
             if o.verdict in (MISREAD, TRACEBACK)]  # fmt: skip
    assert not wrong, "\n".join(wrong)
    clear = [o for o in outcomes if o.case.truth in (Truth.READ, Truth.PLAIN)]
    needless = [f"{o.case.label}: {o.said}" for o in clear if o.verdict == NEEDLESS]
    assert len(needless) <= LARGEST_NEEDLESS_SHARE * len(clear), "\n".join(needless)
