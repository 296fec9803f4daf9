"""Check whether a robot can execute whatever a skill may command, with margins by quantity and run.

Every run is followed by inverse kinematics, starting near the same rest configuration. A skill that commands
joints has them already: position, orientation and singularity are then nobody's concern.

| quantity | bound |
|---|---|
| position, orientation | error of the tip: 1 mm, 0.5 degrees |
| joint range, velocity | limits in the URDF |
| acceleration, jerk | parameters |
| singularity | least singular value of the Jacobian, parameter |
| self-collision | least distance of links, parameter |
| joint jump | 0.1 rad (m) between two samples, which no arm can follow |
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, Workspace
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.sequence import PoseGoal, default_goals, default_start
from structlearn.primitives.vector import sample_count
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.arm_kinematics import (
    Arm,
    JointPath,
    LinkShapes,
    follow,
    link_distances,
    read_arm,
    read_collision_shapes,
    rest_for,
)
from structlearn.rigid_body.urdf import require_velocities
from structlearn.tasks.movement import check_results
from structlearn.tasks.movement.check_results import CORRECTIONS, GOALS, NO, NOMINAL, STARTS, SkillCheck
from structlearn.tasks.movement.parameters import RobotParameters
from structlearn.tasks.task_files import local_path

RATE_HZ = 200.0  # sampling of runs; 5 ms is short compared with anything in a primitive of half a second
COLLISION_EVERY = 4  # samples between distance checks: links approach by some centimetres in 20 ms
# Tolerated errors of the tip: the search ends at a millionth of it or cannot reach the pose
REACH_M, REACH_RAD = 1e-3, np.radians(0.5)
JUMP = 0.1  # rad or m from one sample to the next
# Reduction of the workspace on every side, and of the coupling bounds, in two attempts. The bounds are 1.5
# times the largest demonstrated correction.
INSETS_M, SHARES = (0.02, 0.05), (2.0 / 3.0, 1.0 / 3.0)
COARSE, SEED = 20, 1  # thinning of the nominal run, and seed, for the search of a rest configuration
BEYOND_ALL_BOUNDS = 1e9  # network weights that drive the coupling term to its bound within a tick or two


@dataclass(frozen=True)
class Unroll:
    """One run over T ticks."""

    kind: str  # one of `check_results.KINDS`
    name: str  # difference from the nominal run, in words
    position: np.ndarray  # (T, 3) m, in the frame of the demonstrations; of joints (T, J)
    orientation: np.ndarray | None  # (T, 4) unit quaternions


def unrolls(skill: ReactiveSkill, rate_hz: float, slower: float = 1.0) -> Iterator[Unroll]:
    """The nominal run, 8 starts, 8 goals per primitive, and two runs per axis with feedback.

    Of joints, two starts and goals for each: at the ends of its range in the workspace. `slower`: factor on
    all durations.
    """
    silent, run = replace(skill, networks={}), partial(_run, rate_hz=rate_hz, slower=slower)
    start, goals = default_start(skill.primitives), default_goals(skill.primitives)
    yield run(silent, NOMINAL, "as demonstrated", start, goals)
    for name, corner in _corners(skill, start.position):
        yield run(silent, STARTS, f"start {name}", PoseGoal(corner, start.orientation), goals)
    for place, (primitive, goal) in enumerate(zip(skill.primitives, goals, strict=True)):
        for name, corner in _corners(skill, goal.position):
            changed = [*goals[:place], PoseGoal(corner, goal.orientation), *goals[place + 1 :]]
            yield run(silent, GOALS, f"end of {primitive.name} {name}", start, changed)
    for axis, sign in product(skill.axes, (1.0, -1.0)):
        pushing = open_loop(np.full(KERNEL_COUNT, sign * BEYOND_ALL_BOUNDS))
        networks = {name: {axis: pushing} for name, by_axis in skill.networks.items() if axis in by_axis}
        pushed = replace(skill, networks=networks)
        # networks are modulated by the phase velocity, which is negative
        yield run(pushed, CORRECTIONS, f"{axis} {'-' if sign > 0 else '+'}", start, goals)


def _corners(skill: ReactiveSkill, point: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Corners (3,) of the workspace with their names, `at x+ y- z+`; or a point with one joint at an end."""
    if skill.workspace is None:
        return
    for place, joint in enumerate(skill.joints):
        for word, end in (("low", skill.workspace.low), ("high", skill.workspace.high)):
            moved = point.copy()
            moved[place] = end[place]
            yield f"with {joint} {word}", moved
    if skill.joints:
        return
    ends = np.array([skill.workspace.low, skill.workspace.high])
    for upper in product((0, 1), repeat=3):
        name = " ".join(f"{axis}{'-+'[end]}" for axis, end in zip("xyz", upper, strict=True))
        yield f"at {name}", ends[list(upper), [0, 1, 2]]


def _run(
    skill: ReactiveSkill,
    kind: str,
    name: str,
    start: PoseGoal,
    goals: list[PoseGoal],
    *,
    rate_hz: float,
    slower: float,
) -> Unroll:
    """Output of the controller, tick by tick."""
    durations = [slower * primitive.duration for primitive in skill.primitives]
    controller = Controller(skill, rate_hz, durations, goals=goals)
    controller.start(start.position, start.orientation)
    ticks = 1 + sum(sample_count(duration, 1.0 / rate_hz) - 1 for duration in durations)
    position, orientation = np.empty((ticks, len(controller.position))), np.empty((ticks, 4))
    for tick in range(ticks):
        controller.tick(None)
        position[tick], orientation[tick] = controller.position, controller.orientation
    turned = skill.primitives[0].orientation is not None
    return Unroll(kind, name, position, orientation if turned else None)


def check_skill(skill: ReactiveSkill, parameters: RobotParameters) -> SkillCheck:
    """Follow all runs of a skill with a robot; if some fail, try changes that may fix them (`remedies`).

    Raises InputError: the URDF is not usable, the number of bounds does not match the joints, or no joint
    configuration reaches the start.
    """
    arm = read_arm(urdf_path(str(local_path(parameters.urdf))), parameters.tip, parameters.locked_joints)
    require_velocities(arm.source, arm.tree)
    in_frames = partial(_in_arm_order, arm, skill.joints) if skill.joints else in_arm_frames
    runs = [in_frames(run, parameters) for run in unrolls(skill, RATE_HZ)]
    if skill.joints:
        rest = runs[0].position[0]
    elif parameters.rest_configuration is None:
        position, orientation = runs[0].position, runs[0].orientation
        turned = None if orientation is None else orientation[::COARSE]
        rest = rest_for(arm, position[::COARSE], turned, COARSE / RATE_HZ, SEED)
    else:
        rest = _per_joint(arm, parameters, "rest_configuration")
    try:
        shapes = read_collision_shapes(arm, parameters.locked_joints, rest)
        notes = tuple(f"{pair} touch at rest and are not watched" for pair in shapes.touching)
        notes += tuple(f"what {joint} moves has no collision shape" for joint in shapes.bare)
    except InputError as error:
        shapes, notes = None, (f"self-collision was not tested: {error}",)
    if others := [name for name in skill.joints if name not in arm.tree.names]:
        notes += (f"{', '.join(others)}: not between the base and {parameters.tip}, and not tested",)
    if skill.joints:
        notes += ("joints are taken as rad (m), as the URDF has them",)
    if beside := (*skill.outputs, *skill.digital):
        notes += (f"{', '.join(beside)}: outputs, which were not tested",)
    if skill.workspace is None:
        notes += ("the skill has no workspace, so starts and goals elsewhere were not tried",)

    def rows_of(unrolls: Iterable[Unroll]) -> pd.DataFrame:
        rows = []
        for run in unrolls:
            followed = (
                run.position
                if skill.joints
                else follow(arm, run.position, run.orientation, 1.0 / RATE_HZ, rest)
            )
            found_margins = margins(arm, followed, parameters, shapes)
            rows += [{"kind": run.kind, "run": run.name, **row} for row in found_margins]
        return pd.DataFrame(rows)

    named_rest = dict(zip(arm.tree.names, rest.tolist(), strict=True))
    check = SkillCheck(rows_of(runs), named_rest, notes, check_results.NOTHING_TRIED)
    failing, tried = set(check.failing["run"]), []
    for change, changed, slower in remedies(skill, check):
        again = (run for run in unrolls(changed, RATE_HZ, slower) if run.name in failing)
        still = rows_of(in_frames(run, parameters) for run in again)
        left = int(still.loc[still["verdict"] == NO, "run"].nunique())
        tried.append((change, len(failing), left, float(still["margin"].min())))
        if left == 0:
            break
    return replace(check, tried=pd.DataFrame(tried, columns=check_results.TRIED)) if tried else check


def remedies(skill: ReactiveSkill, check: SkillCheck) -> Iterator[tuple[str, ReactiveSkill, float]]:
    """Changes that may fix failing runs: description, changed skill, factor on its durations.

    Slower if velocity, acceleration or jerk fail; a smaller workspace if starts or goals fail, smaller bounds
    if corrections do; then both together.
    """
    kinds, stretch = set(check.failing["kind"]), 1.01 * check.stretch  # slightly beyond the bound
    slower = f"durations x {stretch:.2f}"
    if not kinds:
        return
    if check.stretch > 1.0:
        yield slower, skill, stretch
    if NOMINAL in kinds or skill.joints:
        return
    for inset, share in zip(INSETS_M, SHARES, strict=True):
        words, changed = [], skill
        if kinds & {STARTS, GOALS} and skill.workspace is not None:
            if np.any(skill.workspace.high - skill.workspace.low <= 2.0 * inset):
                return
            box = Workspace(skill.workspace.low + inset, skill.workspace.high - inset)
            words.append(f"workspace_margin_m smaller by {inset:g} m")
            changed = replace(changed, workspace=box)
        if CORRECTIONS in kinds:
            bounds = {axis: share * bound for axis, bound in skill.limits.largest_coupling.items()}
            words.append(f"corrections of at most {share:.0%} of their bounds")
            limits = skill.limits.model_copy(update={"largest_coupling": bounds})
            changed = replace(changed, limits=limits)
        yield " and ".join(words), changed, 1.0
        if check.stretch > 1.0:
            yield " and ".join([*words, slower]), changed, stretch


def _in_arm_order(arm: Arm, joints: Sequence[str], run: Unroll, _: RobotParameters) -> Unroll:
    """A run of joints in the arm's order. Raises InputError: the skill does not command one of them."""
    if missing := [name for name in arm.tree.names if name not in joints]:
        raise InputError(
            f"{arm.source}: the skill commands {', '.join(joints)}, not {', '.join(missing)}: name what does "
            "not move in robot.locked_joints"
        )
    return replace(run, position=run.position[:, [joints.index(name) for name in arm.tree.names]])


def in_arm_frames(run: Unroll, parameters: RobotParameters) -> Unroll:
    """Convert a run to poses of the tip in the robot's base frame.

    Raises InputError: the tool is offset from the tip, but the run has no orientations.
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
    arm: Arm, path: JointPath | np.ndarray, parameters: RobotParameters, shapes: LinkShapes | None
) -> Iterator[dict[str, Any]]:
    """Least margin of each quantity along one run at `RATE_HZ`: rows of `SkillCheck.margins` without the run.

    `path`: of commanded joints (T, n), without what concerns the tip. The margin of a joint range is 1 in its
    middle, and for joints without limits.
    """
    tree, dt, joints = arm.tree, 1.0 / RATE_HZ, path.joints if isinstance(path, JointPath) else path
    units = ["m" if prismatic else "rad" for prismatic in tree.prismatic]
    velocity = signals.derivative(joints, dt)
    acceleration = signals.derivative(velocity, dt)
    steps = np.diff(joints, axis=0, prepend=joints[:1])
    half, room = 0.5 * (tree.upper - tree.lower), np.minimum(joints - tree.lower, tree.upper - joints)
    middle = np.where(np.isfinite(half), room / np.where(np.isfinite(half), half, 1.0), 1.0)
    nearer = np.where(joints - tree.lower <= tree.upper - joints, tree.lower, tree.upper)

    def at_most(
        values: np.ndarray, bound: np.ndarray | float, names: Sequence[str], units: list[str]
    ) -> tuple:
        size = np.abs(values)
        return size, bound, 1.0 - size / bound, names, units

    def of_joints(values: np.ndarray, bound: np.ndarray, per: str = "") -> tuple:
        return at_most(values, bound, tree.names, [f"{unit}{per}" for unit in units])

    def at_least(values: np.ndarray, bound: float, names: Sequence[str], unit: str) -> tuple:
        return values, bound, values / bound - 1.0, names, [unit] * len(names)

    largest, least = partial(_per_joint, arm, parameters), parameters.least_singular_value
    first, last = list[tuple[str, tuple]](), list[tuple[str, tuple]]()
    if isinstance(path, JointPath):
        first.append(("position", at_most(path.missed_m[:, None], REACH_M, ["tip"], ["m"])))
        first.append(("orientation", at_most(path.missed_rad[:, None], REACH_RAD, ["tip"], ["rad"])))
        last.append(("singularity", at_least(path.least_singular_value[:, None], least, ["tip"], "")))
    for quantity, result in (
        *first,
        ("joint range", (joints, nearer, middle, tree.names, units)),
        ("velocity", of_joints(velocity, tree.velocity, "/s")),
        ("acceleration", of_joints(acceleration, largest("max_acceleration"), "/s²")),
        ("jerk", of_joints(signals.derivative(acceleration, dt), largest("max_jerk"), "/s³")),
        ("joint jump", of_joints(steps, np.full(len(units), JUMP))),
        *last,
    ):
        yield {"quantity": quantity} | _worst(*result)
    if shapes is None:
        yield {"quantity": "self-collision", "where": "", "unit": "m", "verdict": check_results.NOT_TESTED}
    else:
        apart = parameters.least_distance_m
        distances = link_distances(shapes, joints[::COLLISION_EVERY], apart * (1.0 + check_results.THIN))
        worst = _worst(*at_least(distances, apart, shapes.pairs, "m"))
        yield {"quantity": "self-collision"} | worst | {"time_s": COLLISION_EVERY * worst["time_s"]}


def _per_joint(arm: Arm, parameters: RobotParameters, key: str) -> np.ndarray:
    """Parameter as an array (n,), from a common value or one per joint."""
    array = np.atleast_1d(np.array(getattr(parameters, key), dtype=float))
    count = len(arm.tree.names)
    if array.size not in ({count} if key == "rest_configuration" else {1, count}):
        raise InputError(
            f"robot.{key}: has {array.size} values for {count} joints: {', '.join(arm.tree.names)}"
        )
    return np.broadcast_to(array, count).copy()


def _worst(
    values: np.ndarray,
    bound: np.ndarray | float,
    left: np.ndarray,
    names: Sequence[str],
    units: Sequence[str],
) -> dict[str, Any]:
    """Row for the least margin `left` (T, K) of values (T, K), clipped at 1."""
    sample, place = map(int, np.unravel_index(np.argmin(left), left.shape))
    margin = min(float(left[sample, place]), 1.0)
    return {
        "where": names[place],
        "value": float(values[sample, place]),
        "bound": float(np.broadcast_to(bound, values.shape)[sample, place]),
        "unit": units[place],
        "margin": margin,
        "time_s": sample / RATE_HZ,
        "verdict": check_results.margin_verdict(margin),
    }
