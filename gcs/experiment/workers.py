"""Who flies: processes on this machine, or the workers of a Dask cluster. Results come as they are done."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from itertools import islice
from typing import Any, Protocol, TypeVar

from joblib import Parallel, delayed, effective_n_jobs
from joblib.externals.loky.process_executor import TerminatedWorkerError

from wire.connection import ConnectionRefused

T = TypeVar("T")
R = TypeVar("R")

CONNECT_S = 5.0
"""A scheduler that has not answered by then is not there."""

AT_ONCE = 1000
"""Tasks that a scheduler is handed: enough for any cluster, and no more than it likes to hold."""
IDLE_S = 20
"""Processes with nothing to do leave after this, even if whoever started them was killed."""


class WorkersLost(RuntimeError):
    """Those who fly are gone; in one sentence."""


class NoCluster(ConnectionRefused):
    """A Dask cluster that cannot be used, in one sentence."""


class Workers(Protocol):
    """A pool."""

    @property
    def count(self) -> int:
        """Flights at once."""
        ...

    def map(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """One result a task, in the order of their coming. Raises WorkersLost."""
        ...

    def close(self) -> None:
        """Let them go."""
        ...


class Local:
    """Processes on this machine, one thread each."""

    def __init__(self, jobs: int) -> None:
        self.count: int = effective_n_jobs(jobs)

    def map(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """As `Workers`."""
        parallel = Parallel(
            n_jobs=self.count,
            backend="loky",
            return_as="generator_unordered",
            batch_size=1,  # a result is kept when it is there, not when its batch is
            inner_max_num_threads=1,
            idle_worker_timeout=IDLE_S,
        )
        try:
            yield from parallel(delayed(function)(task) for task in tasks)
        except TerminatedWorkerError:
            raise WorkersLost("a worker process was killed: out of memory?") from None

    def close(self) -> None:
        """They leave on their own."""


class Cluster:
    """The workers of a Dask scheduler that is running already: same flights, same results, other machines."""

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ModuleNotFoundError as error:
            raise NoCluster(f"--dask needs {error.name}, which is not installed: pip install 'trustr[dask]'") from None
        for name in ("distributed", "distributed.client"):  # what it would say with a traceback, we say in a sentence
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            asyncio.run(_reach(address))
        except Exception as error:  # a server of another kind may answer anything
            raise NoCluster(f"--dask {address}: no scheduler answers there: {_first_line(error)}") from None
        self._client: Any = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        try:
            self.count = self._checked(address)
        except BaseException:
            self.close()
            raise

    def _checked(self, address: str) -> int:
        """Threads of all workers, each of which must have what flies here."""
        threads = self._client.nthreads()
        if not threads:
            raise NoCluster(f"--dask {address}: no worker has joined this scheduler")
        ours = version("trustr")
        answers = self._client.run(version, "trustr", on_error="return")
        for worker, theirs in answers.items():
            if theirs != ours:
                has = "no trustr" if isinstance(theirs, Exception) else f"trustr {theirs}"
                raise NoCluster(f"--dask {address}: worker {worker} has {has}, this machine has {ours}")
        return sum(threads.values())

    def map(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """As `Workers`."""
        import distributed

        waiting = iter(tasks)
        futures = self._client.map(function, list(islice(waiting, AT_ONCE)), pure=False)
        done = distributed.as_completed(futures, loop=self._client.loop)
        del futures  # the cluster forgets a result when nobody here holds it
        try:
            for future in done:
                for task in islice(waiting, 1):
                    done.add(self._client.submit(function, task, pure=False))
                yield future.result()
        except (OSError, RuntimeError, distributed.CancelledError, distributed.KilledWorker) as error:
            raise WorkersLost(f"the Dask cluster is gone, or lost a flight: {_first_line(error)}") from None
        finally:
            self._client.cancel(list(done.futures))

    def close(self) -> None:
        """Leave the cluster as it was."""
        self._client.close(timeout=CONNECT_S)


async def _reach(address: str) -> None:
    """Knock, before a client is built, for one that cannot connect takes its time to go."""
    from distributed import Security
    from distributed.comm import connect

    comm = await connect(address, timeout=CONNECT_S, **Security().get_connection_args("client"))
    await comm.close()


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
