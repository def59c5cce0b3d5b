"""A Dask cluster that cannot be used is refused in one line."""

import sys

import pytest

from distretarget.batch import pools
from distretarget.batch.pools import Cluster
from distretarget.errors import BatchError

ADDRESS = "tcp://machine:8786"


class Idle:
    """A client of a cluster without workers."""

    def __init__(self, *_, **__):
        pass

    def ncores(self):
        return {}

    def close(self):
        pass


@pytest.fixture
def answer(monkeypatch):
    """Let the Dask process at the address say what it is."""

    def says(kind):
        async def identity(_address):
            return {"type": kind}

        monkeypatch.setattr(pools, "_identity", identity)

    return says


def is_refused(reason):
    with pytest.raises(BatchError, match=reason):
        Cluster(ADDRESS)


def test_the_address_of_a_worker(answer):
    pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    answer("Worker")
    is_refused(f"{ADDRESS!r} is the address of a Dask worker; expected that of the scheduler")


def test_a_cluster_without_workers(answer, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="the extra `dask` is not installed")
    monkeypatch.setattr(distributed, "Client", Idle)
    answer("Scheduler")
    is_refused(f"the Dask scheduler at {ADDRESS} has no workers")


def test_an_installation_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    is_refused("--dask needs the package distributed")
