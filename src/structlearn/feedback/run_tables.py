"""Run tables of a skill: everything that depends on time, start and goals only, computed in advance."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.feedback.controller_tick import Plan
from structlearn.feedback.coupling import AXES
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.skill import ReactiveSkill, real_numbers
from structlearn.primitives import transformation, via_points
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sequence import PoseGoal, default_goals, default_start, unrolled_outputs
from structlearn.primitives.vector import sample_count

Place = tuple[int, int]  # index of the primitive, index of the axis
Point = tuple[np.ndarray, np.ndarray, np.ndarray]  # position, velocity, acceleration (N,) each
ViaPoints = Mapping[int, np.ndarray]  # positions (N,), m or of joints, by row of the plan

HELD_DURATIONS = 4.0
"""Durations for which the last primitive's terms continue after its end; then u is 1e-11, and is set to 0."""

MOST_TICKS = 10**7
"""Most ticks of a run, all planned ahead: almost three hours at 1 kHz; more suggests a unit error."""

MOST_HZ = 1e4
"""Highest rate of a controller: ten times a usual robot's, with a tick planned ahead for each of its periods;
more suggests a unit error."""

FEWEST_ROWS = 10
"""Rows from a via point to the next, to now and to the end: fewer make no smooth detour."""

UNIT_TOLERANCE = 1e-6  # largest deviation of a quaternion's norm from 1

FARTHEST_TURN_DEG = 60.0
"""Largest angle between a start or goal and the demonstrations' mean, for skills with a workspace: corrected
demonstrations differ by less, and beyond half a circle a primitive would turn the other way round."""


def plan_in_time(
    skill: ReactiveSkill,
    rate_hz: float,
    durations: Sequence[float],
    goals: Sequence[PoseGoal],
    feedback: bool,
) -> Plan:
    """The plan of a run, except the forcing term of the position (`forcing_in_base_frame`).

    `durations` in s and `goals` per primitive; `feedback`: whether networks are used.
    """
    dt, limits, axes = 1.0 / rate_hz, skill.limits, skill.axes
    movements = [primitive.position.local for primitive in skill.primitives]
    taus = np.array([own.time_constant(duration) for own, duration in zip(movements, durations, strict=True)])
    counts = [sample_count(duration, dt) for duration in durations]
    counts[-1] = sample_count((1.0 + HELD_DURATIONS) * durations[-1], dt)
    rows = np.cumsum([0, *counts])
    turning, expected = np.zeros((rows[-1], 3)), np.full((rows[-1], skill.channels), np.nan)
    networks = {
        (skill.index(name), axes.index(axis)): network
        for name, by_axis in (skill.networks if feedback else {}).items()
        for axis, network in by_axis.items()
    }
    begins = [default_start(skill.primitives), *goals]  # of turns; what differs is absorbed by the goal
    for index, (primitive, tau, count) in enumerate(zip(skill.primitives, taus, counts, strict=True)):
        part = slice(rows[index], rows[index + 1])
        if isinstance(primitive.orientation, QuaternionPrimitive):
            turn = primitive.orientation
            start, goal = (np.asarray(end.orientation) for end in begins[index : index + 2])
            turning[part] = turn.features(count, dt / tau) @ turn.weights_towards(start, goal)
        if primitive.name in skill.expected:
            traces, until = skill.expected[primitive.name], dt * (count - 1)
            if (rhythm := primitive.rhythm) is not None:  # as many cycles as the movement
                traces = traces.repeated(rhythm.cycles, first=rhythm.first)
            expected[part] = traces.unroll(dt, duration=durations[index], until=until).position
    turning[-1] = 0.0
    phases = [
        own.phase(dt / tau * np.arange(count))
        for own, tau, count in zip(movements, taus, counts, strict=True)
    ]
    phases[-1][1][-1] = 0.0
    position_goal = np.array([goal.position for goal in goals], dtype=float)
    return Plan(
        rows=rows,
        matrix=np.stack([transformation.step_matrix(dt / tau) for tau in taus]),
        tau=taus,
        position_goal=position_goal,
        orientation_goal=np.array([goal.orientation for goal in goals], dtype=float),
        position_forcing=np.zeros((rows[-1], position_goal.shape[1])),
        orientation_forcing=turning,
        outputs=_outputs(skill, dt, durations, counts),
        expected=expected,
        axes=np.array([AXES.index(axis) for axis in axes], dtype=np.int64),
        limits=limits.of(axes, dt),
        timeouts=np.array([round(limits.offset_within_s * rate_hz), round(limits.stale_after_s * rate_hz)]),
        **compiled_networks(networks, phases, len(axes)),
    )


def _outputs(
    skill: ReactiveSkill, dt: float, durations: Sequence[float], counts: Sequence[int]
) -> np.ndarray:
    """Continuous, then digital outputs (R, K); digital ones are 0 or 1."""
    paths, states = unrolled_outputs(skill.primitives, dt, durations, counts)
    parts = [[path.position for path in paths], states]
    return np.hstack([np.empty((sum(counts), 0)), *(np.concatenate(part) for part in parts if part)])


def compiled_networks(
    networks: Mapping[Place, CouplingModel], phases: Sequence[tuple[np.ndarray, np.ndarray]], axes: int
) -> dict[str, np.ndarray]:
    """The networks' fields of a `Plan`; `phases`: p and u (T_i,) per primitive."""
    rows = np.cumsum([0, *(len(p) for p, _ in phases)])
    features = {place: network.time_features(*phases[place[0]]) for place, network in networks.items()}
    widest = max((own.shape[1] for own in features.values()), default=0)
    time_features = np.zeros((rows[-1], axes, widest))
    for (index, axis), own in features.items():
        time_features[rows[index] : rows[index + 1], axis, : own.shape[1]] = own

    def padded(arrays: Sequence[Sequence[float] | np.ndarray], kind: type = np.int64) -> np.ndarray:
        """Values of each network, of any length, as (P, D, longest), zero-padded."""
        values: np.ndarray = np.zeros((len(phases), axes, max([1, *map(len, arrays)])), dtype=kind)
        for place, own in zip(networks, arrays, strict=True):
            values[place][: len(own)] = own
        return values

    compiled = [network.compiled() for network in networks.values()]
    return {
        "time_features": time_features,
        "kernels": padded([[network.kernel.address] for network in networks.values()])[..., 0],
        "inputs": padded([[network.inputs] for network in networks.values()])[..., 0],
        "memory": padded([[arguments.memory] for arguments in compiled])[..., 0],
        "sizes": padded([arguments.sizes for arguments in compiled]),
        "values": padded([arguments.values for arguments in compiled], float),
    }


def forcing_in_base_frame(
    skill: ReactiveSkill,
    plan: Plan,
    dt: float,
    forcing: np.ndarray,
    first: int,
    state: Point,
    goals: np.ndarray,
    via: ViaPoints,
) -> np.ndarray:
    """A forcing term (R, N) of the plan's positions, with new rows from primitive `first` on.

    Frame and amplitude of a primitive are those of its reach from where it starts without feedback, so the
    primitives are unrolled from `state`, at the start of the first. Shifts by feedback are absorbed by the
    evolving goal.

    `goals`: (P, N) m, or of joints. Raises InputError: a primitive's start and goal define no local frame, or
    as `through_via_points`.
    """
    forcing = forcing.copy()
    for index in range(first, len(plan.tau)):
        primitive, tau = skill.primitives[index], plan.tau[index]
        local = primitive.position.local
        try:
            axes = local_frame(state[0], goals[index], primitive.position.frame)
        except ValueError as error:
            raise InputError(f"'{primitive.name}' from {state[0]} to {goals[index]}: {error}") from error
        part = slice(plan.rows[index], plan.rows[index + 1])
        weights = local.weights_towards(np.zeros_like(state[0]), (goals[index] - state[0]) @ axes)
        forcing[part] = local.features(part.stop - part.start, dt / tau) @ weights @ axes.T
        forcing[part], state = through_via_points(
            skill, plan, dt, part.start, state, goals[index], forcing[part], via
        )
    forcing[-1] = 0.0
    return forcing


def through_via_points(
    skill: ReactiveSkill,
    plan: Plan,
    dt: float,
    row: int,
    state: Point,
    goal: np.ndarray,
    forcing: np.ndarray,
    via: ViaPoints,
) -> tuple[np.ndarray, Point]:
    """Forcing term (T, N) of a primitive from a row on, changed to pass its via points, and its end state.

    `state`: at the row. `forcing`: (T, N) without what is still missing. Via points that are less than
    `FEWEST_ROWS` away are passed as planned before. Raises InputError: a via point is too close to another or
    to the end, or takes a detour that is faster than the movement.
    """
    index = int(np.searchsorted(plan.rows, row, side="right")) - 1
    primitive, tau = skill.primitives[index], plan.tau[index]
    x, xd, xdd = state
    path = transformation.unroll(x, goal, forcing, dt, tau, xd, xdd)
    rows = sorted(at - row for at in via if row + FEWEST_ROWS <= at < plan.rows[index + 1])
    if rows:
        duration = tau * primitive.duration / primitive.position.local.time_constant(primitive.duration)
        ends = np.array([0, *rows, sample_count(duration, dt) - 1 - (row - plan.rows[index])])
        missing = np.array([via[row + at] - path.position[at] for at in rows])
        steps = np.diff([np.zeros_like(x), *missing, np.zeros_like(x)], axis=0)
        what, unit = f"a via point of '{primitive.name}'", "of joints per s" if skill.joints else "m/s"
        if np.diff(ends).min() < FEWEST_ROWS:
            raise InputError(f"{what} is less than {FEWEST_ROWS} ticks from the end or from another")
        speed = via_points.PEAK_SPEED * np.max(np.linalg.norm(steps, axis=1) / np.diff(ends)) / dt
        planned = primitive.position.unroll(dt, duration=duration).velocity
        if speed > (fastest := np.linalg.norm(planned, axis=1).max()):
            raise InputError(
                f"{what} takes a detour at {speed:.3g} {unit}, faster than the movement itself "
                f"({fastest:.3g} {unit}): ask for it earlier or nearer"
            )
        forcing = forcing + via_points.forcing_change(ends[1:].tolist(), missing, len(forcing), dt / tau)
        path = transformation.unroll(x, goal, forcing, dt, tau, xd, xdd)
    return forcing, (path.position[-1], path.velocity[-1], path.acceleration[-1])


def checked_rate(rate_hz: float) -> float:
    """A rate in Hz. Raises InputError: not a number, not positive, or above `MOST_HZ`."""
    rate = float(real_numbers(rate_hz, (), "the rate of the controller must be a number"))
    if not 0.0 < rate <= MOST_HZ:
        raise InputError(
            f"the rate of the controller must be positive, and at most {MOST_HZ:g} Hz, is {rate:g} Hz"
        )
    return rate


def checked_durations(skill: ReactiveSkill, durations: Sequence[float] | None, dt: float) -> list[float]:
    """Durations in s, one per primitive; default: the demonstrations' means.

    Raises InputError: wrong number, not numbers, shorter than a tick, or more than `MOST_TICKS` in total.
    """
    if durations is None:
        durations = [primitive.duration for primitive in skill.primitives]
    checked = []
    for name, value in _of_primitives(skill, durations, "durations"):
        duration = float(real_numbers(value, (), f"the duration of '{name}' must be a number"))
        if not duration / dt > 0.5:  # else it has one sample
            raise InputError(f"the duration of '{name}' must be a tick at least, is {duration} s")
        checked.append(duration)
    if sum(checked) > MOST_TICKS * dt:
        raise InputError(
            f"the run would have more than {MOST_TICKS} ticks: {sum(checked):g} s at {1 / dt:g} Hz"
        )
    return checked


def checked_goals(skill: ReactiveSkill, goals: Sequence[PoseGoal] | None) -> list[PoseGoal]:
    """Goals, one per primitive; default: the demonstrations' means, with identity if nothing turns.

    Raises InputError: wrong number, not a `PoseGoal`, a value that is not finite, a position outside the
    workspace, or a quaternion as in `checked_unit`.
    """
    checked = []
    goals = default_goals(skill.primitives) if goals is None else goals
    for index, (name, goal) in enumerate(_of_primitives(skill, goals, "goals")):
        if not isinstance(goal, PoseGoal):
            raise InputError(f"the goal of '{name}' must be a PoseGoal, is {goal!r}")
        position = checked_point(skill, goal.position, f"the goal of '{name}'")
        turns = skill.primitives[index].orientation is not None
        turned = checked_goal_orientation(skill, goal.orientation, index) if turns else quaternion.IDENTITY
        checked.append(PoseGoal(position, turned))
    return checked


def checked_point(skill: ReactiveSkill, position: np.ndarray, what: str) -> np.ndarray:
    """A position (3,), or (J,) of joints. Raises InputError: not finite, or outside the skill's workspace."""
    point = _finite(position, len(skill.joints) or 3, what)
    if skill.workspace is not None:
        skill.workspace.require(point, what)
    return point


def checked_start_orientation(skill: ReactiveSkill, orientation: np.ndarray | None) -> np.ndarray:
    """The normalised orientation (4,) at the start of a run. Raises InputError as `checked_unit`."""
    demonstrated = default_start(skill.primitives).orientation
    return checked_unit(skill, orientation, demonstrated, "the orientation at the start")


def checked_goal_orientation(skill: ReactiveSkill, orientation: np.ndarray | None, index: int) -> np.ndarray:
    """The normalised goal orientation (4,) of a primitive. Raises InputError as `checked_unit`."""
    name, demonstrated = skill.primitives[index].name, default_goals(skill.primitives)[index].orientation
    return checked_unit(skill, orientation, demonstrated, f"the goal orientation of '{name}'")


def checked_unit(
    skill: ReactiveSkill, values: np.ndarray | None, demonstrated: np.ndarray | None, what: str
) -> np.ndarray:
    """A normalised quaternion (4,); `demonstrated`: the mean one, if there is one.

    Raises InputError: not finite, its norm is not 1, or, with a workspace, it is more than
    `FARTHEST_TURN_DEG` from the demonstrated one.
    """
    array = _finite(values, 4, what)
    if abs(np.linalg.norm(array) - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{what} must have norm 1, has {np.linalg.norm(array):.6g}")
    if skill.workspace is not None and demonstrated is not None:
        angle = np.degrees(quaternion.angle_between(array, demonstrated))
        if angle > FARTHEST_TURN_DEG:
            raise InputError(
                f"{what} is {angle:.3g} degrees from the demonstrations' mean, more than "
                f"{FARTHEST_TURN_DEG:g}: is the quaternion scalar-first (w, x, y, z)?"
            )
    return quaternion.normalised(array)


def _finite(values: np.ndarray | None, size: int, what: str) -> np.ndarray:
    rule = f"{what} must be {size} finite numbers"
    array = real_numbers(values, (size,), rule).astype(float)
    if not np.isfinite(array).all():
        raise InputError(f"{rule}, is {array}")
    return array


def _of_primitives(skill: ReactiveSkill, values: Sequence[Any], what: str) -> list[tuple[str, Any]]:
    """Pairs (name of the primitive, value). Raises InputError: wrong number of values."""
    try:
        values = list(values)
    except TypeError as error:
        raise InputError(f"{what} must be one per primitive, are {values!r}") from error
    if len(values) != len(skill.primitives):
        raise InputError(f"there are {len(values)} {what} for {len(skill.primitives)} primitives")
    return [(primitive.name, value) for primitive, value in zip(skill.primitives, values, strict=True)]
