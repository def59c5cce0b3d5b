"""A Dask cluster that cannot be used is refused in one line."""

import sys

import pytest

from distretarget.batch import workers as cluster_module
from distretarget.errors import BatchError

ADDRESS = "tcp://machine:8786"


class Idle:
    """A client of a cluster without workers."""

    def __init__(self, *_, **__):
        pass

    def ncores(self):
        return {}

    def get_executor(self, **_):
        pass

    def close(self, **_):
        pass


class Busy(Idle):
    """A client of a cluster whose workers have gone since."""

    def ncores(self):
        return {"worker": 2}

    def scheduler_info(self):
        return {"workers": {}}


@pytest.fixture
def cluster(monkeypatch):
    """The class of the cluster, which needs Dask, with one that answers as a scheduler."""
    pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    monkeypatch.setattr(cluster_module, "_kind", answer("Scheduler"))
    return cluster_module.Cluster


def is_refused(cluster, reason):
    with pytest.raises(BatchError, match=reason):
        cluster(ADDRESS, print)


def answer(kind):
    """What the Dask process at the address says that it is."""

    async def kind_of(_address):
        return kind

    return kind_of


def test_the_address_of_a_worker(cluster, monkeypatch):
    monkeypatch.setattr(cluster_module, "_kind", answer("Worker"))
    is_refused(cluster, f"{ADDRESS!r} is the address of a Dask worker; expected that of the scheduler")


def test_a_cluster_without_workers(cluster, monkeypatch):
    monkeypatch.setattr("distributed.Client", Idle)
    is_refused(cluster, f"the Dask scheduler at {ADDRESS} has no workers")


def test_workers_that_are_gone_are_reported_now_and_then(cluster, monkeypatch):
    monkeypatch.setattr("distributed.Client", Busy)
    reasons = []
    gone = cluster(ADDRESS, reasons.append)
    monkeypatch.setattr(cluster_module, "CHECK_INTERVAL", 0.0)
    assert [*gone.finished(), *gone.finished()] == []
    assert reasons == ["the Dask cluster has no workers"]


def test_an_installation_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    is_refused(cluster_module.Cluster, "--dask needs the package distributed")
