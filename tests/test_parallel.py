"""Independent work: the same results from a loop, processes and a cluster, also where processes die."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

import dask
import numpy as np
import parallel_work as work
import pytest
from distributed import Client, LocalCluster
from threadpoolctl import threadpool_limits

from structlearn.core import parallel, processor
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map


@pytest.fixture(autouse=True)
def _in_processes(monkeypatch):
    monkeypatch.delenv(parallel.BACKEND)  # the tests\' own choice


@pytest.fixture(params=["1", "2"])
def count(request, monkeypatch):
    """Number of processes."""
    monkeypatch.setenv("STRUCTLEARN_PROCESSES", request.param)
    return int(request.param)


@pytest.fixture(scope="module")
def cluster():
    """Two worker processes; work whose worker dies once has failed, so the innocent do too, and soon."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs="CRITICAL"
        ) as local,
    ):
        yield local


@pytest.fixture
def chosen(monkeypatch):
    """The user has asked for the cluster; whatever is connected is closed afterwards."""
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "dask")
    with dask.config.set({"scheduler-address": None}):
        yield
    with suppress(ValueError):
        Client.current().close()


@pytest.fixture
def impatient(chosen, monkeypatch):
    monkeypatch.setattr(parallel, "ANSWER_S", 0.2)
    monkeypatch.setattr(parallel, "WORKERS_S", 0.2)


@pytest.fixture
def on_cluster(chosen, cluster):
    with dask.config.set({"scheduler-address": cluster.scheduler_address}):
        yield


def test_processes_give_what_a_loop_gives_and_stay_for_the_next_work(count):
    """To the bit, in the order of the items, whoever finishes first, of any iterable."""
    seeds = range(4)
    with threadpool_limits(1):
        expected = [work.noisy_matrix(seed) for seed in seeds]
    assert parallel_map(work.noisy_matrix, seeds, "matrices") == expected
    squares = parallel_map(work.slow_first_square, (item for item in range(12)), "squares")
    assert squares == [item**2 for item in range(12)]
    assert parallel_map(abs, [], "nothing") == []
    with pytest.raises(TypeError, match="unsupported operand"):  # an error is no death
        parallel_map(work.square, ["text"], "squares", lost=work.missing)
    first, second = (parallel_map(work.process_of, range(20), "processes") for _ in range(2))
    assert len(set(first + second)) <= count
    for process, inner in parallel_map(work.processes_within, range(2), "processes"):
        assert set(inner) == {process}  # what is shared within a process is not shared again


def test_torch_works_after_this_process_has_used_its_threads(monkeypatch):
    """Threads do not survive a fork; a process that waited for them would wait for ever."""
    monkeypatch.setenv("STRUCTLEARN_PROCESSES", "2")
    expected_sums = [work.product_of_ones(item) for item in range(4)]
    parallel._end_processes()
    assert parallel_map(work.product_of_ones, range(4), "products") == expected_sums


@pytest.mark.parametrize(
    ("variable", "value"), [("BACKEND", "loky"), ("PROCESSES", "0"), ("PROCESSES", "two")]
)
def test_a_variable_that_makes_no_sense(monkeypatch, variable, value):
    monkeypatch.setenv(f"STRUCTLEARN_{variable}", value)
    with pytest.raises(InputError, match=f"^STRUCTLEARN_{variable}={value}: is"):
        parallel_map(work.square, range(3), "squares")


def expected(count, deadly=()):
    return [("lost", item) if item in deadly else item**2 for item in range(count)]


@pytest.mark.parametrize("deadly", [{0}, {11}, {2, 9}])
def test_only_what_ends_its_process_is_lost(deadly):
    found = parallel_map(partial(work.square, deadly=deadly), range(12), "squares", lost=work.missing)
    assert found == expected(12, deadly)
    with pytest.raises(RuntimeError, match=r"^squares: a process died; of 1 items number 1 has no result"):
        parallel_map(partial(work.square, deadly=deadly), [max(deadly)], "squares")
    assert parallel_map(work.square, range(3), "squares") == expected(3)  # the next work has new processes


def test_a_process_that_dies_leaves_items_behind_that_no_pipe_holds():
    """Before Python 3.11.5 a pool does not end by itself until somebody takes them."""
    items = [np.full(100_000, float(number)) for number in range(8)]
    found = parallel_map(work.first_number, items, "numbers", lost=lambda _: "lost")
    assert found == ["lost", *range(1, 8)]


def test_what_ends_its_process_once_is_tried_again(tmp_path):
    tried = partial(work.square_at_the_second_try, marker=tmp_path / "marker")
    assert parallel_map(tried, range(6), "squares", lost=work.missing) == expected(6)
    assert (tmp_path / "marker").exists()


def test_a_cluster_gives_what_a_loop_gives(on_cluster):
    seeds = range(20)
    assert parallel_map(work.noisy_mean, seeds, "means") == [work.noisy_mean(seed) for seed in seeds]
    first = Client.current()
    assert os.getpid() not in parallel_map(work.process_of, range(2), "processes")
    assert Client.current() is first
    # Dask would take a tuple that begins with a function for a call
    items = [(abs, -1), "text", ["text", {"key": (1, 2)}], None]
    assert parallel_map(repr, items, "items") == [repr(item) for item in items]
    found = parallel_map(partial(work.square, deadly={0, 5}), range(12), "squares", lost=work.missing)
    assert found == expected(12, {0, 5})


def test_work_on_files_of_this_machine_stays_here(chosen):
    assert parallel_map(work.square, range(3), "squares", local=True) == expected(3)
    with pytest.raises(InputError, match="DASK_SCHEDULER_ADDRESS"):
        parallel_map(work.square, range(3), "squares")


def test_the_environment_alone_chooses_the_cluster(cluster):
    """Nothing is printed that the program did not say."""
    script = (
        "from structlearn.core.parallel import parallel_map; print(parallel_map(abs, range(-9, 0), 'sizes'))"
    )
    chosen = {"STRUCTLEARN_BACKEND": "dask", "DASK_SCHEDULER_ADDRESS": cluster.scheduler_address}
    done = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, **chosen}, capture_output=True, text=True
    )
    assert done.stderr == ""
    assert done.stdout == f"{list(range(9, 0, -1))}\n"


SILENT, OPEN = "no Dask scheduler answers", "whoever reaches this port can run code here"
ADDRESSES = dict.fromkeys(("tcp://127.0.0.1:1", "localhost"), SILENT) | dict.fromkeys(
    (
        *("tcp://192.0.2.1:8786", "tcp://[::]:8786", "cluster:8786", "tcp://127.evil.example:1", "tcp://[1"),
        *("nonsense://x", "tcp://127.0.0.1.nip.io:1", "ucx://10.0.0.1:1", "ucxx://192.0.2.1:1"),
        "tcp://127.0.0.1@192.0.2.1:1",
    ),
    OPEN,
)


@pytest.mark.parametrize("address", ADDRESSES)
def test_a_scheduler_that_does_not_answer_or_that_others_can_reach_is_refused(impatient, address):
    with (
        dask.config.set({"scheduler-address": address}),
        pytest.raises(InputError, match=ADDRESSES[address]) as error,
    ):
        parallel_map(work.square, range(3), "squares")
    assert f"DASK_SCHEDULER_ADDRESS={address}: " in str(error.value)


def test_processes_end_with_a_parent_that_is_killed():
    program = """
import os, signal, sys
from structlearn.core import parallel
parallel.parallel_map(abs, range(4), "sizes")
print(*parallel._pools[2]._processes, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""
    environment = os.environ | {"STRUCTLEARN_PROCESSES": "2", "STRUCTLEARN_BACKEND": "fork"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, text=True, check=False
    )
    numbers = [int(number) for number in done.stdout.split()]
    assert len(numbers) == 2
    ends = time.monotonic() + 10.0
    while any(Path("/proc", str(number)).exists() for number in numbers):
        assert time.monotonic() < ends, "they live on"
        time.sleep(0.1)


def test_a_cluster_without_workers(impatient):
    with (
        LocalCluster(n_workers=0, processes=False, dashboard_address=":0") as empty,
        dask.config.set({"scheduler-address": empty.scheduler_address}),
        pytest.raises(InputError, match="no worker has joined within"),
    ):
        parallel_map(work.square, range(3), "squares")


CLUSTER = """
import sys
from structlearn.core import parallel
from structlearn.core.stage import run
import parallel_work
parallel._cluster()  # waits for the worker
parallel.WORKERS_S, parallel.CHECK_S = 1.0, 0.2
run(lambda: parallel.parallel_map(parallel_work.endless, sys.argv[1:], "work"))
"""


@pytest.mark.parametrize(
    ("killed", "said"),
    [("worker", "has had no worker for 1 s"), ("scheduler", "no longer answers")],
)
def test_a_cluster_that_ends_during_the_work_is_one_line(tmp_path, killed, said):
    """Dask would wait for other workers without end."""
    (tmp_path / "work.py").write_text(CLUSTER)
    with ExitStack() as ends:
        address, started = programs(ends, tmp_path)
        stage = subprocess.Popen(
            [sys.executable, "work.py", str(tmp_path / "begun")],
            cwd=tmp_path, env=on(address), stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        ends.callback(stage.kill)
        while not (tmp_path / "begun").exists() and stage.poll() is None:
            time.sleep(0.05)
        started[killed].kill()
        line = f"error: DASK_SCHEDULER_ADDRESS={address}: the Dask scheduler {said}; run it again\n"
        assert stage.communicate(timeout=60)[1] == line
    assert stage.returncode == 1


MAPPED = """
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run
run(lambda: print(parallel_map(abs, range(2), "sizes")), stage=False)
"""


@pytest.mark.skipif(not processor.pinned(), reason="not an x86-64 with AVX2, or not wanted")
def test_a_worker_that_is_not_pinned_is_refused_in_one_line(tmp_path):
    """Dask has loaded numpy before any work."""
    with ExitStack() as ends:
        address, _ = programs(ends, tmp_path, without=processor.PINS)
        command = [sys.executable, "-c", MAPPED]
        done = subprocess.run(command, env=on(address), cwd=tmp_path, capture_output=True, text=True)
    assert done.stderr.startswith("error: the Dask worker on ")
    assert "numpy was loaded before it was pinned" in done.stderr
    assert done.stderr.count("\n") == done.returncode == 1


def programs(ends: ExitStack, folder: Path, without: Iterable[str] = ()) -> tuple[str, dict]:
    """Address of a scheduler, and the programs of it and of a worker, started without some variables."""
    address = f"tcp://127.0.0.1:{unused_port()}"
    words = {
        "scheduler": ["--host", address, "--no-dashboard"],
        "worker": [address, "--no-nanny", "--no-dashboard", "--nthreads", "1"],
    }
    started, variables = {}, {name: value for name, value in on(address).items() if name not in without}
    for name, its in words.items():
        command = [sys.executable, "-m", f"distributed.cli.dask_{name}", *its]
        started[name] = subprocess.Popen(command, cwd=folder, env=variables, stderr=subprocess.DEVNULL)
        ends.callback(started[name].wait)
        ends.callback(started[name].kill)
    return address, started


def on(address: str) -> dict[str, str]:
    """Environment of a user who has asked for a cluster."""
    return os.environ | {
        "PYTHONPATH": str(Path(work.__file__).parent),
        "STRUCTLEARN_BACKEND": "dask",
        "DASK_SCHEDULER_ADDRESS": address,
    }


def unused_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
