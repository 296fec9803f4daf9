"""Whether a robot can do what a skill may ask of it, with the margin of each quantity in each run.

Every run is followed by inverse kinematics from near the same rest configuration.

| quantity | bound |
|---|---|
| position, orientation | the tip is where it should be: 1 mm, 0.5 degrees |
| joint range, velocity | of the URDF |
| acceleration, jerk | of the parameters |
| singularity | least singular value of the Jacobian, of the parameters |
| self-collision | least distance of links, of the parameters |
| joint jump | 0.1 rad (m) between two samples, which no arm follows |
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.sequence import PoseGoal, default_goals, default_start
from structlearn.primitives.vector import sample_count
from structlearn.rigid_body.inverse_kinematics import Arm, JointPath, follow, read_arm, rest_for
from structlearn.rigid_body.self_collision import LinkShapes, link_distances, read_shapes
from structlearn.simulation.arm import urdf_path
from structlearn.tasks.movement.check_results import (
    CORRECTIONS,
    GOALS,
    NOMINAL,
    NOT_TESTED,
    STARTS,
    THIN,
    SkillCheck,
    verdict,
)
from structlearn.tasks.movement.movement_parameters import Bound, RobotParameters
from structlearn.tasks.task_files import local_path

BEYOND_ALL_BOUNDS = 1e9
"""Weights of a network whose coupling term is at its bound from the second tick on, or on its way there."""


@dataclass(frozen=True)
class Unroll:
    """One run of T ticks."""

    kind: str  # of `check_results.KINDS`
    name: str  # what differs from the nominal run, in words
    position: np.ndarray  # (T, 3) m, frame of the demonstrations
    orientation: np.ndarray | None  # (T, 4) unit quaternions


def unrolls(skill: ReactiveSkill, rate_hz: float) -> Iterator[Unroll]:
    """The nominal run, 8 starts, 8 goals per primitive, and two runs per axis with feedback."""
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


RATE_HZ = 200.0
"""Samples per second of a run: 5 ms are short beside anything that a primitive of half a second does."""

COLLISION_EVERY = 4
"""Samples from one look at distances to the next: links come at most some centimetres nearer in 20 ms."""

REACH_M, REACH_RAD = 1e-3, np.radians(0.5)
"""Where the tip may be off: the search ends at a millionth of it or cannot reach the pose."""

JUMP = 0.1
"""rad or m from one sample to the next."""

COARSE, SEED = 20, 1
"""Samples from one look at the nominal run to the next, and seed, of the search for a rest configuration."""


def check_skill(skill: ReactiveSkill, parameters: RobotParameters) -> SkillCheck:
    """Follow all runs of a skill with a robot.

    Raises InputError: the URDF cannot be used, there are not as many bounds as joints, or no joint
    configuration reaches the start.
    """
    path = urdf_path(str(local_path(parameters.urdf)))
    arm = read_arm(path, parameters.tip, parameters.locked_joints)
    bounds = Bounds.of(arm, parameters)
    runs = [in_arm_frames(run, parameters) for run in unrolls(skill, RATE_HZ)]
    rest = _rest(arm, parameters, runs[0])
    try:
        shapes = read_shapes(arm, parameters.locked_joints, rest)
        notes = _unwatched(shapes)
    except InputError as error:
        shapes, notes = None, (f"self-collision was not tested: {error}",)
    if skill.workspace is None:
        notes += ("the skill has no workspace, so starts and goals elsewhere were not tried",)
    rows = []
    for run in runs:
        followed = follow(arm, run.position, run.orientation, 1.0 / RATE_HZ, rest)
        found = margins(arm, followed, bounds, shapes)
        rows += [{"kind": run.kind, "run": run.name, **row} for row in found]
    return SkillCheck(pd.DataFrame(rows), dict(zip(arm.tree.names, rest.tolist(), strict=True)), notes)


@dataclass(frozen=True)
class Bounds:
    """What an arm with n joints may be asked for."""

    velocity: np.ndarray  # (n,) rad/s or m/s
    acceleration: np.ndarray  # (n,) rad/s^2 or m/s^2
    jerk: np.ndarray  # (n,) rad/s^3 or m/s^3
    least_singular_value: float  # of the Jacobian
    least_distance_m: float  # between links

    @classmethod
    def of(cls, arm: Arm, parameters: RobotParameters) -> "Bounds":
        """Those of the URDF and of the parameters; InputError where there are not as many as joints."""
        return cls(
            arm.tree.velocity,
            _per_joint(arm, parameters.max_acceleration, "max_acceleration"),
            _per_joint(arm, parameters.max_jerk, "max_jerk"),
            parameters.least_singular_value,
            parameters.least_distance_m,
        )


def in_arm_frames(run: Unroll, parameters: RobotParameters) -> Unroll:
    """A run as poses of the tip in the robot's base frame.

    Raises InputError: the tool is offset from the tip, and the run has no orientations.
    """
    base, tool = parameters.base, parameters.tool
    back = quaternion.conjugate(base.turn)
    position = quaternion.rotate(back, run.position - np.array(base.position_m))
    if run.orientation is None:
        if any(tool.position_m):
            raise InputError("robot.tool: a skill without orientations needs a tool at the tip itself")
        return Unroll(run.kind, run.name, position, None)
    orientation = quaternion.product(
        quaternion.product(back, run.orientation), quaternion.conjugate(tool.turn)
    )
    offset = quaternion.rotate(orientation, np.array(tool.position_m))
    return Unroll(run.kind, run.name, position - offset, orientation)


def margins(
    arm: Arm, path: JointPath, bounds: Bounds, shapes: LinkShapes | None
) -> Iterator[dict[str, str | float]]:
    """The worst of each quantity along one run at `RATE_HZ`: rows of `SkillCheck.margins` but the run."""
    tree, dt = arm.tree, 1.0 / RATE_HZ
    units = ["m" if prismatic else "rad" for prismatic in tree.prismatic]
    velocity = signals.derivative(path.joints, dt)
    acceleration = signals.derivative(velocity, dt)
    jerk = signals.derivative(acceleration, dt)
    steps = np.diff(path.joints, axis=0, prepend=path.joints[:1])
    yield _at_most("position", path.missed_m[:, None], [REACH_M], ["tip"], ["m"])
    yield _at_most("orientation", path.missed_rad[:, None], [REACH_RAD], ["tip"], ["rad"])
    yield _in_range(tree.names, units, path.joints, tree.lower, tree.upper)
    for quantity, values, largest, per in (
        ("velocity", velocity, bounds.velocity, "/s"),
        ("acceleration", acceleration, bounds.acceleration, "/s²"),
        ("jerk", jerk, bounds.jerk, "/s³"),
        ("joint jump", steps, np.full(len(units), JUMP), ""),
    ):
        yield _at_most(quantity, np.abs(values), largest, tree.names, [f"{unit}{per}" for unit in units])
    singular = path.least_singular_value[:, None]
    yield _at_least("singularity", singular, bounds.least_singular_value, ["tip"], "", 1)
    if shapes is None:
        yield {"quantity": "self-collision", "where": "", "unit": "m", "verdict": NOT_TESTED}
    else:
        near = bounds.least_distance_m * (1.0 + THIN)
        distances = link_distances(shapes, path.joints[::COLLISION_EVERY], near)
        yield _at_least(
            "self-collision", distances, bounds.least_distance_m, shapes.pairs, "m", COLLISION_EVERY
        )


def _rest(arm: Arm, parameters: RobotParameters, nominal: Unroll) -> np.ndarray:
    if parameters.rest_configuration is None:
        turned = None if nominal.orientation is None else nominal.orientation[::COARSE]
        return rest_for(arm, nominal.position[::COARSE], turned, COARSE / RATE_HZ, SEED)
    return _per_joint(arm, parameters.rest_configuration, "rest_configuration")


def _per_joint(arm: Arm, values: Bound | Sequence[float], key: str) -> np.ndarray:
    """(n,) of one number, or of as many as there are joints."""
    array = np.atleast_1d(np.array(values, dtype=float))
    count = len(arm.tree.names)
    if array.size not in ({count} if key == "rest_configuration" else {1, count}):
        raise InputError(
            f"robot.{key}: has {array.size} values for {count} joints: {', '.join(arm.tree.names)}"
        )
    return np.broadcast_to(array, count).copy()


def _unwatched(shapes: LinkShapes) -> tuple[str, ...]:
    """What shapes cannot tell of."""
    touching = tuple(f"{pair} touch at rest and are not watched" for pair in shapes.touching)
    return touching + tuple(f"what {joint} moves has no collision shape" for joint in shapes.bare)


def _at_most(
    quantity: str,
    values: np.ndarray,
    bound: np.ndarray | Sequence[float],
    names: Sequence[str],
    units: Sequence[str],
) -> dict[str, str | float]:
    """The row of values (T, K) that must not exceed bounds (K,)."""
    return _row(quantity, values, np.asarray(bound), 1.0 - values / bound, names, units)


def _at_least(
    quantity: str, values: np.ndarray, bound: float, names: Sequence[str], unit: str, every: int
) -> dict[str, str | float]:
    """The row of values (T, K), at every so many-th sample, that must not fall below a bound."""
    left = values / bound - 1.0
    return _row(quantity, values, np.full(values.shape[1], bound), left, names, [unit] * len(names), every)


def _in_range(
    names: Sequence[str], units: Sequence[str], joints: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> dict[str, str | float]:
    """The row of joints (T, n) in their ranges; a margin of 1 is the middle, or a joint without limits."""
    room = np.minimum(joints - lower, upper - joints)
    half = 0.5 * (upper - lower)
    left = np.where(np.isfinite(half), room / np.where(np.isfinite(half), half, 1.0), 1.0)
    row = _row("joint range", joints, upper, left, names, units)
    joint = list(names).index(row["where"])
    nearer = min((lower[joint], upper[joint]), key=lambda bound: abs(bound - row["value"]))
    return row | {"bound": float(nearer)}


def _row(
    quantity: str,
    values: np.ndarray,
    bound: np.ndarray,
    left: np.ndarray,
    names: Sequence[str],
    units: Sequence[str],
    every: int = 1,
) -> dict[str, Any]:
    """Where the margin (T, K) is least; one above 1 says no more than 1."""
    sample, place = map(int, np.unravel_index(np.argmin(left), left.shape))
    margin = min(float(left[sample, place]), 1.0)
    return {
        "quantity": quantity,
        "where": names[place],
        "value": float(values[sample, place]),
        "bound": float(bound[place]),
        "unit": units[place],
        "margin": margin,
        "time_s": sample * every / RATE_HZ,
        "verdict": verdict(margin),
    }
