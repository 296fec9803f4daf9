"""Independent pieces of work over the cores or over a Dask cluster, with a progress bar.

The environment variable `STRUCTLEARN_BACKEND` says where: `loky`, the default, is joblib's processes on this
machine, as many as there are cores (fewer by `LOKY_MAX_CPU_COUNT`); another name is another backend of joblib
(`threading`, `sequential`); `dask` is the cluster whose scheduler `DASK_SCHEDULER_ADDRESS` names.

The cluster is asked directly: joblib's own Dask backend waits for ever for work whose process died (1.6).
"""

import logging
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError
from tqdm import tqdm

from structlearn.ground.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

Item = TypeVar("Item")
Result = TypeVar("Result")

BACKEND = "STRUCTLEARN_BACKEND"
SCHEDULER = "DASK_SCHEDULER_ADDRESS"

ANSWER_S = 10.0
"""A scheduler that runs answers within milliseconds."""

WORKERS_S = 60.0
"""Workers that were started together with the scheduler have joined by then."""


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
        InputError: the cluster cannot be reached.
        RuntimeError: a process died, and there is no `lost`.
    """
    work = list(items)
    backend = os.environ.get(BACKEND, "loky")
    if local and backend == "dask":
        backend = "loky"
    run = _on_cluster if backend == "dask" else partial(_in_processes, backend=backend)
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


def _in_processes(
    function: Callable[[Item], Result], work: Mapping[int, Item], backend: str
) -> Iterator[tuple[int, Result]]:
    """Places and results as they come, by joblib."""
    handed_out = set()

    def calls() -> Iterator[tuple]:
        for place, item in work.items():
            handed_out.add(place)
            yield joblib.delayed(_placed)(function, place, item)

    count = joblib.cpu_count()
    parallel = joblib.Parallel(
        n_jobs=max(count, 2),  # the only job of one would run in this process, and could end it
        backend=backend,
        return_as="generator_unordered",
        pre_dispatch="2 * n_jobs" if count > 1 else 1,
    )
    try:
        for place, result in parallel(calls()):
            handed_out.remove(place)
            yield place, result
    except TerminatedWorkerError as error:
        raise _ProcessDied(handed_out) from error


def _placed(function: Callable[[Item], Result], place: int, item: Item) -> tuple[int, Result]:
    return place, function(item)


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
