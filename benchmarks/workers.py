"""What more workers gain: guided demonstrations on the simulated board, by one process, two, and Dask.

    python benchmarks/workers.py [--demonstrations N] [--output table.csv]

Wall times, so on a machine that does nothing else. What is compiled is compiled and workers have started
before the clock runs; handing out work and bringing recordings back is part of it.
"""

import argparse
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import pandas as pd
from timing import at_least_one, machine

from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters, guided_demonstrations
from structlearn.core.artefacts import write_csv
from structlearn.core.parallel import BACKEND, PROCESSES
from structlearn.core.params import read_parameters
from structlearn.readers.demonstration import Recording

PARAMETER_FILE = Path(__file__).parents[1] / "params.yaml"
DEMONSTRATIONS, ROUNDS = 16, 2


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--demonstrations", type=at_least_one, default=DEMONSTRATIONS, help="pieces of work")
    parser.add_argument("--output", type=Path, help="write the rows to this CSV file too")
    options = parser.parse_args()
    rows = []
    for name, workers, setting in (
        ("one process", 1, environment({BACKEND: "sequential"})),
        ("two processes", 2, environment({PROCESSES: "2"})),
        ("Dask", 2, dask_workers(2)),
    ):
        with setting:
            seconds = shortest(options.demonstrations)
        gain = rows[0]["seconds"] / seconds if rows else 1.0
        rows.append(
            {
                "by": name,
                "workers": workers,
                "seconds": seconds,
                "speed_up": gain,
                "efficiency": gain / workers,
            }
        )
    table = pd.DataFrame(rows)
    print(machine())
    print(f"{options.demonstrations} demonstrations on the simulated board, shortest of {ROUNDS}")
    print(table.to_string(index=False, float_format="{:.2f}".format))
    if options.output:
        write_csv(table, options.output)


def shortest(count: int) -> float:
    """Wall time in s of so many demonstrations."""
    work(2)  # starts workers and compiles
    times = []
    for _ in range(ROUNDS):
        begin = perf_counter()
        work(count)
        times.append(perf_counter() - begin)
    return min(times)


def work(count: int) -> list[Recording]:
    """So many demonstrations, each a simulated movement of the arm by a person."""
    demonstrator = read_parameters(PARAMETER_FILE, "simulate", DemonstratorParameters)
    testbed = read_parameters(PARAMETER_FILE, "testbed", TestbedParameters)
    person = demonstrator.model_copy(update={"count": count})
    return guided_demonstrations(person, testbed.guidance, testbed)


@contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Run with these variables of the environment."""
    before = dict(os.environ)
    os.environ.update(variables)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def dask_workers(count: int) -> Iterator[None]:
    """Run on a Dask cluster of this machine, a process per worker."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster),  # which the parallel loops find
        environment({BACKEND: "dask"}),
    ):
        yield


if __name__ == "__main__":
    main()
