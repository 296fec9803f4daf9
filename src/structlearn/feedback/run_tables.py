"""Run tables of a skill: everything that depends on time, start and goals only, computed in advance."""

from collections.abc import Mapping, Sequence

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.feedback.controller_tick import Plan
from structlearn.feedback.coupling import AXES
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.skill import ReactiveSkill, require_finite, require_unit
from structlearn.primitives import canonical, kernels, transformation
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sequence import PoseGoal, default_goals
from structlearn.primitives.vector import relative_scale, sample_count

Place = tuple[int, int]  # Index of the primitive, index of the axis

HELD_DURATIONS = 4.0
"""How many durations after its end the last primitive's terms go on: by then u is 1e-11, and becomes 0."""

MOST_TICKS = 10**7
"""Of a run, which is planned ahead: almost three hours at 1 kHz; more suggests a unit error."""


def plan_in_time(
    skill: ReactiveSkill,
    rate_hz: float,
    durations: Sequence[float],
    goals: Sequence[np.ndarray],
    turned_goals: Sequence[np.ndarray],
    feedback: bool,
) -> Plan:
    """The plan of a run, but for the position's forcing term, which `forcing_in_base_frame` gives.

    `rate_hz`: ticks per second. `durations`: of the primitives in s. `goals`, `turned_goals`: (3,) m and (4,)
    of the primitives. `feedback`: whether networks are used.
    """
    dt, limits, axes = 1.0 / rate_hz, skill.limits, skill.axes
    ages = [round(seconds * rate_hz) for seconds in (limits.offset_within_s, limits.stale_after_s)]
    taus = np.array([canonical.time_constant(duration) for duration in durations])
    counts = [sample_count(duration, dt) for duration in durations]
    counts[-1] = sample_count((1.0 + HELD_DURATIONS) * durations[-1], dt)
    rows = np.cumsum([0, *counts])
    turning, expected = np.zeros((rows[-1], 3)), np.full((rows[-1], skill.channels), np.nan)
    networks = {
        (skill.index(name), axes.index(axis)): network
        for name, by_axis in (skill.networks if feedback else {}).items()
        for axis, network in by_axis.items()
    }
    for index, (primitive, tau, count) in enumerate(zip(skill.primitives, taus, counts, strict=True)):
        part = slice(rows[index], rows[index + 1])
        if isinstance(primitive.orientation, QuaternionPrimitive):
            weights = primitive.orientation.weights
            turning[part] = kernels.sampled_features(count, dt / tau, len(weights)) @ weights
        if primitive.name in skill.expected:
            traces = skill.expected[primitive.name]
            until = dt * (count - 1)
            expected[part] = traces.unroll(dt, duration=durations[index], until=until).position
    turning[-1] = 0.0
    phases = [
        canonical.phase(dt / tau * np.arange(count), 1.0) for tau, count in zip(taus, counts, strict=True)
    ]
    phases[-1][1][-1] = 0.0
    return Plan(
        rows=rows,
        matrix=np.stack([transformation.step_matrix(dt / tau) for tau in taus]),
        tau=taus,
        position_goal=np.array(goals, dtype=float),
        orientation_goal=np.array(turned_goals, dtype=float),
        position_forcing=np.zeros((rows[-1], 3)),
        orientation_forcing=turning,
        expected=expected,
        axes=np.array([AXES.index(axis) for axis in axes], dtype=np.int64),
        limits=limits.of(axes, dt),
        ages=np.array(ages, dtype=np.int64),
        **compiled_networks(networks, phases, len(axes)),
    )


def compiled_networks(
    networks: Mapping[Place, CouplingModel], phases: Sequence[tuple[np.ndarray, np.ndarray]], axes: int
) -> dict[str, np.ndarray]:
    """The parts of a `Plan` that are the networks'; `phases`: p and u (T_i,) of each primitive."""
    shape, rows = (len(phases), axes), np.cumsum([0, *(len(p) for p, _ in phases)])
    compiled = {place: network.compiled() for place, network in networks.items()}
    tables = {place: network.table(*phases[place[0]]) for place, network in networks.items()}
    table = np.zeros((rows[-1], axes, max((one.shape[1] for one in tables.values()), default=0)))
    for (index, place), own in tables.items():
        table[rows[index] : rows[index + 1], place, : own.shape[1]] = own
    return {
        "table": table,
        "kernels": _padded(shape, {place: [one.kernel.address] for place, one in networks.items()})[..., 0],
        "inputs": _padded(shape, {place: [one.inputs] for place, one in networks.items()})[..., 0],
        "memory": _padded(shape, {place: [one.memory] for place, one in compiled.items()})[..., 0],
        "sizes": _padded(shape, {place: one.sizes for place, one in compiled.items()}),
        "values": _padded(shape, {place: one.values for place, one in compiled.items()}, float),
    }


def _padded(
    shape: tuple[int, int], found: Mapping[Place, Sequence[float] | np.ndarray], kind: type = np.int64
) -> np.ndarray:
    """Numbers of any length by place as a table (*shape, longest), 0 where there are none."""
    values: np.ndarray = np.zeros((*shape, max([1, *map(len, found.values())])), dtype=kind)
    for place, own in found.items():
        values[place][: len(own)] = own
    return values


def forcing_in_base_frame(
    skill: ReactiveSkill,
    plan: Plan,
    dt: float,
    first: int,
    state: tuple[np.ndarray, np.ndarray, np.ndarray],
    goals: np.ndarray,
) -> np.ndarray:
    """Forcing term of the positions from one primitive to the last, each in the frame of its reach.

    Frame and amplitude of a primitive are those from where it will start without feedback: it is unrolled
    here. What feedback on the position has left over where it does start is taken up by the evolving goal.

    `dt`: length of a tick in s. `state`: position, velocity, acceleration (3,) at its start. `goals`: (P, 3)
    m. Returns (R, 3) the plan's forcing with new rows from that primitive on. Raises InputError: a
    primitive's start and goal define no local frame.
    """
    forcing = plan.position_forcing.copy()
    for index in range(first, len(plan.tau)):
        primitive, tau = skill.primitives[index], plan.tau[index]
        local = primitive.position.local
        try:
            axes = local_frame(state[0], goals[index], primitive.position.frame)
        except ValueError as error:
            raise InputError(f"'{primitive.name}' from {state[0]} to {goals[index]}: {error}") from error
        part = slice(plan.rows[index], plan.rows[index + 1])
        count = plan.rows[index + 1] - plan.rows[index]
        scale = relative_scale((goals[index] - state[0]) @ axes, local.goal - local.start, local.scaled)
        features = kernels.sampled_features(count, dt / tau, len(local.weights))
        forcing[part] = features @ (local.weights * scale) @ axes.T
        state = end_state(forcing[part], dt, tau, state, goals[index])
    forcing[-1] = 0.0
    return forcing


def end_state(
    forcing: np.ndarray,
    dt: float,
    tau: float,
    state: tuple[np.ndarray, np.ndarray, np.ndarray],
    goal: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity, acceleration (3,) at the last row of a forcing term (T, 3)."""
    x, xd, xdd = state
    path = transformation.unroll(x, goal, forcing, dt, tau, xd, xdd)
    return path.position[-1], path.velocity[-1], path.acceleration[-1]


def checked_durations(skill: ReactiveSkill, durations: Sequence[float] | None, dt: float) -> Sequence[float]:
    """Durations in s, one per primitive; default the demonstrations' means.

    Raises InputError: another number of them, one shorter than a tick or infinite, or more than `MOST_TICKS`.
    """
    if durations is None:
        durations = [primitive.duration for primitive in skill.primitives]
    _check_count(skill, durations, "durations")
    for primitive, duration in zip(skill.primitives, durations, strict=True):
        if not (np.isfinite(duration) and sample_count(max(duration, 0.0), dt) >= 2):
            raise InputError(f"the duration of '{primitive.name}' must be a tick at least, is {duration} s")
    if sum(durations) > MOST_TICKS * dt:
        raise InputError(
            f"the run would have more than {MOST_TICKS} ticks: {sum(durations):g} s at {1 / dt:g} Hz"
        )
    return durations


def checked_goals(
    skill: ReactiveSkill, goals: Sequence[PoseGoal] | None
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Positions (3,) and orientations (4,) of the goals; default the demonstrations' means.

    Raises InputError: another number of them, or one that is not finite, outside the workspace or no unit
    quaternion.
    """
    goals = default_goals(skill.primitives) if goals is None else goals
    _check_count(skill, goals, "goals")
    positions, orientations = [], []
    for primitive, goal in zip(skill.primitives, goals, strict=True):
        positions.append(checked_point(skill, goal.position, f"the goal of '{primitive.name}'"))
        unturned = primitive.orientation is None
        orientations.append(quaternion.IDENTITY if unturned else unit_goal(goal.orientation, primitive.name))
    return positions, orientations


def checked_point(skill: ReactiveSkill, position: np.ndarray, what: str) -> np.ndarray:
    """A position (3,); InputError where it is not finite, or outside the workspace of the skill."""
    point = require_finite(position, 3, what)
    if skill.workspace is not None:
        skill.workspace.require(point, what)
    return point


def unit_goal(orientation: np.ndarray | None, name: str) -> np.ndarray:
    """The goal orientation (4,) of a primitive with norm 1; InputError where it is none."""
    return quaternion.normalised(require_unit(orientation, 4, f"the goal orientation of '{name}'"))


def _check_count(skill: ReactiveSkill, values: Sequence, what: str) -> None:
    if len(values) != len(skill.primitives):
        raise InputError(f"there are {len(values)} {what} for {len(skill.primitives)} primitives")
