"""Numba's cache: which state of the sources it belongs to, and several processes that fill it at once."""

import importlib
import multiprocessing
import os
import shutil
import subprocess
import sys
import time

import pytest

from structlearn.core import compilation

FUNCTION = """
from structlearn.core.compilation import numba

@numba.njit(cache=True)
def doubled(x):
    return x + x
"""


def test_an_edit_of_any_compiled_source_and_of_no_other_gives_another_folder(tmp_path):
    (tmp_path / "rooms").mkdir()
    files = {"caller.py": "import numba\n", "rooms/callee.py": "import numba\nx = 1\n"}
    digests = []
    for edit in ({}, {"rooms/callee.py": "import numba\nx = 2\n"}, files, {"page.py": "text = 'anything'\n"}):
        for name, text in (files | edit).items():
            (tmp_path / name).write_text(text)
        digests.append(compilation.sources_digest(tmp_path))
    assert digests[0] == digests[2] == digests[3] != digests[1]


def test_the_folder_is_the_users_own_unless_chosen_and_unused_ones_are_removed(tmp_path, monkeypatch):
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setattr(compilation.numba.config, "CACHE_DIR", "/somewhere")
    compilation.use_own_cache(package)
    assert compilation.numba.config.CACHE_DIR == "/somewhere"
    now = time.time()
    for name, used in {"compiled-old": now - 1.1 * compilation.UNUSED_S, "compiled-new": now}.items():
        (tmp_path / "caches" / "package" / name).mkdir(parents=True)
        lock = tmp_path / "caches" / "package" / name / compilation.LOCK
        lock.touch()
        os.utime(lock, (used, used))
    monkeypatch.setattr(compilation.numba.config, "CACHE_DIR", "")
    compilation.use_own_cache(package)
    digest = compilation.sources_digest(package)
    assert str(tmp_path / "caches" / "package" / f"compiled-{digest}") == compilation.numba.config.CACHE_DIR
    assert [path.name for path in (tmp_path / "caches" / "package").iterdir()] == ["compiled-new"]


CALL = """
import numpy as np
from structlearn.primitives.orientation import turned
turned(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))
print(sum(turned.stats.cache_misses.values()))
"""


def test_a_moved_package_compiles_nothing_again(tmp_path, root):
    source = root / "src" / "structlearn"
    shutil.copytree(source, tmp_path / "a" / "structlearn", ignore=shutil.ignore_patterns("__pycache__"))
    compiled = []
    for name in ("a", "b"):
        environment = os.environ | {"PYTHONPATH": str(tmp_path / name), "XDG_CACHE_HOME": str(tmp_path)}
        command = [sys.executable, "-c", CALL]
        compiled.append(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)
        (tmp_path / name).rename(tmp_path / "b")
    assert compiled == [b"1\n", b"0\n"]


CHANGE = """
import os
from structlearn.core.compilation import numba
os.environ["NUMBA_BOUNDSCHECK"] = "1"
for value in (2, 2.5):
    numba.njit(lambda x: x + x)(value)
print(numba.config.CACHE_DIR)
"""


def test_a_variable_of_numba_that_changes_later_leaves_the_cache_where_it_is(tmp_path, root):
    """Numba then reads all its variables again, and would forget the folder that was chosen here."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(root / "src"), "XDG_CACHE_HOME": str(tmp_path / "caches")}
    command = [sys.executable, "-c", CHANGE]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(str(tmp_path / "caches"))
    assert [path.name for path in tmp_path.iterdir()] == ["caches"]


def work(folder, values, barrier, outcome):
    """In a forked process: call the function on each value; report the results and what was compiled."""
    from numba.core.caching import IndexDataCacheFile

    replaced = IndexDataCacheFile._save_index

    def slowly(self, overloads):
        time.sleep(0.2)
        replaced(self, overloads)

    IndexDataCacheFile._save_index = slowly
    compilation.numba.config.CACHE_DIR = str(folder / "cache")
    sys.path.insert(0, str(folder))
    doubled = importlib.import_module("filled_at_once").doubled
    barrier.wait()
    results = [doubled(value) for value in values]
    outcome.put((results, sum(doubled.stats.cache_misses.values())))


@pytest.mark.parametrize("together", [[[1, 2.5]] * 3, [[1], [2.5], [1 + 1j]]], ids=["alike", "different"])
def test_processes_that_fill_the_cache_at_once_compile_once_and_mix_nothing(tmp_path, together):
    """Each stands between reading and writing the index for so long that without a lock all would meet."""
    (tmp_path / "filled_at_once.py").write_text(FUNCTION)
    context = multiprocessing.get_context("fork")

    def outcomes(groups):
        barrier, found = context.Barrier(len(groups)), context.Queue()
        processes = [context.Process(target=work, args=(tmp_path, g, barrier, found)) for g in groups]
        for process in processes:
            process.start()
        every = [found.get(timeout=60) for _ in processes]
        for process in processes:
            process.join()
        return every

    types = {value for values in together for value in values}
    first = outcomes(together)
    assert all(result in ([2 * v for v in values] for values in together) for result, _ in first)
    assert sum(misses for _, misses in first) == len(types)
    assert outcomes([sorted(types, key=abs)]) == [([2 * value for value in sorted(types, key=abs)], 0)]


def fork_each(*works):
    """Exit codes of functions, each in a process of its own."""
    context = multiprocessing.get_context("fork")
    processes = [context.Process(target=work) for work in works]
    for process in processes:
        process.start()
    for process in processes:
        process.join(timeout=60)
    return [process.exitcode for process in processes]


def test_a_process_waits_for_no_function_that_it_does_not_need(tmp_path, monkeypatch):
    """One is kept in the middle of compiling until the other has compiled and saved."""
    monkeypatch.setattr(compilation.numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("first_of_two", "second_of_two"):
        (tmp_path / f"{name}.py").write_text(FUNCTION)
    begun, saved = (multiprocessing.get_context("fork").Event() for _ in range(2))

    class Pause(compilation.Listener):
        def on_start(self, event):
            begun.set()
            assert saved.wait(timeout=30)

        def on_end(self, event):
            pass

    def pausing():
        compilation.register("numba:compile", Pause())
        assert importlib.import_module("first_of_two").doubled(2) == 4

    def passing():
        assert begun.wait(timeout=30)
        assert importlib.import_module("second_of_two").doubled(2) == 4
        saved.set()

    assert fork_each(pausing, passing) == [0, 0]


def test_processes_that_would_wait_for_each_other_do_not(tmp_path, monkeypatch):
    """One of the two goes on without the lock; both give back what they hold at their ends."""
    monkeypatch.setattr(compilation.numba.config, "CACHE_DIR", str(tmp_path))
    context = multiprocessing.get_context("fork")
    barrier, outcome = context.Barrier(2), context.Queue()

    def both(first, second):
        compilation.locks.on_start(None)
        assert compilation.locks.acquire(first)
        barrier.wait()
        outcome.put(compilation.locks.acquire(second))
        compilation.locks.on_end(None)

    assert fork_each(lambda: both("caller", "callee"), lambda: both("callee", "caller")) == [0, 0]
    assert sorted(outcome.get(timeout=10) for _ in range(2)) == [False, True]
