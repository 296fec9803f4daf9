"""Latency of the runtime controller: a tick with feedback at 1 kHz, the network of the text in the loop.

    python benchmarks/controller.py [--paced N] [--ticks N] [--cpu N] [--priority N] [--ordinary]

Every tick gets a new sensor sample of 38 channels, ten times as often as the sensor would send one. Ticks are
timed as a robot has them, each in its own millisecond, before which the process sleeps: then the core has
slowed down and others have used its caches. Then they follow one another without a pause, which tells what a
tick computes, and in a million of them what a rare long tick waited for.

The process is set up as that of a robot would be: no garbage collection, all memory locked, and where asked
for bound to one core and scheduled before all other work; `--ordinary` leaves all that as it comes. Ticks
that take long all the same are told apart by what befell them: garbage collected, a page of memory that was
not there, the core given to other work, or taken without that by interrupts and by the host of a virtual
machine. What is left the thread ran itself, as after its caches were emptied. Without a pause and with a
priority, the system takes the core away for 50 ms of every second (`sched_rt_runtime_us`), which a controller
that waits for its next tick never meets.

At last the same skill as a C++ header (`structlearn export SKILL --cpp`), if there is g++: ticks without a
pause, compiled for this machine.
"""

import argparse
import ctypes
import gc
import os
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from time import perf_counter, thread_time
from typing import NamedTuple

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import numpy as np
import pandas as pd
from primitive_inputs import AXES, DT, NETWORK, SEED, demonstrations, orientation_demonstration
from timing import Case, Contender, at_least_one, machine, sleep_to_next

from structlearn.feedback.cpp_export import header
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork, coupling_term
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, Workspace, on_axis
from structlearn.primitives.orientation import fit_quaternion, fit_rhythmic_quaternion
from structlearn.primitives.outputs import Switching
from structlearn.primitives.position import fit_position, fit_rhythmic_position
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import fit_expected_traces

RATE_HZ, PACED, TICKS = 1000.0, 20_000, 1_000_000
WARM_UP = 10_000  # what is used first is slow
LONG_S, SETTLED = 5.0, 200  # duration of the movements of the table's row; ticks
SAME = 1e-9
LONG_US = 100.0  # a tenth of the time between ticks
SHOWN = 10
NOW_AND_LATER = 1 | 2  # MCL_CURRENT | MCL_FUTURE of mlockall


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paced", type=at_least_one, default=PACED, help="ticks at the controller's rate")
    parser.add_argument("--ticks", type=at_least_one, default=TICKS, help="ticks without a pause")
    parser.add_argument("--cpu", type=int, help="core to stay on; best one that boots isolated (isolcpus)")
    parser.add_argument(
        "--priority", type=int, help="real-time priority (SCHED_FIFO), 1 to 99; needs the right to"
    )
    parser.add_argument("--ordinary", action="store_true", help="with garbage collection, memory not locked")
    options = parser.parse_args()
    if options.cpu not in (None, *os.sched_getaffinity(0)):
        parser.error(f"--cpu {options.cpu}: this process may not run there")
    controller = Controller(skill(), RATE_HZ)
    setting = "an ordinary process" if options.ordinary else real_time(options.cpu, options.priority)
    tick_latency(controller, WARM_UP)
    print(machine())
    for pace, ticks, period_s in (
        (f"one in each {1e3 / RATE_HZ:g} ms", options.paced, 1.0 / RATE_HZ),
        ("without a pause", options.ticks, 0.0),
    ):
        stolen = stolen_s()
        latency = tick_latency(controller, ticks, period_s)
        print(f"{ticks} ticks, {pace}: {summary(latency)}")
        print(largest(latency).to_string(index=False))
        print(f"{setting}; time that the machine's host took meanwhile: {stolen_s() - stolen:.2f} s")
    if shutil.which("g++"):
        print(f"{options.ticks} ticks in C++, without a pause: {cpp_summary(options.ticks)}")


def real_time(cpu: int | None, priority: int | None) -> str:
    """Keep what makes a tick wait away from this process, as far as permitted; say what that is."""
    gc.collect()
    gc.disable()
    locked = ctypes.CDLL(None).mlockall(NOW_AND_LATER) == 0
    done = ["no garbage collection", "memory locked" if locked else "memory not locked (see `ulimit -l`)"]
    if cpu is not None:
        os.sched_setaffinity(0, {cpu})
        done.append(f"on core {cpu}")
    if priority is not None:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        done.append(f"real-time priority {priority}")
    return ", ".join(done)


def stolen_s() -> float:
    """Time in s since boot in which the host gave the cores of this virtual machine to others."""
    steal = Path("/proc/stat").read_text().split("\n", 1)[0].split()[8]
    return int(steal) / os.sysconf("SC_CLK_TCK")


class TickLatency(NamedTuple):
    """What (T,) ticks took, each with what befell the thread from the end of the tick before to its end."""

    seconds: np.ndarray  # duration in s
    # of the duration, what the thread ran; the rest it waited, or an interrupt or the host of a virtual
    # machine had the core
    processor_s: np.ndarray
    switches: np.ndarray  # how often the system gave the core to other work
    faults: np.ndarray  # how often a page of memory was not there
    collections: np.ndarray  # how often garbage was collected


def tick_latency(controller: Controller, ticks: int, period_s: float = 0.0) -> TickLatency:
    """Durations of ticks on this machine, with a new sensor sample each.

    Runs follow one another from the demonstrations' mean start; starting them is not timed.

    `controller`: any; its run is lost. `ticks`: number of ticks. `period_s`: of a tick, of which the process
    sleeps the rest; 0: ticks follow one another.
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
            if period_s:
                sleep_to_next(period_s)
                before = (*_counters(), len(collected))
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


def summary(latency: TickLatency) -> str:
    """Lines about the durations of ticks."""
    microseconds = 1e6 * latency.seconds
    shares = (50.0, 99.0, 99.99, 100.0)
    median, percentile, most, maximum = np.percentile(microseconds, shares)
    long = np.flatnonzero(microseconds > LONG_US)
    found = causes(latency)
    told = [
        f"{(found[long] == cause).sum()} {cause} (to {microseconds[found == cause].max(initial=0.0):.0f} us)"
        for cause in CAUSES
    ]
    return (
        f"median {median:.1f} us, 99 % within {percentile:.1f} us, 99.99 % within {most:.1f} us, "
        f"maximum {maximum:.0f} us\n"
        f"{len(long)} ticks above {LONG_US:.0f} us: {', '.join(told)}"
    )


def cpp_summary(ticks: int) -> str:
    """Durations of ticks of the header, from `controller_ticks.cpp`."""
    measured = replace(skill(), workspace=Workspace(np.full(3, -10.0), np.full(3, 10.0)))
    source = Path(__file__).with_name("controller_ticks.cpp")
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "ticks")
        text = header(measured, "skill_measured", "of the benchmark")
        Path(folder, "skill_measured.hpp").write_text(text, encoding="ascii")
        compiler = ("g++", "-std=c++17", "-O3", "-march=native")
        subprocess.run([*compiler, "-I", folder, source, "-o", program], check=True)
        return subprocess.check_output([program, str(ticks)], text=True).strip()


CAUSES = ("collecting garbage", "given to other work", "fetching memory", "interrupted", "running")
"""Of a tick's length, the first that applies."""


def causes(latency: TickLatency) -> np.ndarray:
    """(T,) for each tick the one of `CAUSES` that made it as long as it is."""
    waited = latency.seconds - latency.processor_s > 0.5 * latency.seconds
    befell = [latency.collections > 0, latency.switches > 0, latency.faults > 0, waited]
    return np.select(befell, CAUSES[:-1], CAUSES[-1])


def largest(latency: TickLatency) -> pd.DataFrame:
    """What the longest ticks are made of."""
    longest = np.argsort(latency.seconds, kind="stable")[::-1][:SHOWN]
    columns = {
        "us": np.round(1e6 * latency.seconds, 1),
        "us that it ran": np.round(1e6 * latency.processor_s, 1),
        "other work": latency.switches,
        "page faults": latency.faults,
        "collections": latency.collections,
        "cause": causes(latency),
    }
    return pd.DataFrame({name: values[longest] for name, values in columns.items()})


def tick(rhythm: Rhythm | None = None) -> Case:
    """A row of the table; coupling terms are held against the network as in the text."""
    controller, samples = started(rhythm), np.random.default_rng(0).normal(0.0, 10.0, (1000, NETWORK[0]))
    due = cycle(list(samples))
    return Case(
        work=f"controller's tick{' of strokes' if rhythm else ''}, one in each {1e3 / RATE_HZ:g} ms",
        ours=Contender(lambda: controller.tick(next(due)), lambda _: coupling_error(started(rhythm))),
        tolerance=SAME,
        note=f"as a robot has it, after sleeping, with a {'-'.join(map(str, NETWORK))} network; `again`: a "
        "second one at once; percentiles below the table",
        period_s=1.0 / RATE_HZ,
    )


def tick_joints() -> Case:
    """A tick of a skill that commands seven joints, a continuous and a digital output, without feedback."""
    path = demonstrations(1)[0]
    mixed = path.turned(np.random.default_rng(SEED).normal(size=(AXES, 7)))
    joints, opening = (fit_position([one], frame="none") for one in (mixed, path.turned(np.eye(AXES, 1))))
    edges = Switching(np.array([False]), np.array([[0.0, 0.5]]))
    names = tuple(f"joint {place}" for place in range(7))
    one = PosePrimitive("move", joints, outputs=opening, switching=edges)
    skill = ReactiveSkill([one], joints=names, outputs=("opening",), digital=("grasp",))

    def begun() -> Controller:
        controller = Controller(skill, RATE_HZ, durations=[LONG_S])
        controller.start(joints.start)
        return controller

    def error() -> float:
        controller, wanted = (
            begun(),
            joints.unroll(1.0 / RATE_HZ, duration=LONG_S, velocity=0.0, acceleration=0.0),
        )
        found = [(controller.tick(None), controller.position.copy())[1] for _ in wanted.time]
        return float(np.abs(np.array(found) - wanted.position).max())

    controller = begun()
    return Case(
        work="  of 7 joints and 2 outputs, without feedback",
        ours=Contender(lambda: controller.tick(None), lambda _: error()),
        tolerance=SAME,
        period_s=1.0 / RATE_HZ,
    )


def started(rhythm: Rhythm | None) -> Controller:
    """A controller of long movements, at their start."""
    controller = Controller(skill(rhythm), RATE_HZ, durations=[LONG_S] * 3)
    first = controller.skill.primitives[0]
    assert first.orientation is not None
    controller.start(first.position.start, first.orientation.start)
    return controller


def coupling_error(controller: Controller) -> float:
    """Largest deviation of coupling terms from the network's equations, relative to their bound."""
    network, bound = controller.skill.networks["first"]["ry"], controller.skill.limits.of(("ry",), 1.0)[0, 0]
    worst, movement = 0.0, controller.skill.primitives[0].position.local
    for k in range(1000):
        controller.tick(10.0 * np.sin(1e-3 * k + np.arange(NETWORK[0])))
        if k >= SETTLED:  # the offset is known, and the bound of the change is left behind
            p, u = movement.phase(np.array(controller.time / movement.time_constant(LONG_S)))
            wanted = coupling_term(network, controller.deviation, p, u)
            worst = max(worst, abs(np.clip(wanted, -bound, bound) - controller.coupling[0]))
    return worst / bound


def skill(rhythm: Rhythm | None = None) -> ReactiveSkill:
    """Three primitives with networks of the text's size; what they do does not matter here."""
    rng = np.random.default_rng(SEED)
    names = ("first", "second", "third")
    paths, turns, rhythms = demonstrations(1), [orientation_demonstration(1.0)], [rhythm] if rhythm else []
    point = fit_rhythmic_position(paths, rhythms) if rhythm else fit_position(paths)
    turn = fit_rhythmic_quaternion(turns, rhythms) if rhythm else fit_quaternion(turns)
    return ReactiveSkill(
        primitives=[PosePrimitive(name, point, turn) for name in names],
        expected={name: fit_expected_traces([_trace(rng)], DT, 25.0, rhythms) for name in names},
        networks=on_axis({name: _network(rng) for name in names}, "ry"),
    )


def _trace(rng: np.random.Generator) -> np.ndarray:
    """Smooth counts of all channels over a second, (1000, E)."""
    return 30.0 * np.sin(np.linspace(0.0, 3.0, 1000)[:, None] * rng.uniform(0.5, 2.0, NETWORK[0]))


def _network(rng: np.random.Generator) -> PhaseModulatedNetwork:
    inputs, hidden, kernel_count, _ = NETWORK
    return PhaseModulatedNetwork(
        input_mean=np.zeros(inputs),
        input_scale=np.full(inputs, 10.0),
        hidden=((rng.normal(0.0, inputs**-0.5, (hidden, inputs)), np.zeros(hidden)),),
        phase_weights=rng.normal(0.0, hidden**-0.5, (kernel_count, hidden)),
        phase_biases=np.zeros(kernel_count),
        output_weights=rng.normal(size=kernel_count),
    )


CASES: tuple[Callable[[], Case], ...] = (tick, lambda: tick(Rhythm(0.0, 2.0)), tick_joints)


if __name__ == "__main__":
    main()
