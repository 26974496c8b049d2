"""How far a job is and how long it will take: its parts, each with the time that it usually takes.

The usual times were measured on two cores; they are all that is said until a part is done. How fast
this machine is with these records shows as parts go on: in those that are finished, in the shares
that others tell, and in one that takes longer than usual. While nobody tells anything, as in a
compilation, the clock does: the longer a part goes on, the less of it is expected to be left, and
never nothing.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from .io.caches import has_programs

Progress = Callable[[str, float], None]
"""Called with a sentence and the share done [1]; 1 means done."""

TRUST_S = 5.0
"""Usual time [s] of the parts done at which this machine's speed counts as much as the usual."""

MOST_BEFORE_DONE = 0.99
"""Share [1] that is said at most while anything is left to do."""

USUAL_MCMC_S = 60.0
"""Usual time [s] of the MCMC that takes the place of a quick posterior."""

TICK_S = 1.0
"""Time [s] after which the time left is told again though nothing has happened."""


@dataclass
class _Part:
    """A part of a job."""

    usual_s: float  # Time that it usually takes [s].
    share: float = 0.0  # Share that is done, as it was told last [1].
    begun_s: float = math.nan  # When it was begun [s]; NaN before.
    told_s: float = math.nan  # When the share was told last [s].

    def tell(self, now_s: float, share: float) -> None:
        """Take a share, a smaller one where more is to be done than was thought; 0 says nothing."""
        if math.isnan(self.begun_s):
            self.begun_s = self.told_s = now_s
        if share not in (0.0, self.share):
            self.share, self.told_s = min(share, 1.0), now_s

    def left_s(self, now_s: float, slower: float) -> float:
        """Return the time that the rest is likely to take [s], by its own pace and the others'."""
        whole = slower * self.usual_s
        if math.isnan(self.begun_s) or self.share >= 1.0:
            return (1.0 - self.share) * whole
        own = self.told_s - self.begun_s
        left = (1.0 - self.share) * (own + (1.0 - self.share) * whole)
        if self.share > 0.0 and own > 2.0 * self.usual_s:  # that is refuted: its own pace counts
            left = max(left, own * (1.0 / self.share - 1.0))
        return left**2 / (left + now_s - self.told_s)


class Work:
    """The parts of a job, told as they go on; several threads may tell.

    As a context, it tells the time left every `TICK_S` of itself. Parts named by tuples that begin
    alike follow each other, those that begin otherwise go on beside them, and all that are no
    tuples come after those. Where a part begins, those before it in its row are done. Of rows that
    go on beside each other, the one that takes longest is told about.

    Args:
        usual_s: Usual time of each part [s], those of a row in order.
        progress: Told a sentence with the time left, and the share done; None for nobody.
        clock: Gives the time [s].
        is_first: Programs are yet to be compiled: no time is promised.
    """

    def __init__(
        self,
        usual_s: Mapping[Hashable, float],
        progress: Progress | None = None,
        clock: Callable[[], float] = time.monotonic,
        *,
        is_first: bool = False,
    ) -> None:
        self._parts = {part: _Part(usual) for part, usual in usual_s.items()}
        self._progress, self._clock, self._is_first = progress, clock, is_first
        self._begun_s = self._told_s = clock()
        self._sentences: dict[Hashable, str] = {}
        self._share = 0.0
        self._lock, self._is_over = threading.Lock(), threading.Event()

    def __enter__(self) -> Work:
        if self._progress is not None:
            threading.Thread(target=self._tick, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:  # nothing is told behind the last word
            self._is_over.set()

    def _tick(self) -> None:
        with suppress(OSError):  # whoever listened is gone, which the job finds out by itself
            while not self._is_over.wait(TICK_S):
                with self._lock:
                    if self._sentences and not self._is_over.is_set():
                        self._tell()

    def at(self, part: Hashable, sentence: str, share: float = 0.0) -> None:
        """Tell what is being done.

        Args:
            part: The part, one of those named at the start.
            sentence: What is being done, with its units: "refitting 3 of 12 candidates".
            share: Share of the part that is done [1]; 0 where that is not known.
        """
        if self._progress is None:
            return
        with self._lock:
            now = self._clock()
            for other in self._row(part):
                if other == part:
                    break
                self._parts[other].tell(now, 1.0)
            self._parts[part].tell(now, share)
            self._sentences[_row_of(part)] = sentence
            self._tell()

    def replan(self, part: Hashable, usual_s: float, sentence: str) -> None:
        """Begin a part anew that takes another way: the share said goes back to what has gone by.

        Args:
            part: The part.
            usual_s: Time that the other way usually takes [s].
            sentence: As `at`.
        """
        if self._progress is None:
            return
        with self._lock:
            now = self._clock()
            self._parts[part] = _Part(usual_s, begun_s=now, told_s=now)
            gone = now - self._begun_s
            self._share = min(self._share, gone / (gone + self.left_s()))
            self._sentences[_row_of(part)] = sentence
            self._tell()

    def done(self, part: Hashable, sentence: str = "") -> None:
        """Count a part as done, the next of its row as begun, and tell so where there is a
        sentence for it.
        """
        if self._progress is None:
            return
        with self._lock:
            now = self._clock()
            self._parts[part].tell(now, 1.0)
            left = [each for each in self._row(part) if self._parts[each].share < 1.0]
            for other in left[:1]:
                self._parts[other].tell(now, 0.0)
            if sentence:
                self._sentences[_row_of(part)] = sentence
                self._tell()

    def finish(self) -> None:
        """Tell that the job is done."""
        if self._progress is not None:
            with self._lock:
                self._is_over.set()
            self._progress("done", 1.0)

    @property
    def usual_s(self) -> dict[Hashable, float]:
        """Usual time of each part [s]."""
        return {name: part.usual_s for name, part in self._parts.items()}

    def left_s(self) -> float:
        """Return the time that the rest is likely to take [s]."""
        return _together(self._left_by_row())

    def _left_by_row(self) -> dict[Hashable, float]:
        now = self._clock()
        begun = [part for part in self._parts.values() if not math.isnan(part.begun_s)]
        spent = TRUST_S + sum(part.told_s - part.begun_s for part in begun)
        usual = TRUST_S + sum(part.share * part.usual_s for part in begun)
        for part in begun:  # one that says nothing tells something when it is late
            if part.share == 0.0 and (now - part.begun_s) * usual > part.usual_s * spent:
                spent, usual = spent + now - part.begun_s, usual + part.usual_s
        slower = spent / usual
        return self._by_row(lambda part: part.left_s(now, slower))

    def _by_row(self, time_s: Callable[[_Part], float]) -> dict[Hashable, float]:
        rows: dict[Hashable, float] = {}
        for name, part in self._parts.items():
            row = _row_of(name)
            rows[row] = rows.get(row, 0.0) + time_s(part)
        return rows

    def _row(self, part: Hashable) -> list[Hashable]:
        return [other for other in self._parts if _row_of(other) == _row_of(part)]

    def _tell(self) -> None:
        if self._progress is not None:
            rows, now = self._left_by_row(), self._clock()
            left = _together(rows)
            gone, self._told_s = now - self._told_s, now
            # of what is left, the share that has gone by: a longer estimate slows it, no more
            self._share += (1.0 - self._share) * (gone / (gone + left) if gone > 0.0 else 0.0)
            usual = _together(self._by_row(lambda part: part.usual_s))
            is_known = any(part.share == 1.0 for part in self._parts.values())
            if is_known or now - self._begun_s > usual:
                time_s = f"about {in_words(left)} left"
            elif self._is_first:
                time_s = "the first run compiles its programs, which takes about a minute"
            else:  # how fast this machine is with these tests has yet to show
                time_s = f"usually {in_words(usual)} in all"
            told = {row: 0.0 if row is None else rows[row] or -1.0 for row in self._sentences}
            sentence = self._sentences[max(told, key=lambda row: told[row])]
            self._progress(f"{sentence}; {time_s}", min(self._share, MOST_BEFORE_DONE))


def _row_of(part: Hashable) -> Hashable:
    """Return what the parts of one row have in common; None for those that come last."""
    return part[0] if isinstance(part, tuple) else None


def _together(rows: Mapping[Hashable, float]) -> float:
    """Return the time of the longest row and of what comes behind them [s]."""
    beside = [time_s for row, time_s in rows.items() if row is not None]
    return max(beside, default=0.0) + rows.get(None, 0.0)


def in_words(seconds: float) -> str:
    """Return a duration as one says it: 5 s, 40 s, 3 min, 1.5 h.

    Args:
        seconds: The duration [s].
    """
    if seconds < 7.5:
        return "5 s"
    if seconds < 60.0:
        return f"{10 * round(seconds / 10.0)} s" if seconds < 55.0 else "1 min"
    if seconds < 90.0 * 60.0:
        return f"{round(seconds / 60.0)} min"
    return f"{seconds / 3600.0:.1f} h"


SILENT = Work({})
"""For jobs that nobody listens to."""


def work_of_calibration(
    networks: Sequence[str],
    num_tests: int,
    method: str,
    progress: Progress | None,
    *,
    num_ratings: int = 0,
) -> Work:
    """Return the parts of a calibration: those of each network, reduction and writing.

    Args:
        networks: Names of the networks, in order.
        num_tests: Number of tests [1].
        method: As `heatrun.posterior.posterior.sample`.
        progress: As `Work`.
        num_ratings: Number of ratings that are asked for [1].
    """
    parts: dict[Hashable, float] = {}
    for name in networks:
        is_last = name == networks[-1]
        parts |= {(name, "fit"): 2.0 + 3.0 * num_tests}
        parts |= {(name, "missing"): 6.0 + 5.0 * num_tests if is_last else 0.1}
        parts |= {(name, "sample"): 5.0 if method == "quick" else 25.0}
        parts |= {(name, "predict"): 2.0 + 2.0 * num_tests}
        if num_ratings:
            parts |= {(name, "ratings"): 5.0 * num_ratings}
    parts |= {"reduction": 0.5 * num_tests, "writing": 3.0 + 1.5 * num_tests}
    return Work(parts, progress, is_first=not has_programs())


def work_of_discovery(network: str, num_tests: int, method: str, progress: Progress | None) -> Work:
    """Return the parts of a discovery; arguments as `work_of_calibration`."""
    usual = work_of_calibration([network], num_tests, method, None).usual_s
    writing = usual.pop("writing")
    usual |= {"where": 3.0 + 2.0 * num_tests, "writing": writing}
    return Work(usual, progress, is_first=not has_programs())
