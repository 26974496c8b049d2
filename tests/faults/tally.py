"""What a campaign has seen so far: a line of JSON for each trial, in a file that only grows."""

import json
import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scipy.stats import beta

Row = dict[str, Any]
LEVEL = 0.95


class Tally:
    """The file of a campaign; several processes may add to it.

    Attributes:
        path: The file.
        product: Digest of the packages that are tried; rows of others are kept, not counted.
    """

    def __init__(self, path: Path, product: str) -> None:
        self.path, self.product = path, product

    def rows(self) -> list[Row]:
        """Return the rows of these packages; a line that a kill has cut is passed over."""
        return [row for row in self._all() if row["product"] == self.product]

    def others(self) -> Counter[str]:
        """Return how many rows there are of other packages."""
        return Counter(row["product"] for row in self._all() if row["product"] != self.product)

    def _all(self) -> Iterable[Row]:
        if not self.path.exists():
            return
        for line in self.path.read_text(encoding="utf-8").splitlines():
            try:
                yield json.loads(line)
            except ValueError:
                continue

    def add(self, rows: Iterable[Row]) -> None:
        """Append rows in one step."""
        lines = [json.dumps({**row, "product": self.product}) for row in rows]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            size = os.fstat(descriptor).st_size
            is_cut = size and os.pread(descriptor, 1, size - 1) != b"\n"  # by a kill
            text = "\n" * bool(is_cut) + "".join(f"{line}\n" for line in lines)
            os.write(descriptor, text.encode())
        finally:
            os.close(descriptor)


def num_kills(rows: Iterable[Row]) -> int:
    """Return how many signals struck a running command."""
    return sum(row["kind"] == "kill" for row in rows)


def upper_limit(count: int, num: int) -> float:
    """Return the upper 95 % limit of a rate of which so many of so many were seen, one-sided.

    Reference: C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated
        in the case of the binomial, Biometrika 26 (1934) 404-413.

    Example:
        >>> round(upper_limit(0, 1000), 5)
        0.00299
    """
    if num == 0 or count >= num:
        return 1.0
    return float(beta.ppf(LEVEL, count + 1, num - count))
