"""How far a job is and how long it will take: its parts, each with the time that it usually takes.

The usual times were measured on two cores and are only shares of the whole. How fast this machine
is with these records shows as parts are finished; until then the usual times stand for it, so that
there is an estimate from the start.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable, Mapping, Sequence

Progress = Callable[[str, float], None]
"""Called with a sentence and the share done [1]; 1 means done."""

TRUST_S = 5.0
"""Usual time [s] of the parts done at which this machine's speed counts as much as the usual."""

MOST_BEFORE_DONE = 0.99
"""Share [1] that is said at most while anything is left to do."""


class Work:
    """The parts of a job, told as they go on; several threads may tell.

    Args:
        usual_s: Usual time of each part [s], in any order.
        progress: Told a sentence with the time left, and the share done; None for nobody.
        clock: Gives the time [s].
    """

    def __init__(
        self,
        usual_s: Mapping[Hashable, float],
        progress: Progress | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._usual = dict(usual_s)
        self._share = dict.fromkeys(self._usual, 0.0)
        self._progress, self._clock = progress, clock
        self._begun = clock()
        self._lock = threading.Lock()

    def at(self, part: Hashable, sentence: str, share: float = 0.0) -> None:
        """Tell what is being done.

        Args:
            part: The part, one of those named at the start.
            sentence: What is being done, with its units: "refitting 3 of 12 candidates".
            share: Share of the part that is done [1]; it never goes back.
        """
        if self._progress is None:
            return
        with self._lock:
            self._share[part] = max(self._share.get(part, 0.0), min(share, 1.0))
            self._tell(sentence)

    def done(self, part: Hashable, sentence: str = "") -> None:
        """Count a part as done, and tell so where there is a sentence for it."""
        if self._progress is None:
            return
        with self._lock:
            self._share[part] = 1.0
            if sentence:
                self._tell(sentence)

    def finish(self) -> None:
        """Tell that the job is done."""
        if self._progress is not None:
            self._progress("done", 1.0)

    @property
    def usual_s(self) -> dict[Hashable, float]:
        """Usual time of each part [s]."""
        return dict(self._usual)

    @property
    def share(self) -> float:
        """Share of the usual time of all parts that is done [1]."""
        return self._done_s() / sum(self._usual.values())

    def left_s(self) -> float:
        """Return the time that the rest is likely to take [s]."""
        done = self._done_s()
        slower = (self._clock() - self._begun + TRUST_S) / (done + TRUST_S)
        return slower * (sum(self._usual.values()) - done)

    def _done_s(self) -> float:
        return sum(usual * self._share[part] for part, usual in self._usual.items())

    def _tell(self, sentence: str) -> None:
        if self._progress is not None:
            left = f"about {in_words(self.left_s())} left"
            self._progress(f"{sentence}; {left}", min(self.share, MOST_BEFORE_DONE))


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
    networks: Sequence[str], num_tests: int, method: str, progress: Progress | None
) -> Work:
    """Return the parts of a calibration: those of each network, reduction and writing.

    Args:
        networks: Names of the networks, in order.
        num_tests: Number of tests [1].
        method: As `heatrun.inference.posterior.sample`.
        progress: As `Work`.
    """
    parts: dict[Hashable, float] = {}
    for name in networks:
        is_last = name == networks[-1]
        parts |= {(name, "fit"): 4.0, (name, "missing"): 20.0 if is_last else 0.1}
        parts |= {(name, "sample"): 2.0 if method == "quick" else 12.0}
        parts |= {(name, "predict"): 1.0 * num_tests}
    return Work({**parts, "reduction": 0.5 * num_tests, "writing": 4.0}, progress)


def work_of_discovery(network: str, num_tests: int, method: str, progress: Progress | None) -> Work:
    """Return the parts of a discovery; arguments as `work_of_calibration`."""
    of_calibration = work_of_calibration([network], num_tests, method, None)
    return Work({**of_calibration.usual_s, "where": 3.0 + 2.0 * num_tests}, progress)
