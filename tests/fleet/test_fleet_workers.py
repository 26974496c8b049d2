"""Workers that die, stay away or belong to another scheduler."""

import json
from pathlib import Path

import psutil
import pytest
from deaths import ALWAYS, rows_alone, rows_or_death
from simulated_fleet import planned

from heatrun.errors import InputError
from heatrun_fleet import cluster, job
from heatrun_fleet.cluster import Pool, Workers, connected, over_workers
from heatrun_fleet.rows import read_part

pytest.importorskip("distributed")


SETTINGS = Workers(2).settings


def listening():
    """Addresses at which this process and its children listen."""
    own = psutil.Process()
    return [
        found.laddr.ip
        for process in (own, *own.children(recursive=True))
        for found in process.net_connections("tcp")
        if found.status == psutil.CONN_LISTEN
    ]


def test_workers_that_die_are_replaced_and_the_culprit_is_named(bench, monkeypatch):
    monkeypatch.setattr(cluster, "DEATHS", 2)
    batches = planned(bench, **SETTINGS)
    before = len(listening())
    found: dict = {}

    def done(batch, result):
        assert batch.name not in found, "counted twice"
        found[batch.name] = result

    with connected(Workers(2), len(batches)) as pool:
        own = listening()
        over_workers(pool, batches, done, rows_or_death)
    assert len(own) > before
    assert {ip for ip in own if not ip.startswith("127.")} == set()
    rows = [row for b in batches for row in read_part(found[b.name].part).to_pylist()]
    assert [row["machine"] for row in rows] == [f"M{n:03d}" for n in range(6)]
    assert [row["machine"] for row in rows if row["status"] == "failed"] == [ALWAYS]
    (finding,) = json.loads(rows[3]["findings"])
    assert finding["id"] == "worker_lost"
    assert [found[b.name].lost for b in batches] == [(), (ALWAYS,), ()]


@pytest.mark.parametrize("said", ["much", "0", "4 bananas"])
def test_a_memory_that_is_none_is_refused(said):
    with pytest.raises(InputError, match="such as 4GB"), connected(Workers(1, memory=said), 1):
        pass


class Missing:
    """Stands for client and cluster of which one worker of two never comes."""

    def __init__(self):
        self.worker_spec = {0: {}, 1: {}}
        self.asked: list[int] = []

    def nthreads(self):
        return {"tcp://first": 1}

    def scale(self, num):
        self.asked.append(num)
        self.worker_spec |= {number: {} for number in range(num)}


def test_a_worker_that_stays_away_is_replaced_up_to_a_bound(monkeypatch):
    monkeypatch.setattr(cluster, "AWAY_S", -1.0)
    missing = Missing()
    pool = Pool(missing, missing, 2)
    for _ in range(4 * cluster.MOST_MORE):
        assert pool.size() == 1
    with pytest.raises(InputError, match="do not start"):
        [pool.size() for _ in range(2)]
    assert missing.asked == list(range(3, 3 + 2 * cluster.MOST_MORE))


def test_processes_that_die_as_they_start_are_started_anew(monkeypatch):
    import distributed

    calls: list[int] = []

    def dying(n_workers, **settings):
        calls.append(n_workers)
        if len(calls) < cluster.DEATHS:
            raise RuntimeError("Nanny failed to start.")
        return "started"

    monkeypatch.setattr(distributed, "LocalCluster", dying)
    assert cluster._started(2, "auto") == "started"
    assert calls == [2] * cluster.DEATHS
    monkeypatch.setattr(cluster, "DEATHS", 0)
    with pytest.raises(InputError, match="--workers 0"):
        cluster._started(2, "auto")


def test_a_scheduler_that_runs_already_is_used_under_tls(bench, tmp_path):
    import dask.config
    from distributed import LocalCluster
    from distributed.security import Security

    security = Security.temporary()
    files = {}
    names = {"ca": "tls_ca_file", "cert": "tls_client_cert", "key": "tls_client_key"}
    for key, name in names.items():
        files[key] = str(tmp_path / f"{key}.pem")
        Path(files[key]).write_text(getattr(security, name))
    batches = planned(bench, **SETTINGS)
    found = []
    with (
        dask.config.set({"distributed.scheduler.http.routes": []}),
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, host="127.0.0.1",
                     protocol="tls://", security=security, dashboard_address="127.0.0.1:0",
                     worker_dashboard_address="127.0.0.1:0") as cluster,
    ):  # fmt: skip
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        with connected(Workers(None, address, tls=files), 3) as pool:
            over_workers(pool, batches, lambda batch, result: found.append(result), rows_alone)
    assert sorted(each.name for each in found) == sorted(batch.name for batch in batches)


def test_workers_of_other_versions_are_refused(bench):
    batches = planned(bench, 6, XLA_FLAGS="--other")
    with pytest.raises(InputError, match="XLA_FLAGS '--other'"):
        job.work_out(batches[0])
