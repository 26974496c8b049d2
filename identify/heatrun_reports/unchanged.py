"""A report names the digest of its files, so that they must still be the files it was made of."""

from __future__ import annotations

from collections.abc import Iterable

from heatrun.bench.readers.open_file import digest, is_pipe
from heatrun.bench.record import Source
from heatrun.errors import InputError


def refuse_changed(sources: Iterable[Source]) -> None:
    """Check that files on disk are those that were read.

    Args:
        sources: As the readers left them.

    Raises:
        InputError: If a file is gone or holds other bytes than when it was read.
    """
    for source in sources:
        if is_pipe(source.path):  # it was read once and cannot be read again, nor replaced
            continue
        try:
            now = digest(source.path)
        except OSError as error:
            raise InputError(
                f"The file was there and cannot be opened any more ({error.strerror}).",
                where=source.path,
                remedy="Start again when nothing else writes to it.",
            ) from error
        if now != source.sha256:
            raise InputError(
                f"The file was replaced while it was read: SHA-256 {source.sha256[:16]} was read, "
                f"{now[:16]} lies there now.",
                where=source.path,
                remedy="Start again when the logger or the copy has finished.",
            )
