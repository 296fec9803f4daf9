"""What a skill may ask of a robot: its nominal run, and runs at the bounds of all that may vary.

Starts and goals may lie anywhere in the skill's workspace, so each corner of it is tried, one goal at a time;
corrections may be as large as their bounds, so each axis is held there in both directions from the first tick
to the last. All runs come out of the controller that goes to the robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.sequence import PoseGoal, default_goals, default_start
from structlearn.primitives.vector import sample_count
from structlearn.testbeds.own.protocol.check_results import CORRECTIONS, GOALS, NOMINAL, STARTS

BEYOND_ALL_BOUNDS = 1e9
"""Weights of a network whose coupling term is at its bound from the second tick on, or on its way there."""


@dataclass(frozen=True)
class Unroll:
    """One run of T ticks.

    Attributes:
        kind: of `check_results.KINDS`.
        name: what differs from the nominal run, in words.
        position: (T, 3) m, frame of the demonstrations.
        orientation: (T, 4) unit quaternions, or None.
    """

    kind: str
    name: str
    position: np.ndarray
    orientation: np.ndarray | None


def unrolls(skill: ReactiveSkill, rate_hz: float) -> Iterator[Unroll]:
    """The nominal run, 8 starts, 8 goals per primitive, and two runs per axis with feedback.

    Args:
        skill: without a workspace there are no corners; without networks no corrections.
        rate_hz: of the ticks.
    """
    silent = replace(skill, networks={})
    start, goals = default_start(skill.primitives), default_goals(skill.primitives)
    yield _run(silent, rate_hz, NOMINAL, "as demonstrated", start, goals)
    for name, corner in _corners(skill):
        shifted = PoseGoal(corner, start.orientation)
        yield _run(silent, rate_hz, STARTS, f"start {name}", shifted, goals)
    for place, (primitive, goal) in enumerate(zip(skill.primitives, goals, strict=True)):
        for name, corner in _corners(skill):
            changed = [*goals[:place], PoseGoal(corner, goal.orientation), *goals[place + 1 :]]
            yield _run(silent, rate_hz, GOALS, f"end of {primitive.name} {name}", start, changed)
    for axis, sign in product(skill.axes, (1.0, -1.0)):
        pushing = open_loop(np.full(KERNEL_COUNT, sign * BEYOND_ALL_BOUNDS))
        networks = {name: {axis: pushing} for name, its in skill.networks.items() if axis in its}
        pushed = replace(skill, networks=networks)
        # the phase velocity, with which networks are modulated, is negative
        yield _run(pushed, rate_hz, CORRECTIONS, f"{axis} {'-' if sign > 0 else '+'}", start, goals)


def _corners(skill: ReactiveSkill) -> Iterator[tuple[str, np.ndarray]]:
    """Corners (3,) of the workspace with their names, e.g. `at x+ y- z+`."""
    if skill.workspace is None:
        return
    ends = np.array([skill.workspace.low, skill.workspace.high])
    for upper in product((0, 1), repeat=3):
        name = " ".join(f"{axis}{'-+'[end]}" for axis, end in zip("xyz", upper, strict=True))
        yield f"at {name}", ends[list(upper), [0, 1, 2]]


def _run(
    skill: ReactiveSkill, rate_hz: float, kind: str, name: str, start: PoseGoal, goals: list[PoseGoal]
) -> Unroll:
    """What the controller gives, tick for tick."""
    controller = Controller(skill, rate_hz, goals=goals)
    controller.start(start.position, start.orientation)
    ticks = 1 + sum(sample_count(one.duration, 1.0 / rate_hz) - 1 for one in skill.primitives)
    position, orientation = np.empty((ticks, 3)), np.empty((ticks, 4))
    for tick in range(ticks):
        controller.tick(None)
        position[tick], orientation[tick] = controller.position, controller.orientation
    turned = skill.primitives[0].orientation is not None
    return Unroll(kind, name, position, orientation if turned else None)
