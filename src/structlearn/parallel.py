"""Independent pieces of work over the cores, with a progress bar.

joblib's default backend runs processes on this machine. The environment variable `STRUCTLEARN_BACKEND` names
another registered joblib backend (e.g. `dask` or `threading`), so that a cluster can take the same loops.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import joblib
from tqdm import tqdm

Item = TypeVar("Item")
Result = TypeVar("Result")


def parallel_map(function: Callable[[Item], Result], items: Iterable[Item], description: str) -> list[Result]:
    """Apply a function to every item, in processes, and keep the order.

    Args:
        function: a picklable function of one item; randomness must come from a seed in the item.
        items: the work.
        description: what the progress bar says.

    Returns:
        The results in the order of the items, whatever the number of processes.
    """
    work: Sequence[Item] = list(items)
    with joblib.parallel_config(backend=os.environ.get("STRUCTLEARN_BACKEND", "loky"), n_jobs=-1):
        results = joblib.Parallel(return_as="generator")(joblib.delayed(function)(item) for item in work)
        bar = tqdm(results, total=len(work), desc=description, leave=False, disable=None)
        return list(bar)  # `disable=None`: no bar where nobody watches
