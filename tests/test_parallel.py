import time

import numpy as np

from structlearn.parallel import parallel_map


def noisy_mean(seed):
    return np.random.default_rng(seed).normal(size=1000).mean()


def test_processes_give_what_a_loop_gives():
    seeds = range(20)
    assert parallel_map(noisy_mean, seeds, "means") == [noisy_mean(seed) for seed in seeds]


def test_the_order_is_kept_whoever_finishes_first(monkeypatch):
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "threading")
    finished = []

    def work(item):
        time.sleep(0.1 if item == 0 else 0.0)
        finished.append(item)
        return item**2

    assert parallel_map(work, range(12), "squares") == [item**2 for item in range(12)]
    assert sorted(finished) == list(range(12))


def test_any_iterable_is_work_and_no_work_is_no_result(monkeypatch):
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "threading")
    assert parallel_map(abs, (item for item in (-1, 2)), "generator") == [1, 2]
    assert parallel_map(abs, [], "nothing") == []
