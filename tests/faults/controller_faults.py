"""The controller under faults of its sensor and of its caller: `make upsets N=1000000`.

A run goes from stretch to stretch of readings that are good, late, repeated, not finite, huge, or of
another size; now and then a goal moves or is refused, a via point is added, or the caller starts again.
Whatever comes, all outputs are finite, coupling terms keep their bounds in size and in rate, and the goals
are reached.
After each tick the caller tries to write into an output.

Writes `reports/reliability/upsets.csv`; names each run that breaks the rule.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from faults.reliability import keep
from feedback_skills import POINTS, random_network, random_skill
from primitives_movements import random_vectors, reach

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling import AXES, turns
from structlearn.feedback.runtime import Controller, Status
from structlearn.feedback.skill import Limits, ReactiveSkill, Workspace
from structlearn.primitives import sequence
from structlearn.primitives.outputs import Switching
from structlearn.primitives.position import fit_position

READINGS = ("good", "none", "none, then all at once", "the same again", "NaN", "NaN in one channel")
READINGS += ("infinite", "up to 1e308", "a million times too large", "of another size")
NOT_FINITE = ("NaN", "NaN in one channel", "infinite")

CALLS = ("a goal moves", "a via point is added", "a goal is refused", "a new start")

LONGEST_STRETCH = 150  # ticks of one kind of reading
BETWEEN_CALLS = 400  # ticks between other calls than `tick`, in the mean
SETTLING = 7.0  # durations of the last primitive that a run has after its end, without further calls
REACHED = 1e-5  # m and rad that may be left of the way to a goal
RUNS = 10  # that a process does at a time

STATE = ("position", "velocity", "acceleration", "orientation", "angular_velocity", "angular_acceleration")


@dataclass(frozen=True)
class Run:
    """Results of a run, a row per tick."""

    state: np.ndarray  # (T, 19) all of `STATE`
    coupling: np.ndarray  # (T, D)
    primitive: np.ndarray  # (T,) that runs; another number after each start
    flags: np.ndarray  # (T,) of `Status`
    reading: np.ndarray  # (T,) place in `READINGS`
    calls: Counter  # how often each of `CALLS` came
    moved: bool  # whether a call that was refused has changed something, or an output was written into
    missed: tuple[float, float]  # m and rad that are left of the way to the last goal
    largest: np.ndarray  # (D,) bounds of the coupling terms
    largest_change: np.ndarray  # (D,) likewise, of their changes in a tick within a primitive


def main() -> None:
    """Tick, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=1_000_000, help="in all, at least")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first run")
    given = parser.parse_args()
    counts, broken, first = Counter(), [], given.first
    while sum(counts[reading, "ticks"] for reading in READINGS) < given.ticks:
        seeds = [range(begin, begin + RUNS) for begin in range(first, first + 8 * RUNS, RUNS)]
        for found, lines in parallel_map(several, seeds, "ticks", local=True):
            counts += found
            broken += lines
        first += 8 * RUNS
    rows = [
        {"reading": reading, **{name: counts[reading, name] for name in ("ticks", *Status.__members__)}}
        for reading in READINGS
    ]
    table = pd.DataFrame(rows).rename(columns=lambda name: name.lower().replace("_", " "))
    metrics = {"ticks": int(table["ticks"].sum()), "runs": first - given.first, "broken": len(broken)}
    metrics |= {call.replace(" ", "_"): counts[call] for call in CALLS}
    keep("upsets", table, f"make upsets N={given.ticks}", metrics)
    print(table.to_string(index=False), metrics, sep="\n")
    if broken:
        sys.exit("\n".join(["error: the rule is broken:", *broken]))


def several(seeds: Iterable[int]) -> tuple[Counter, list[str]]:
    """How many ticks there were by kind of reading and flag, and what is wrong with which run."""
    counts, broken = Counter(), []
    for seed in seeds:
        run = upset(seed)
        broken += [f"run {seed}: {fault}" for fault in faults(run)]
        counts += run.calls
        for place, reading in enumerate(READINGS):
            flags = run.flags[run.reading == place]
            counts[reading, "ticks"] += len(flags)
            for name, flag in Status.__members__.items():
                counts[reading, name] += int(((flags & flag) > 0).sum())
    return counts, broken


def faults(run: Run) -> Iterator[str]:
    """What breaks the rule."""
    if not (np.isfinite(run.state).all() and np.isfinite(run.coupling).all()):
        yield "an output is not finite"
        return
    norms = np.linalg.norm(run.state[:, 9:13], axis=1)
    if np.abs(norms - 1.0).max() > 1e-9:
        yield "an orientation is no unit quaternion"
    largest = np.abs(run.coupling).max(axis=0)
    if (largest > run.largest).any():
        yield f"coupling terms are {largest}, bounds {run.largest}"
    within = np.diff(run.primitive) == 0
    changes = np.abs(np.diff(run.coupling, axis=0))[within].max(axis=0)
    if (changes > run.largest_change * (1 + 1e-9)).any():
        yield f"coupling terms change by {changes} in a tick, bounds {run.largest_change}"
    stale = ((run.flags & Status.STALE) > 0)[1:] & within
    if (np.diff(np.abs(run.coupling), axis=0)[stale] > 0).any():
        yield "a coupling term grows while there are no readings"
    bad = np.isin(run.reading, [READINGS.index(reading) for reading in NOT_FINITE])
    if not (run.flags[bad] & Status.REJECTED).all():
        yield "a reading that is not finite is taken"
    if run.moved:
        yield "a call that was refused, or the caller, has changed something"
    if max(run.missed) > REACHED:
        yield f"the goal is missed by {run.missed[0]:.3g} m and {run.missed[1]:.3g} rad"


OPENING = fit_position([reach(np.random.default_rng(0), [0.0], [1.0])], frame="none")
MOST_OUTPUT = 3.0


def upset(seed: int) -> Run:
    """A run of a random skill at a random rate, with everything that may go wrong."""
    rng = np.random.default_rng(seed)
    skill = _skill(rng)
    rate = float(rng.choice([125.0, 250.0, 500.0, 1000.0]))
    controller = Controller(skill, rate)
    largest, largest_change = skill.limits.of(skill.axes, 1.0 / rate)
    readings = _readings(rng, skill.channels)
    rows, calls, moved, starts = [], Counter(), False, 0
    goal = _begin(controller, rng)
    left = None  # ticks of settling that are left
    while left != 0:
        reading, counts = next(readings)
        if left is None and rng.random() < 1.0 / BETWEEN_CALLS:
            call = CALLS[rng.integers(len(CALLS))]
            calls[call] += 1
            if call == "a goal moves":
                near = _near(sequence.default_goals(skill.primitives)[-1], rng)
                ask = partial(controller.move_goal, 2, near.position, near.orientation)
                refused, changed = _called(controller, ask)  # if a via point cannot be passed any more
                goal, moved = goal if refused else near, moved or changed
            elif call == "a via point is added":
                point, phase = controller.position + random_vectors(rng, 0.01), rng.uniform(0.0, 1.0)
                ask = partial(controller.add_via_point, controller.primitive, phase, point)
                moved |= _called(controller, ask)[1]  # may be refused
            elif call == "a goal is refused":
                bad = ([0.0, np.nan, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0])[rng.integers(3)]
                refused, changed = _called(controller, partial(controller.move_goal, 2, bad))
                moved |= changed or not refused
            else:
                goal, starts = _begin(controller, rng), starts + 1
        if reading == "of another size":
            refused, changed = _called(controller, partial(controller.tick, counts))
            moved |= changed or not refused
            counts = None
        flags = controller.tick(counts)
        state = np.concatenate([getattr(controller, name) for name in STATE])
        moved |= not (np.abs(controller.outputs) < MOST_OUTPUT).all()
        place = controller.primitive + len(skill.primitives) * starts
        moved |= _is_written(getattr(controller, (*STATE, "coupling", "deviation")[len(rows) % 8]))
        rows.append((state, controller.coupling.copy(), place, flags, READINGS.index(reading)))
        if left is not None:
            left -= 1
        elif controller.finished:
            left = round(SETTLING * skill.primitives[-1].duration * rate)
    turned = float(quaternion.angle_between(controller.orientation, goal.orientation))
    return Run(
        *(np.array(column) for column in zip(*rows, strict=True)),
        calls=calls,
        moved=moved,
        missed=(float(np.linalg.norm(controller.position - goal.position)), turned),
        largest=largest,
        largest_change=largest_change,
    )


def _skill(rng: np.random.Generator) -> ReactiveSkill:
    """Three primitives, two of them with feedback on some axes, in a box around them."""
    axes = rng.choice(AXES, size=int(rng.integers(1, len(AXES) + 1)), replace=False).tolist()
    limits = Limits(
        largest_coupling={
            axis: rng.uniform(5.0, 60.0) if turns(axis) else rng.uniform(0.5, 6.0) for axis in AXES
        },
        fade_s=rng.uniform(0.02, 0.3),
        stale_after_s=rng.uniform(0.01, 0.1),
        offset_within_s=rng.uniform(0.05, 0.2),
    )
    networks = {
        name: {axis: random_network(rng, size=60.0 if turns(axis) else 6.0) for axis in axes}
        for name in ("tilt", "scrape")
    }
    box = Workspace(POINTS.min(axis=0) - 0.2, POINTS.max(axis=0) + 0.2)
    skill = random_skill(rng, networks, limits=limits)
    edges = Switching(np.array([False]), np.array([[0.0, 0.5]]))
    parts = [replace(one, outputs=OPENING, switching=edges) for one in skill.primitives]
    return replace(skill, primitives=parts, workspace=box, outputs=("opening",), digital=("grasp",))


def _readings(rng: np.random.Generator, channels: int) -> Iterator[tuple[str, np.ndarray | None]]:
    """Kind of each reading and what the controller is handed, in stretches of one kind."""
    base = last = rng.uniform(250.0, 350.0, channels)
    kind, left = READINGS[0], 2 * LONGEST_STRETCH
    while True:
        if left == 0:
            kind, left = READINGS[rng.integers(len(READINGS))], int(rng.integers(1, LONGEST_STRETCH))
        left -= 1
        good = base + rng.normal(0.0, 30.0, channels)
        place, signs = rng.integers(channels), rng.choice([-1.0, 1.0], channels)
        if kind == "good":
            last = good
        counts = {
            "good": good,
            "none": None,
            "none, then all at once": None if left else last,
            "the same again": last,
            "NaN": np.full(channels, np.nan),
            "NaN in one channel": np.where(np.arange(channels) == place, np.nan, good),
            "infinite": signs * np.inf,
            "up to 1e308": signs * 10.0 ** rng.uniform(-308.0, 308.0, channels),
            "a million times too large": 1e6 * good,
            "of another size": np.zeros(rng.choice([0, 1, channels - 1, channels + 1])),
        }
        yield kind, counts[kind]


def _begin(controller: Controller, rng: np.random.Generator) -> sequence.PoseGoal:
    """Start near where the skill was shown; returns the last goal."""
    primitives = controller.skill.primitives
    start = _near(sequence.default_start(primitives), rng)
    controller.start(start.position, start.orientation)
    return sequence.default_goals(primitives)[-1]


def _near(pose: sequence.PoseGoal, rng: np.random.Generator) -> sequence.PoseGoal:
    turn = quaternion.from_rotation_vector(random_vectors(rng, 0.2))
    return sequence.PoseGoal(
        pose.position + random_vectors(rng, 0.02), quaternion.product(turn, pose.orientation)
    )


def _is_written(output: np.ndarray) -> bool:
    """Whether an output can be written into."""
    try:
        output *= 2.0
    except ValueError:
        return False
    return True


def _called(controller: Controller, call: Callable[[], object]) -> tuple[bool, bool]:
    """Whether a call is refused, and whether it changes the outputs."""
    before = [np.copy(getattr(controller, name)) for name in (*STATE, "coupling")]
    refused = False
    try:
        call()
    except InputError:
        refused = True
    after = [getattr(controller, name) for name in (*STATE, "coupling")]
    return refused, not all(map(np.array_equal, before, after))


if __name__ == "__main__":
    main()
