"""A Dask cluster that retargets clips."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import suppress

from distretarget.batch.job import Job, Result, run
from distretarget.errors import BatchError

CHECK_INTERVAL = 5.0  # after this time without a result, check whether there are workers [s]
CONNECT_TIMEOUT = 10.0  # time for a scheduler to answer [s]
REMINDER = 60.0  # time from one line that there are no workers to the next [s]


class Cluster:
    """A Dask cluster; its scheduler gives the jobs of workers that die to others."""

    def __init__(self, address: str, waiting: Callable[[str], object]) -> None:
        """Connect to the scheduler at an address; raise a BatchError if none answers or the cluster has no workers.

        If the workers leave later, `waiting` is called with that reason.
        """
        import asyncio  # here, as it is slow to import

        try:
            from distributed import Client
        except ImportError as missing:
            raise BatchError("--dask needs the package distributed: pip install 'distretarget[dask]'") from missing
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it prints tracebacks of what is said in a line
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
        self._executor: Executor = client.get_executor(pure=False)
        self._running: dict[Future[Result], Job] = {}
        self._waiting, self._next_reminder = waiting, 0.0
        self.count, self.start_seconds = sum(client.ncores().values()), 0.0
        if not self.count:
            self.close()
            raise BatchError(f"the Dask scheduler at {address} has no workers; start some and run this again")

    def submit(self, job: Job) -> None:
        """Give a clip to the cluster."""
        self._running[self._executor.submit(run, job)] = job

    def finished(self) -> Iterator[tuple[Job, Result]]:
        """Wait until a clip is finished, and yield those that are, with their results.

        Raises:
            BatchError: the cluster is gone.
        """
        done, _ = wait(self._running, CHECK_INTERVAL, FIRST_COMPLETED)
        if not done:
            self._remind()
        for future in done:
            job = self._running.pop(future)
            try:
                result = future.result()
            except CancelledError as error:
                raise BatchError("the workers are gone; run this again to go on") from error
            except Exception as error:  # of the cluster; it concerns this clip only
                result = job.failed(f"{job.source.path}: {type(error).__name__}: {error}")
            yield job, result

    def _remind(self) -> None:
        """Say now and then that the cluster has no workers; it may get new ones."""
        if not self._client.scheduler_info()["workers"] and time.monotonic() >= self._next_reminder:
            self._next_reminder = time.monotonic() + REMINDER
            self._waiting("the Dask cluster has no workers")

    def close(self) -> None:
        """Leave the cluster; jobs not yet done are dropped."""
        with suppress(Exception):
            self._client.close(timeout=5)


async def _kind(address: str) -> str:
    """What the Dask process at an address is, such as "Scheduler" or "Worker"."""
    import asyncio

    from distributed import rpc

    async with rpc(address, timeout=CONNECT_TIMEOUT) as process:
        return str((await asyncio.wait_for(process.identity(), CONNECT_TIMEOUT))["type"])
