"""How long ticks of the controller take on this machine, and what the long ones waited for."""

import gc
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, thread_time
from typing import NamedTuple

import numpy as np

from structlearn.feedback.runtime import Controller


class TickLatency(NamedTuple):
    """What (T,) ticks took, each with what befell the thread from the end of the tick before to its end."""

    seconds: np.ndarray  # duration in s
    # of the duration, what the thread ran; the rest it waited, or an interrupt or the host of a virtual
    # machine had the core
    processor_s: np.ndarray
    switches: np.ndarray  # how often the system gave the core to other work
    faults: np.ndarray  # how often a page of memory was not there
    collections: np.ndarray  # how often garbage was collected


def tick_latency(controller: Controller, ticks: int) -> TickLatency:
    """Durations of ticks on this machine, with a new sensor sample each.

    Runs follow one another from the demonstrations' mean start; starting them is not timed.

    `controller`: any; its run is lost. `ticks`: number of ticks.
    """
    first = controller.skill.primitives[0]
    orientation = None if first.orientation is None else first.orientation.start
    samples = list(np.random.default_rng(0).normal(0.0, 10.0, (1000, controller.skill.channels)))
    seconds, processor_s = np.zeros((2, ticks))
    counters = np.zeros((3, ticks), dtype=np.int64)
    with _counted_collections() as collected:
        for k in range(ticks):
            if k == 0 or controller.finished:
                controller.start(first.position.start, orientation)
                before = (*_counters(), len(collected))
            sample = samples[k % len(samples)]
            ran, begin = thread_time(), perf_counter()
            controller.tick(sample)
            seconds[k] = perf_counter() - begin
            processor_s[k] = thread_time() - ran
            after = (*_counters(), len(collected))
            counters[:, k] = after[0] - before[0], after[1] - before[1], after[2] - before[2]
            before = after
    return TickLatency(seconds, np.minimum(processor_s, seconds), *counters)


def _counters() -> tuple[int, int]:
    """Context switches and page faults of this thread since its start."""
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_nivcsw + used.ru_nvcsw, used.ru_minflt + used.ru_majflt


@contextmanager
def _counted_collections() -> Iterator[list[str]]:
    """A list that grows with every collection of garbage."""
    collected: list[str] = []

    def note(phase: str, _: dict) -> None:
        if phase == "start":
            collected.append(phase)

    gc.callbacks.append(note)
    try:
        yield collected
    finally:
        gc.callbacks.remove(note)
