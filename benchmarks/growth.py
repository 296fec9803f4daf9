"""How cost grows: time and memory over demonstrations, kernels, rollouts, samples and electrodes.

    python benchmarks/growth.py [--only WORD] [--seconds S] [--output FOLDER]

Every size runs in a process of its own, whose peak of resident memory beyond what the libraries take is that
of inputs, work and results. The stages of tasks are run as a lab runs them, on bags of a made-up lab, and
what a few demonstrations take is subtracted as their start. Times are those of one processor. The exponent
is the slope of the logarithm of time, or memory, over that of the size, by least squares over all sizes: 1
where twice as much costs twice as much.
"""

import argparse
import ctypes
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import arm_motions
import dynamics
import numpy as np
import pandas as pd
import policy_search
import torch
import yaml
from made_up_lab import FINGERS, JOINTS, entry, write_lab
from matplotlib.figure import Figure
from primitive_inputs import AXES, DT, SAMPLES, SEED, demonstrations
from timing import machine

from dissertation.simulation.pick_and_place import URDF
from structlearn.core.artefacts import publish, write_csv
from structlearn.core.parallel import BACKEND
from structlearn.palette import CATEGORICAL_COLOURS
from structlearn.policy_search.pi2 import SearchDistribution, sample, update
from structlearn.primitives.fitting import primitive_errors
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.vector import fit_vector
from structlearn.reporting.figure_style import canvas, save, styled
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.tactile.latent_models import StackedAutoencoders, latent_losses
from structlearn.tasks.movement.parameters import TaskFitParameters
from structlearn.tasks.project import packaged_pipeline, write_project

Run = Callable[[], Any]

SECONDS_PER_SIZE = 1.0
FEWEST_ROUNDS = 3
MEGABYTE = 2.0**20
SMALLEST_MB = 0.5  # less is what an allocator happens to hold


@dataclass(frozen=True)
class Growth:
    """Work of a size that can be chosen.

    Attributes:
        work: what is done.
        sizes: from today's size to where it may go.
        unit: of what there are so many.
        build: size -> the work.
    """

    work: str
    sizes: Sequence[int]
    unit: str
    build: Callable[[int], Run]


def fit_demonstrations(count: int) -> Run:
    """One primitive from so many demonstrations."""
    paths = demonstrations(count)
    return lambda: fit_vector(paths)


def fit_kernels(count: int) -> Run:
    """One primitive of so many kernels."""
    paths = demonstrations(11)
    return lambda: fit_vector(paths, kernel_count=count)


def unroll(count: int) -> Run:
    """A batch of movements of different weights, without feedback."""
    fitted = fit_vector(demonstrations(1))
    spread = np.random.default_rng(SEED).normal(1.0, 0.1, (count, KERNEL_COUNT, AXES))
    batch = replace(fitted, weights=spread * fitted.weights)
    return lambda: batch.unroll(DT)


def search_update(count: int) -> Run:
    """A PI2-CMA update from rollouts with a cost at every step."""
    distribution = SearchDistribution.around(np.zeros(policy_search.DIMENSIONS), 1.0)
    rng = np.random.default_rng(SEED)
    policies, costs = sample(distribution, count, rng), rng.uniform(size=(count, SAMPLES))
    return lambda: update(distribution, policies, costs, policy_search.PARAMETERS)


def regressor(count: int) -> Run:
    """The regressor of a set, worked out once before a training."""
    robot, motion = arm_motions.iiwa(count)
    return lambda: torque_regressor(robot.tree, *motion)


def training_step(count: int) -> Run:
    """Torques by the regressor and their gradient."""
    robot, _ = arm_motions.iiwa(1)
    joints = len(robot.tree.names)
    generator = torch.Generator().manual_seed(SEED)
    columns = torch.randn(10 * joints, count * joints, generator=generator, dtype=torch.float64)
    torques = torch.randn(count * joints, generator=generator, dtype=torch.float64)
    return dynamics.step_by_regressor(joints, columns, torques)


def latent_step(electrodes: int) -> Run:
    """Losses and gradient of a batch of pairs for five autoencoders of touch."""
    models, hidden, pairs = 5, (15, 6), 64
    generator = torch.Generator().manual_seed(SEED)
    networks = StackedAutoencoders.initial(models, electrodes, hidden, generator)
    signals = torch.randn(models, electrodes, 2 * pairs, generator=generator)
    pressure = torch.rand(models, 2 * pairs, generator=generator)
    geodesic = torch.rand(models, pairs, generator=generator)
    variables = networks.parameters()

    def run() -> tuple[torch.Tensor, ...]:
        losses = latent_losses(networks, signals, pressure, geodesic)
        total = (losses.reconstruction + losses.distances + losses.pressure).sum()
        return torch.autograd.grad(total, variables, allow_unused=True)

    return run


def leave_one_out(count: int) -> Run:
    """Errors of primitives learned from all demonstrations and from all but one, of different lengths."""
    paths = demonstrations(count, [SAMPLES + 3 * place for place in range(count)])
    segments = [(path, None) for path in paths]
    parameters = TaskFitParameters(
        smoothing_hz=5.0,
        kernel_count=KERNEL_COUNT,
        regression="joint",
        scaled_axes=(True, False, False),
        frame="auto",
    )
    names = [str(place) for place in range(count)]
    return lambda: primitive_errors("reach", segments, names, parameters, fold=1)


DEMONSTRATIONS = (10, 20, 40, 80, 160)
STARTED = 3
LAB_S, LAB_HZ, LAB_MOVES = 6.0, 100.0, 2
FEEDBACK = {
    "settings": ["a", "b"],
    "primitives": ["reach"],
    "axes": ["z"],
    "sensors": ["wrench"],
    "training": {"steps": 200, "evaluate_every": 100},
}
STAGES = (
    ("movement", "import_task", "import"),
    ("movement", "segment", "cut"),
    ("movement", "primitives", "fit and leave-one-out, stage"),
    ("movement", "feedback", "feedback"),
    ("movement", "skill", "skill"),
    ("movement", "check", ""),
    ("movement", "view", "recording"),
    ("movement", "report", "page"),
    ("motion", "import_task", "import of joint logs"),
    ("motion", "learn", "identification"),
    ("motion", "report", "page of an arm"),
)
"""Kind of task, stage, and what it does, in their order; without a name it is not measured."""


def grown_stages() -> list[dict[str, Any]]:
    """Time and memory of a task's stages at all numbers of demonstrations.

    Executions and corrections, in two settings, are the demonstrations again. The first `STARTED` count as
    the start of a stage, whose memory includes its libraries: sizes and costs are those of the others.
    """
    points, start = [], dict[str, tuple[float, float]]()
    with tempfile.TemporaryDirectory() as made:
        bags = Path(made) / "bags"
        write_lab(bags, STARTED + max(DEMONSTRATIONS), LAB_S, LAB_HZ, LAB_MOVES)
        for place, count in enumerate((0, 0, *DEMONSTRATIONS)):
            project = Path(made) / f"{place}"
            _make_project(project, sorted(bags.iterdir())[: STARTED + count])
            for kind, stage, work in STAGES:
                spent = _spent(stage, kind, project)
                if place == 0:  # has compiled what is compiled
                    continue
                cpu_ms, memory_mb = np.subtract(spent, start.setdefault(f"{stage} {kind}", spent)).tolist()
                if work and count:
                    costs = {"cpu_ms": max(cpu_ms, 1.0), "memory_mb": max(memory_mb, SMALLEST_MB)}
                    points.append({"work": work, "unit": "demonstrations", "size": count, **costs})
    return points


def _make_project(project: Path, bags: Sequence[Path]) -> None:
    """A project with a task of each kind, named by it, on links to the bags."""
    for number, bag in enumerate(bags):
        for folder in ("runs", f"corrections/{'ab'[number % 2]}"):
            link = project / folder / bag.name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(bag)
    feedback = {"executions": "runs", "corrections": "corrections", **FEEDBACK}
    tasks = {
        "movement": {"movement": entry(Path("runs"), LAB_MOVES, feedback=feedback)},
        "motion": {
            "motion": {
                "source": "runs",
                "urdf": URDF,
                "topic": JOINTS,
                "iterations": 50,
                "locked_joints": FINGERS,
            }
        },
    }
    write_project(project, yaml.safe_dump(tasks), packaged_pipeline())


RUN = """
import os, runpy, sys
module = sys.argv.pop(1)
for _ in range(2):
    begin = sum(os.times()[:4])
    runpy.run_module(module, run_name="__main__", alter_sys=True)
spent = 1e3 * (sum(os.times()[:4]) - begin)
print(spent, int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]) / 1024)
"""
"""Runs a module twice and prints last what the second run, with all libraries loaded, has spent in ms, and
the peak of resident memory in MB. The peak that a parent is told of is at least its own, since a child begins
with its memory."""


def _spent(stage: str, task: str, folder: Path) -> tuple[float, ...]:
    """Time of processors in ms and peak resident memory in MB of a stage."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, f"structlearn.tasks.stages.{stage}", task],
        cwd=folder,
        env=os.environ | {BACKEND: "sequential"},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{stage} {task}: ended with code {done.returncode}")
    return tuple(float(word) for word in done.stdout.splitlines()[-1].split())


ROLLOUTS, MOTIONS = (38, 120, 380, 1200, 3800), (6_000, 19_000, 60_000, 190_000, 600_000)

CASES = (
    Growth(f"fit, {KERNEL_COUNT} kernels", (10, 32, 100, 320, 1000), "demonstrations", fit_demonstrations),
    Growth("leave-one-out", DEMONSTRATIONS, "demonstrations", leave_one_out),
    Growth("fit, 11 demonstrations", (25, 50, 100, 200, 400), "kernels", fit_kernels),
    Growth("unroll", ROLLOUTS, "rollouts", unroll),
    Growth("PI2-CMA update", ROLLOUTS, "rollouts", search_update),
    Growth("regressor of the iiwa", MOTIONS, "samples", regressor),
    Growth("dynamics, forward + gradient", MOTIONS, "samples", training_step),
    Growth("latent space, step of training", (19, 34, 60, 107, 190), "electrodes", latent_step),
)


def main() -> None:
    """Measure all cases, print exponents, write points, exponents and figure where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="measure only work whose name contains this")
    parser.add_argument("--seconds", type=float, default=SECONDS_PER_SIZE, help="time to spend on each size")
    parser.add_argument("--output", type=Path, help="folder for growth.csv, exponents.csv and growth.svg")
    options = parser.parse_args()
    cases = [case for case in CASES if options.only in case.work]
    points = pd.DataFrame([point for case in cases for point in measured(case, options.seconds)])
    if any(options.only in work for *_, work in STAGES if work):
        stages = pd.DataFrame(grown_stages())
        points = pd.concat([points, stages[stages["work"].str.contains(options.only, regex=False)]])
    if points.empty:
        parser.error(f"no work is called {options.only!r}")
    table = exponents(points)
    print(machine())
    print("One thread; shortest of several runs; exponents over all sizes.")
    print(table.to_string(index=False, float_format="{:.3g}".format))
    if options.output:
        write_csv(points, options.output / "growth.csv")
        write_csv(table, options.output / "exponents.csv")
        with publish(options.output / "growth.svg") as path:
            save(growth_figure(points, table), path.with_suffix(""))


def measured(case: Growth, seconds: float) -> list[dict[str, Any]]:
    """Time and memory of a case at all its sizes."""
    case.build(case.sizes[0])()  # compiles what is compiled, before any process is forked
    context, points = multiprocessing.get_context("fork"), []
    for size in case.sizes:
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=_measure, args=(case, size, seconds, sender))
        process.start()
        sender.close()  # so that a process that dies ends the wait for it
        try:
            cpu_ms, memory_mb = receiver.recv()
        except EOFError:
            raise SystemExit(
                f"{case.work}, {size} {case.unit}: the process died, for want of memory?"
            ) from None
        process.join()
        points.append(
            {"work": case.work, "unit": case.unit, "size": size, "cpu_ms": cpu_ms, "memory_mb": memory_mb}
        )
    return points


def _measure(case: Growth, size: int, seconds: float, sender: Any) -> None:
    case.build(case.sizes[0])()  # brings in what the libraries need themselves
    ctypes.CDLL(None).malloc_trim(0)  # and gives the rest back
    Path("/proc/self/clear_refs").write_text("5")  # the peak so far no longer counts
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    run, times = case.build(size), []
    begin = perf_counter()
    while len(times) < FEWEST_ROUNDS or perf_counter() - begin < seconds:
        start = process_time()
        run()
        times.append(process_time() - start)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send((1e3 * min(times), max(1024 * peak / MEGABYTE, SMALLEST_MB)))


def exponents(points: pd.DataFrame) -> pd.DataFrame:
    """Per work what it costs at its smallest and largest size, and how time and memory grow."""
    rows = []
    for (work, unit), group in points.groupby(["work", "unit"], sort=False):
        first, last = group.iloc[0], group.iloc[-1]
        logs = np.log(group[["size", "cpu_ms", "memory_mb"]].to_numpy(float))
        slopes = np.polyfit(logs[:, 0], logs[:, 1:], 1)[0]
        rows.append(
            {
                "work": work,
                "sizes": f"{first['size']} to {last['size']} {unit}",
                "first_ms": first.cpu_ms,
                "last_ms": last.cpu_ms,
                "cpu_exponent": slopes[0],
                "first_mb": first.memory_mb,
                "last_mb": last.memory_mb,
                "memory_exponent": slopes[1],
            }
        )
    return pd.DataFrame(rows)


@styled
def growth_figure(points: pd.DataFrame, table: pd.DataFrame) -> Figure:
    """Time and peak memory over the size relative to today's."""
    figure = canvas(6.2)
    quantities = (("cpu", "ms"), ("memory", "MB"))
    for axes, (quantity, unit) in zip(figure.subplots(1, 2), quantities, strict=True):
        looks = product(("o-", "s--", "^:"), CATEGORICAL_COLOURS)
        for row, (line, colour) in zip(table.itertuples(), looks, strict=False):
            group = points[points.work == row.work]
            label = f"{row.work}, {row.sizes}: {getattr(row, f'{quantity}_exponent'):.2f}"
            size = group["size"] / group["size"].iloc[0]
            axes.plot(
                size, group[f"{quantity}_{unit.lower()}"], line, color=colour, label=label, markersize=3
            )
        axes.set(xscale="log", yscale="log", xlabel="size / first size", ylabel=unit)
        axes.set_title(f"{quantity.capitalize()} and its exponent")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return figure


if __name__ == "__main__":
    main()
