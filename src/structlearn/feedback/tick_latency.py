"""How long ticks of the controller take on this machine, and what the long ones waited for."""

import resource
from time import perf_counter
from typing import NamedTuple

import numpy as np

from structlearn.feedback.runtime import Controller


class TickLatency(NamedTuple):
    """What (T,) ticks took, each with what befell the thread from the end of the tick before to its end.

    Attributes:
        seconds: duration in s.
        switches: how often the system gave the core to other work.
        faults: how often a page of memory was not there.
    """

    seconds: np.ndarray
    switches: np.ndarray
    faults: np.ndarray


def tick_latency(controller: Controller, ticks: int) -> TickLatency:
    """Durations of ticks on this machine, with a new sensor sample each.

    Runs follow one another from the demonstrations' mean start; starting them is not timed.

    Args:
        controller: any; its run is lost.
        ticks: number of ticks.
    """
    first = controller.skill.primitives[0]
    orientation = None if first.orientation is None else first.orientation.start
    samples = list(np.random.default_rng(0).normal(0.0, 10.0, (1000, controller.skill.channels)))
    seconds, counters = np.zeros(ticks), np.zeros((2, ticks), dtype=np.int64)
    for k in range(ticks):
        if k == 0 or controller.finished:
            controller.start(first.position.start, orientation)
            before = _counters()
        sample = samples[k % len(samples)]
        begin = perf_counter()
        controller.tick(sample)
        seconds[k] = perf_counter() - begin
        after = _counters()
        counters[:, k] = after[0] - before[0], after[1] - before[1]
        before = after
    return TickLatency(seconds, *counters)


def _counters() -> tuple[int, int]:
    """Context switches and page faults of this thread since its start."""
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return used.ru_nivcsw + used.ru_nvcsw, used.ru_minflt + used.ru_majflt
