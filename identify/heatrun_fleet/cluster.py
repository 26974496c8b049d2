"""Worker processes by dask.distributed: of this machine, or of a scheduler that runs already.

Workers get one batch at a time and give its rows back as bytes; they write nothing. A worker that
dies is replaced and its batch given to another. A batch on which workers die again and again is
taken apart at the end, machine by machine, one at a time, so that the death tells which it was.
"""

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from heatrun.errors import InputError

from .fleet_file import Batch
from .machine import Done, given_up, work_out
from .rows import read_part, table_bytes

DEATHS = 3
"""Workers that die on a batch until it is taken apart, and on one machine until it is given up."""

AT_LOOPBACK = "127.0.0.1"
ANY_PORT = f"{AT_LOOPBACK}:0"

START_S = 60.0
"""Longest wait for a scheduler to answer and for its first worker [s]."""

LOOK_S = 5.0
"""Between two looks at the workers while nothing is finished [s]."""

AWAY_S = 30.0
"""After which another worker is started for one that is missing [s]; one starts in three to ten."""

MOST_MORE = 10
"""Workers, for each one asked for, that are started in place of missing ones."""

OF_WORKERS = {"OPENBLAS_NUM_THREADS": "1"}
"""Environment of the workers of this machine; Dask sets it before NumPy is loaded."""


@dataclass(frozen=True)
class Workers:
    """Which processes work."""

    # Processes of this machine, 0 for this one; None for as many as it has cores.
    num: int | None = None
    # Address of a scheduler that runs already; empty for processes of this machine.
    scheduler: str = ""
    # Memory that a worker of this machine may take, such as `"4GB"`; `"auto"` for its share of the
    # machine's.
    memory: str = "auto"
    # Files by `ca`, `cert` and `key`, for a scheduler that wants them; else Dask's own
    # configuration says.
    tls: Mapping[str, str] | None = None

    @property
    def is_here(self) -> bool:
        """Whether the batches are worked out in this process."""
        return self.num == 0 and not self.scheduler

    @property
    def settings(self) -> dict[str, str]:
        """What holds in the workers and not here, of `heatrun_fleet.fleet_file.SETTINGS`."""
        return {} if self.is_here else dict(OF_WORKERS)


def require_dask() -> None:
    """Refuse to begin where the extra is not installed.

    Raises:
        InputError: With what to install.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise InputError(
            "Working on a fleet with several processes needs dask.distributed, which is not "
            "installed.",
            remedy='Run: pip install "heatrun[fleet]"; or pass --workers 0 to work in this '
            "process.",
        ) from error


class Pool:
    """Workers that can be given batches, by the client of their scheduler; where they are of this
    machine, with what starts them and how many there should be.
    """

    def __init__(self, client: Any, cluster: Any = None, num: int = 0) -> None:
        self.client = client
        self._cluster, self._num = cluster, num
        self._short_since: float | None = None
        self._num_more = 0

    def size(self) -> int:
        """Return how many workers there are, after those that stayed away were replaced.

        Dask starts another process for a worker that dies, but gives up where that one dies while
        it starts; with no worker left a fleet would wait for ever.

        Raises:
            InputError: If workers of this machine do not start.
        """
        found = len(self.client.nthreads())
        if self._cluster is None or found >= self._num:
            self._short_since = None
            return found
        now = time.monotonic()
        if self._short_since is None:
            self._short_since = now
        elif now - self._short_since > AWAY_S:
            missing = self._num - found
            self._num_more += missing
            if self._num_more > MOST_MORE * self._num:
                raise _not_started("they end as soon as they begin")
            self._cluster.scale(len(self._cluster.worker_spec) + missing)
            self._short_since = None
        return found


@contextmanager
def connected(workers: Workers, most: int) -> Iterator[Pool]:
    """Give the workers for the time of the context; no more processes are started than `most`.

    Raises:
        InputError: If dask is not installed, processes do not start, or the scheduler does not
            answer.
    """
    require_dask()
    import dask.config

    _check_memory(workers.memory)
    quiet = {"logging": {"distributed": "critical"}, "distributed.logging.distributed": "critical"}
    with dask.config.set(quiet):
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        with _existing(workers) if workers.scheduler else _local(workers, most) as pool:
            yield pool


def _check_memory(said: str) -> None:
    from dask.utils import parse_bytes

    try:
        is_some = said == "auto" or parse_bytes(said) > 0
    except ValueError:
        is_some = False
    if not is_some:
        raise InputError(
            f"Expected the memory of a worker, such as 4GB, got {said[:40]!r}.",
            remedy="Write a number and MB or GB, or leave it out.",
        )


@contextmanager
def _local(workers: Workers, most: int) -> Iterator[Pool]:
    """Start processes that nobody beyond this machine, and no other user of it, can reach."""
    import dask.config
    from distributed import Client

    num = min(workers.num or os.cpu_count() or 1, max(most, 1))
    settings = {
        "distributed.worker.multiprocessing-method": "spawn",  # JAX must not be forked
        "distributed.scheduler.allowed-failures": DEATHS - 1,
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
        # a batch with much compiling may not answer for long; it is not lost for it
        "distributed.scheduler.worker-ttl": None,
        # what fills a worker is compiled code, which cannot be spilled: it ends, and is replaced
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.nanny.pre-spawn-environ": {
            **dask.config.get("distributed.nanny.pre-spawn-environ", {}), **OF_WORKERS
        },
    }  # fmt: skip
    with (
        dask.config.set(settings),
        _started(num, workers.memory) as cluster,
        Client(cluster) as client,
    ):
        yield Pool(client, cluster, num)


def _started(num: int, memory: str) -> Any:
    """Return processes of this machine; where one dies as it starts, they are started anew."""
    from distributed import LocalCluster

    said = ""
    for _ in range(DEATHS):
        try:
            return LocalCluster(
                n_workers=num,
                threads_per_worker=1,
                processes=True,
                host=AT_LOOPBACK,
                dashboard_address=ANY_PORT,
                worker_dashboard_address=ANY_PORT,
                scheduler_kwargs={"dashboard": False},
                memory_limit=memory,
                security=True,  # certificates of its own, for this cluster alone
                silence_logs=logging.CRITICAL,
            )
        except (RuntimeError, OSError) as error:  # a TimeoutError is an OSError
            cause = error.__cause__ or error
            said = f"{type(cause).__name__}: {str(cause)[:200]}"
    raise _not_started(said)


def _not_started(why: str) -> InputError:
    return InputError(
        f"The worker processes do not start ({why}).",
        remedy="Give fewer workers or more memory, or pass --workers 0 to work in this process.",
    )


@contextmanager
def _existing(workers: Workers) -> Iterator[Pool]:
    from distributed import Client
    from distributed.security import Security

    security = None
    if workers.tls:
        names = {"ca": "tls_ca_file", "cert": "tls_client_cert", "key": "tls_client_key"}
        given = {names[key]: path for key, path in workers.tls.items()}
        security = Security(require_encryption=True, **given)
    try:
        client = Client(workers.scheduler, security=security, timeout=START_S,
                        set_as_default=False)  # fmt: skip
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"The scheduler does not answer ({type(error).__name__}: {str(error)[:200]}).",
            where=workers.scheduler,
            remedy="Check the address, such as tcp://host:8786, and for tls:// the files of "
            "--tls-ca, --tls-cert and --tls-key.",
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=START_S)
        except TimeoutError as error:
            raise InputError(
                f"The scheduler had no worker for {START_S:.0f} s.",
                where=workers.scheduler,
                remedy="Start workers for it, such as: dask worker ADDRESS --nthreads 1",
            ) from error
        yield Pool(client)


def over_workers(
    pool: Pool,
    batches: Sequence[Batch],
    done: Callable[[Batch, Done], None],
    work: Callable[[Batch], Done] = work_out,
) -> None:
    """Have batches worked out, as many at once as there are workers; `done` is told each with its
    rows, in the order in which they are finished.

    Raises:
        InputError: If a worker has other versions or settings, or the scheduler is gone.
    """
    for batch in _all_of(pool, batches, done, work):
        done(batch, _one_by_one(pool, batch, work))


def _all_of(
    pool: Pool, batches: Sequence[Batch], done: Callable[[Batch, Done], None],
    work: Callable[[Batch], Done], at_once: int | None = None,
) -> list[Batch]:  # fmt: skip
    """Work out batches; return those on which workers died."""
    from distributed import CancelledError, KilledWorker, wait

    run = uuid4().hex[:8]
    waiting, suspects = deque(batches), []
    running: dict[Any, Batch] = {}
    try:
        while waiting or running:
            size = pool.size()
            room = at_once or max(1, size)
            while waiting and len(running) < room:
                batch = waiting.popleft()
                name = f"heatrun-{batch.name}-{run}"
                running[pool.client.submit(work, batch, key=name, pure=False)] = batch
            try:
                with pool.client.as_current():
                    looked: Any = wait(list(running), LOOK_S, return_when="FIRST_COMPLETED")
            except TimeoutError:
                continue  # to see whether there are workers still
            for future in looked.done:
                batch = running.pop(future)
                try:
                    result: Any = future.result()
                except KilledWorker:
                    suspects.append(batch)
                    continue
                finally:
                    future.release()
                done(batch, result)
    except (CancelledError, OSError, TimeoutError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # of this machine's disk, by `done`
        raise InputError(
            f"The workers cannot be reached any more ({type(error).__name__}).",
            remedy="The same command goes on from what was finished.",
        ) from error
    finally:
        for future in running:
            future.cancel()
    return suspects


def _one_by_one(pool: Pool, batch: Batch, work: Callable[[Batch], Done]) -> Done:
    """Work out the machines of a batch, one after the other and nothing beside."""
    parts: list[Done] = []
    for entry in batch.entries:
        single = batch.of_one(entry)
        if _all_of(pool, [single], lambda _, result: parts.append(result), work, at_once=1):
            parts.append(given_up(single, DEATHS))
    changed = next((part.changed for part in parts if part.changed), "")
    if changed:
        return Done(batch.name, b"", {}, changed=changed)
    return Done(
        name=batch.name,
        part=table_bytes([read_part(part.part) for part in parts]),
        timing={"one_by_one": [part.timing for part in parts]},
        lost=tuple(machine for part in parts for machine in part.lost),
    )
