"""Parallel map over the cores or over a Dask cluster, with a progress bar.

The environment variable `STRUCTLEARN_BACKEND` selects where: `fork` (default) in processes on this machine,
as many as cores or as `STRUCTLEARN_PROCESSES`; `dask` on the cluster with the scheduler
`DASK_SCHEDULER_ADDRESS`; `sequential` in this process. Processes are forked, since new interpreters would
import for seconds, and reused, so that each loads compiled code once.
"""

import logging
import multiprocessing
import os
import platform
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache, partial
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import urlsplit

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from structlearn.core import processor
from structlearn.core.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

Item = TypeVar("Item")
Result = TypeVar("Result")

BACKEND = "STRUCTLEARN_BACKEND"
PROCESSES = "STRUCTLEARN_PROCESSES"
SCHEDULER = "DASK_SCHEDULER_ADDRESS"
UNENCRYPTED = "STRUCTLEARN_UNENCRYPTED_DASK"

ANSWER_S = 10.0  # a running scheduler answers within milliseconds
WORKERS_S = 60.0  # time for workers started together with the scheduler to join, or to be replaced
CHECK_S = 1.0  # interval of checks that the cluster is alive

tqdm.monitor_interval = 0  # no monitor thread, since processes are forked


def parallel_map(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    description: str,
    lost: Callable[[Item], Result] | None = None,
    local: bool = False,
    finished: Callable[[Item, Result], None] | None = None,
) -> list[Result]:
    """Apply a picklable function to every item, in processes; results are in the order of the items.

    Randomness must come from a seed in the item. A process may die, out of memory or by a crash in compiled
    code. With `lost`, items without a result are then run again one at a time, and an item that kills its
    process again has the result `lost(item)`. `local`: the work needs files of this machine, so it does not
    run on a cluster. `finished` is called here with each item and its result as soon as it is there. Raises
    InputError: an environment variable is invalid, or the cluster cannot be reached,
    ends before the work, or has a worker that is not pinned although this process is (`processor`);
    RuntimeError: a process died, and there is no `lost`.
    """
    work, backend = list(items), _backend()
    bar = partial(tqdm, desc=description, leave=False, disable=None)  # only on a terminal
    results: dict[int, Result] = {}

    def keep(place: int, result: Result) -> None:
        results[place] = result
        if finished:
            finished(work[place], result)

    if backend == "sequential":
        with threadpool_limits(1):  # as in processes: products of matrices depend on the number of threads
            for place, item in enumerate(bar(work)):
                keep(place, function(item))
        return list(results.values())
    cluster = backend == "dask" and not local
    if cluster and processor.pinned():
        function = partial(_pinned_call, function)
    with bar(total=len(work)) as progress:

        def take(places: Iterable[int]) -> None:
            """Store the results of items, except those whose process died."""
            pool, death, check = _cluster() if cluster else _machine()
            running: dict[Future[Any], int] = {}
            try:
                with suppress(death):  # a broken pool accepts no more items
                    for place in places:
                        running[pool.submit(partial(function, work[place]))] = place
                for future in _completed(running, check):
                    with suppress(death):
                        result = future.result()
                        keep(running[future], result)
                        progress.update()
            except (CancelledError, OSError):
                check()  # is it the item's own error, or has the cluster ended?
                raise
            finally:
                for future in running:
                    future.cancel()
            if any(place not in results for place in places):
                _end_processes()

        take(range(len(work)))
        for place in [place for place in range(len(work)) if place not in results]:
            if lost is None:
                raise RuntimeError(
                    f"{description}: a process died; of {len(work)} items number {place + 1} has no result"
                )
            take([place])
            if place not in results:
                keep(place, lost(work[place]))
                progress.update()
    return [results[place] for place in range(len(work))]


Workplace = tuple[Executor, type[Exception], Callable[[], None]]
"""Where items run, the error if one's process has died, and a check that more results can come."""


def _completed(running: Iterable[Future[Any]], check: Callable[[], None]) -> Iterator[Future[Any]]:
    """Futures as they complete, with a check every `CHECK_S`."""
    left = set(running)
    while left:
        with suppress(TimeoutError):
            for future in as_completed(left, timeout=CHECK_S):
                left.discard(future)
                yield future
        check()


class _Pool(ProcessPoolExecutor):
    """A pool that ends when its processes have died, also before Python 3.11.5 (gh-94777 of CPython).

    There it waits for ever for somebody to take an item that is larger than a pipe's buffer.
    """

    def _start_executor_manager_thread(self) -> None:
        begun = self._executor_manager_thread is not None
        super()._start_executor_manager_thread()
        if sys.version_info < (3, 11, 5) and not begun:
            thread: Any = self._executor_manager_thread
            terminate, reader = thread.terminate_broken, thread.call_queue._reader
            thread.terminate_broken = lambda cause: (reader.close(), terminate(cause))


_pools: dict[int, _Pool] = {}  # by number of processes; at most one at a time


def _machine() -> Workplace:
    """The processes of this machine, whose ends the pool reports itself."""
    return _processes(), BrokenProcessPool, lambda: None


def at_once() -> int:
    """Number of items that `parallel_map` works on at once. Raises InputError: as it does."""
    backend = _backend()
    if backend == "dask":
        _cluster()
        from distributed import Client

        return sum(Client.current().nthreads().values())
    return 1 if backend == "sequential" else _process_count()


def _backend() -> str:
    backend = os.environ.get(BACKEND, "fork")
    if backend not in ("fork", "dask", "sequential"):
        raise InputError(f"{BACKEND}={backend}: is not one of fork, dask, sequential")
    return backend


def _process_count() -> int:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    given = os.environ.get(PROCESSES) or str(cores or 1)
    if not (given.isdecimal() and int(given)):
        raise InputError(f"{PROCESSES}={given}: is no number of processes")
    return int(given)


def _processes() -> ProcessPoolExecutor:
    """Process pool of this machine, reused if its size is unchanged."""
    count = _process_count()
    if count not in _pools:
        _end_processes()
        context = multiprocessing.get_context("fork")
        _pools[count] = _Pool(count, context, _begin_to_work, (os.getpid(),))
    return _pools[count]


def _end_processes() -> None:
    while _pools:
        _pools.popitem()[1].shutdown(cancel_futures=True)


def _begin_to_work(parent: int) -> None:
    """Initialise a new process: it ends with its parent, and BLAS, OpenMP and torch use one thread."""
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    threadpool_limits(1)
    os.environ["OMP_NUM_THREADS"] = "1"  # for libraries that are loaded later
    os.environ[BACKEND] = "sequential"  # no nested processes


def _end_with(parent: int) -> None:
    """Exit when the parent has been killed, which cannot end its processes."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _cluster() -> Workplace:
    """The cluster, connected on the first call; a worker's error is raised when it has died four times."""
    try:
        import dask
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise InputError(f"{BACKEND}=dask needs the package `distributed`, of the extra `cluster`") from error
    with suppress(ValueError):
        client = Client.current()
        return client.get_executor(pure=False), KilledWorker, _watch(client)
    address = dask.config.get("scheduler-address", None)
    if not address:
        raise InputError(f"{BACKEND}=dask needs the scheduler's address in {SCHEDULER}, e.g. tcp://host:8786")
    if not (_private(address) or os.environ.get(UNENCRYPTED) == "yes"):
        raise InputError(
            f"{SCHEDULER}={address}: whoever reaches this port can run code here; use tls:// with "
            f"certificates, or, in a network that only you reach, {UNENCRYPTED}=yes"
        )
    # no warnings about large work, and no messages about deaths, which are reported here
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"})
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError, TypeError) as error:  # TypeError: TLS without certificates
        raise InputError(f"{SCHEDULER}={address}: no Dask scheduler answers ({error})") from error
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        client.close()
        raise InputError(f"{SCHEDULER}={address}: no worker has joined within {WORKERS_S:.0f} s") from error
    return client.get_executor(pure=False), KilledWorker, _watch(client)


def _pinned_call(function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function in a worker. Raises InputError: its results would differ from those of this process."""
    _require_pinned_worker()
    return function(item)


@cache
def _require_pinned_worker() -> None:
    processor.pin()
    if found := processor.deviations():
        raise InputError(
            f"the Dask worker on {platform.node()}: {found}; start workers on processors with AVX2, with the "
            f"variables that `python -m {processor.__name__}` prints"
        )


def _watch(client: "Client") -> Callable[[], None]:
    """Check that a cluster's scheduler answers and that it has not been without workers for `WORKERS_S`.

    Dask itself would wait for workers without end.
    """
    address, seen_s = client.scheduler.address, time.monotonic()

    def check() -> None:
        nonlocal seen_s
        try:
            workers = client.status == "running" and client.scheduler_info()["workers"]
        except (CancelledError, OSError):
            workers = False
        if workers:
            seen_s = time.monotonic()
        elif workers is False or time.monotonic() - seen_s > WORKERS_S:
            with suppress(TimeoutError):
                client.close(timeout=ANSWER_S)
            lost = f"has had no worker for {WORKERS_S:.0f} s" if workers is not False else "no longer answers"
            raise InputError(f"{SCHEDULER}={address}: the Dask scheduler {lost}; run it again")

    return check


def _private(address: str) -> bool:
    """Whether the connection to a scheduler is encrypted or stays on this machine."""
    try:
        given = urlsplit(address if "://" in address else f"tcp://{address}")
        host = given.hostname or ""
        return given.scheme in ("tls", "inproc") or host == "localhost" or ip_address(host).is_loopback
    except ValueError:  # a host name, which may resolve to any address
        return False
