"""A Dask cluster as workers; imported only for --dask."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress

from distretarget.errors import BatchError

try:
    from distributed import Client, rpc
except ImportError as missing:
    raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from missing

CONNECT_TIMEOUT = 10.0  # time for a scheduler to answer [s]
REMINDER = 60.0  # time from one line that there are no workers to the next [s]


class Cluster:
    """A Dask cluster; its scheduler gives the jobs of workers that die to others."""

    def __init__(self, address: str, waiting: Callable[[str], object]) -> None:
        """Connect to the scheduler at an address; raise a BatchError if none answers or the cluster has no workers.

        If the workers leave later, `waiting` is called with that reason.
        """
        try:
            kind = asyncio.run(_kind(address))  # a client would wait for much longer, and not without noise
            client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False) if kind == "Scheduler" else None
        except TimeoutError as error:
            raise BatchError(f"no Dask scheduler answers at {address!r} within {CONNECT_TIMEOUT:g} s") from error
        except Exception as error:  # of all layers below: the address, the network, what another program answers
            raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from error
        if client is None:
            raise BatchError(f"{address!r} is the address of a Dask {kind.lower()}; expected that of the scheduler")
        self._client = client
        self.executor: Executor = client.get_executor(pure=False)
        self._waiting, self._next_reminder = waiting, 0.0
        self.count, self.start_seconds = sum(client.ncores().values()), 0.0
        if not self.count:
            self.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")

    def lost(self) -> bool:
        """Return False, after a reminder if the cluster has no workers: it may get new ones."""
        if not self._client.scheduler_info()["workers"] and time.monotonic() >= self._next_reminder:
            self._next_reminder = time.monotonic() + REMINDER
            self._waiting("the Dask cluster has no workers")
        return False

    def close(self) -> None:
        """Leave the cluster; jobs not yet done are dropped."""
        with suppress(Exception):
            self._client.close(timeout=5)


async def _kind(address: str) -> str:
    """What the Dask process at an address is, such as "Scheduler" or "Worker"."""
    async with rpc(address, timeout=CONNECT_TIMEOUT) as process:
        return str((await asyncio.wait_for(process.identity(), CONNECT_TIMEOUT))["type"])
