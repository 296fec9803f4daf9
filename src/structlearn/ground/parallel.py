"""Independent pieces of work over the cores or over a Dask cluster, with a progress bar.

The environment variable `STRUCTLEARN_BACKEND` says where: `fork`, the default, in processes on this machine,
as many as there are cores or as `STRUCTLEARN_PROCESSES` says; `dask` on the cluster whose scheduler
`DASK_SCHEDULER_ADDRESS` names; `sequential` in this process.

Processes are forked from this one at the first work, which takes hundredths of a second where interpreters
that import everything anew take seconds. They stay for the next work, so each loads compiled code once.
"""

import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, TypeVar
from urllib.parse import urlsplit

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from structlearn.ground.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

Item = TypeVar("Item")
Result = TypeVar("Result")

BACKEND = "STRUCTLEARN_BACKEND"
PROCESSES = "STRUCTLEARN_PROCESSES"
SCHEDULER = "DASK_SCHEDULER_ADDRESS"

UNENCRYPTED = "STRUCTLEARN_UNENCRYPTED_DASK"

ANSWER_S = 10.0
"""A scheduler that runs answers within milliseconds."""

WORKERS_S = 60.0
"""Workers that were started together with the scheduler have joined by then."""

tqdm.monitor_interval = 0  # no thread of its own: processes are forked beside it


def parallel_map(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    description: str,
    lost: Callable[[Item], Result] | None = None,
    local: bool = False,
) -> list[Result]:
    """Apply a function to every item, in processes, and keep the order.

    A process may die: killed for want of memory, or by a crash in compiled code. With `lost` the results so
    far are kept, the items that may be to blame run once more, one at a time, and the rest goes on in
    parallel. So only an item that ends its process also when it runs alone is lost, whatever the number of
    processes.

    Args:
        function: a picklable function of one item; randomness must come from a seed in the item.
        items: the work.
        description: what the progress bar says.
        lost: result of an item that ends its process.
        local: the work needs files of this machine and is not for a cluster.

    Returns:
        The results in the order of the items, whatever the number of processes.

    Raises:
        InputError: a variable of the environment makes no sense, or the cluster cannot be reached.
        RuntimeError: a process died, and there is no `lost`.
    """
    work = list(items)
    run = _backend(local)
    results: dict[int, Result] = {}
    # `disable=None`: no bar where nobody watches.
    with tqdm(total=len(work), desc=description, leave=False, disable=None) as bar:

        def take(places: Iterable[int]) -> None:
            for place, result in run(function, {place: work[place] for place in places}):
                results[place] = result
                bar.update()

        while len(results) < len(work):
            try:
                take(place for place in range(len(work)) if place not in results)
            except _ProcessDied as death:
                if lost is None:
                    numbers = ", ".join(str(place + 1) for place in death.places)
                    raise RuntimeError(
                        f"{description}: a process died; of {len(work)} items it worked on one of {numbers}"
                    ) from death
                for place in death.places:
                    try:
                        take([place])
                    except _ProcessDied:
                        results[place] = lost(work[place])
                        bar.update()
    return [results[place] for place in range(len(work))]


class _ProcessDied(Exception):  # noqa: N818 - it says what happened, and no caller sees it
    """Some process ended while it worked; `places` are those of the items that may be to blame."""

    def __init__(self, places: Iterable[int]):
        super().__init__()
        self.places = sorted(places)


def _backend(local: bool) -> Callable[[Callable, Mapping[int, Item]], Iterator[tuple[int, Result]]]:
    """What runs a function on items by place, and gives places and results as they come."""
    if _works_for_another:
        return _in_a_loop  # the cores have their processes already
    name = os.environ.get(BACKEND, "fork")
    backends = {
        "fork": _in_processes,
        "dask": _in_processes if local else _on_cluster,
        "sequential": _in_a_loop,
    }
    if name not in backends:
        raise InputError(f"{BACKEND}={name}: is not one of {', '.join(backends)}")
    return backends[name]


def _in_a_loop(function: Callable[[Item], Result], work: Mapping[int, Item]) -> Iterator[tuple[int, Result]]:
    return ((place, function(item)) for place, item in work.items())


def _in_processes(
    function: Callable[[Item], Result], work: Mapping[int, Item]
) -> Iterator[tuple[int, Result]]:
    """By processes of this machine; no more items are handed out than keep them busy, so few are to blame."""
    count = _process_count()
    pool = _processes(count)
    waiting = iter(work.items())
    running: dict[Future, int] = {}
    try:
        while True:
            for place, item in islice(waiting, 2 * count - len(running)):
                running[pool.submit(function, item)] = place
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                result = future.result()
                yield running.pop(future), result
    except BrokenProcessPool as error:
        _end_processes()
        raise _ProcessDied(running.values()) from error
    finally:
        for future in running:
            future.cancel()


def _process_count() -> int:
    """Processes at a time."""
    given = os.environ.get(PROCESSES, "")
    if given and not (given.isdecimal() and int(given)):
        raise InputError(f"{PROCESSES}={given}: is no number of processes")
    if given:
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_pools: dict[int, ProcessPoolExecutor] = {}
"""By its number of processes; there is one at a time."""

_works_for_another = False
"""Whether this process is one of a pool."""


def _processes(count: int) -> ProcessPoolExecutor:
    if count not in _pools:
        _end_processes()
        context = multiprocessing.get_context("fork")
        _pools[count] = ProcessPoolExecutor(
            count, mp_context=context, initializer=_begin_to_work, initargs=(os.getpid(),)
        )
    return _pools[count]


def _end_processes() -> None:
    while _pools:
        _, pool = _pools.popitem()
        pool.shutdown(cancel_futures=True)


def _begin_to_work(parent: int) -> None:
    """In a new process: end with the parent, and keep to one core.

    BLAS and OpenMP, so torch too, whose threads did not survive the fork, take one thread.
    """
    global _works_for_another
    _works_for_another = True
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    threadpool_limits(1)
    os.environ["OMP_NUM_THREADS"] = "1"  # of libraries that are loaded later


def _end_with(parent: int) -> None:
    """A parent that is killed, as for want of memory, cannot tell its processes to end."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _on_cluster(function: Callable[[Item], Result], work: Mapping[int, Item]) -> Iterator[tuple[int, Result]]:
    """Places and results as they come, by Dask, which tries four times where a worker's process dies."""
    client = _connected()
    from distributed import KilledWorker, as_completed

    places = {client.submit(partial(function, item), pure=False): place for place, item in work.items()}
    killed = {}
    for future in as_completed(places):
        place = places.pop(future)
        try:
            result = future.result()
        except KilledWorker as error:
            killed[place] = error
        else:
            yield place, result
    if killed:
        raise _ProcessDied(killed) from next(iter(killed.values()))


def _private(address: str) -> bool:
    """Whether nobody else can speak to a scheduler: it is encrypted, or on this machine only."""
    given = urlsplit(address if "://" in address else f"tcp://{address}")
    local = given.hostname == "localhost" or str(given.hostname).startswith("127.")
    return local or given.scheme not in ("tcp", "ws")


def _connected() -> "Client":
    """The client of this process, connected at the first call.

    Raises:
        InputError: Dask is not installed, the scheduler has no address or does not answer, or has no workers.
    """
    try:
        import dask
        from distributed import Client
    except ImportError as error:
        raise InputError(f"{BACKEND}=dask needs the package `distributed`, of the extra `cluster`") from error
    try:
        return Client.current()
    except ValueError:
        address = dask.config.get("scheduler-address", None)
    if not address:
        raise InputError(f"{BACKEND}=dask needs the scheduler's address in {SCHEDULER}, e.g. tcp://host:8786")
    if not (_private(address) or os.environ.get(UNENCRYPTED) == "yes"):
        raise InputError(
            f"{SCHEDULER}={address}: whoever reaches this port can run code here; use tls:// with "
            f"certificates, or, in a network that only you reach, {UNENCRYPTED}=yes"
        )
    # Not for the user: that the work is large, and that results which died with a worker are worked out anew.
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"})
    logging.getLogger("distributed.client").setLevel(logging.ERROR)
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        raise InputError(f"{SCHEDULER}={address}: no Dask scheduler answers ({error})") from error
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        client.close()
        raise InputError(f"{SCHEDULER}={address}: no worker has joined within {WORKERS_S:.0f} s") from error
    return client
