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
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives import canonical, kernels, transformation
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sequence import PoseGoal, default_goals
from structlearn.primitives.vector import relative_scale, sample_count

Place = tuple[int, int]  # index of the primitive, index of the axis
Point = tuple[np.ndarray, np.ndarray, np.ndarray]  # position, velocity, acceleration (3,) each

HELD_DURATIONS = 4.0
"""Durations for which the last primitive's terms continue after its end; then u is 1e-11, and is set to 0."""

MOST_TICKS = 10**7
"""Most ticks of a run, all planned ahead: almost three hours at 1 kHz; more suggests a unit error."""

UNIT_TOLERANCE = 1e-6  # largest deviation of a quaternion's norm from 1


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
            traces, until = skill.expected[primitive.name], dt * (count - 1)
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
        position_goal=np.array([goal.position for goal in goals], dtype=float),
        orientation_goal=np.array([goal.orientation for goal in goals], dtype=float),
        position_forcing=np.zeros((rows[-1], 3)),
        orientation_forcing=turning,
        expected=expected,
        axes=np.array([AXES.index(axis) for axis in axes], dtype=np.int64),
        limits=limits.of(axes, dt),
        ages=np.array([round(limits.offset_within_s * rate_hz), round(limits.stale_after_s * rate_hz)]),
        **compiled_networks(networks, phases, len(axes)),
    )


def compiled_networks(
    networks: Mapping[Place, CouplingModel], phases: Sequence[tuple[np.ndarray, np.ndarray]], axes: int
) -> dict[str, np.ndarray]:
    """The networks' fields of a `Plan`; `phases`: p and u (T_i,) per primitive."""
    rows = np.cumsum([0, *(len(p) for p, _ in phases)])
    tables = {place: network.table(*phases[place[0]]) for place, network in networks.items()}
    table = np.zeros((rows[-1], axes, max((one.shape[1] for one in tables.values()), default=0)))
    for (index, place), own in tables.items():
        table[rows[index] : rows[index + 1], place, : own.shape[1]] = own

    def padded(found: Sequence[Sequence[float] | np.ndarray], kind: type = np.int64) -> np.ndarray:
        """Values of each network, of any length, as (P, D, longest), zero-padded."""
        values: np.ndarray = np.zeros((len(phases), axes, max([1, *map(len, found)])), dtype=kind)
        for place, own in zip(networks, found, strict=True):
            values[place][: len(own)] = own
        return values

    compiled = [network.compiled() for network in networks.values()]
    return {
        "table": table,
        "kernels": padded([[network.kernel.address] for network in networks.values()])[..., 0],
        "inputs": padded([[network.inputs] for network in networks.values()])[..., 0],
        "memory": padded([[one.memory] for one in compiled])[..., 0],
        "sizes": padded([one.sizes for one in compiled]),
        "values": padded([one.values for one in compiled], float),
    }


def forcing_in_base_frame(
    skill: ReactiveSkill, plan: Plan, dt: float, first: int, state: Point, goals: np.ndarray
) -> np.ndarray:
    """Forcing term (R, 3) of the plan's positions, with new rows from primitive `first` on.

    Frame and amplitude of a primitive are those of its reach from where it starts without feedback, so the
    primitives are unrolled from `state`, at the start of the first. Shifts by feedback are absorbed by the
    evolving goal.

    `goals`: (P, 3) m. Raises InputError: a primitive's start and goal define no local frame.
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
        scale = relative_scale((goals[index] - state[0]) @ axes, local.goal - local.start, local.scaled)
        features = kernels.sampled_features(part.stop - part.start, dt / tau, len(local.weights))
        forcing[part] = features @ (local.weights * scale) @ axes.T
        state = end_state(forcing[part], dt, tau, state, goals[index])
    forcing[-1] = 0.0
    return forcing


def end_state(forcing: np.ndarray, dt: float, tau: float, state: Point, goal: np.ndarray) -> Point:
    """State at the last row of a forcing term (T, 3)."""
    x, xd, xdd = state
    path = transformation.unroll(x, goal, forcing, dt, tau, xd, xdd)
    return path.position[-1], path.velocity[-1], path.acceleration[-1]


def checked_durations(skill: ReactiveSkill, durations: Sequence[float] | None, dt: float) -> Sequence[float]:
    """Durations in s, one per primitive; default: the demonstrations' means.

    Raises InputError: wrong number, shorter than a tick or infinite, or more than `MOST_TICKS` in total.
    """
    if durations is None:
        durations = [primitive.duration for primitive in skill.primitives]
    for name, duration in _of_primitives(skill, durations, "durations"):
        if not (np.isfinite(duration) and sample_count(max(duration, 0.0), dt) >= 2):
            raise InputError(f"the duration of '{name}' must be a tick at least, is {duration} s")
    if sum(durations) > MOST_TICKS * dt:
        raise InputError(
            f"the run would have more than {MOST_TICKS} ticks: {sum(durations):g} s at {1 / dt:g} Hz"
        )
    return durations


def checked_goals(skill: ReactiveSkill, goals: Sequence[PoseGoal] | None) -> list[PoseGoal]:
    """Goals, one per primitive; default: the demonstrations' means, with identity if nothing turns.

    Raises InputError: wrong number, a value that is not finite, a position outside the workspace, or a
    quaternion without unit norm.
    """
    found = []
    goals = default_goals(skill.primitives) if goals is None else goals
    turned = [primitive.orientation is not None for primitive in skill.primitives]
    for (name, goal), turns in zip(_of_primitives(skill, goals, "goals"), turned, strict=True):
        position = checked_point(skill, goal.position, f"the goal of '{name}'")
        found.append(PoseGoal(position, unit_goal(goal.orientation, name) if turns else quaternion.IDENTITY))
    return found


def checked_point(skill: ReactiveSkill, position: np.ndarray, what: str) -> np.ndarray:
    """A position (3,). Raises InputError: not finite, or outside the skill's workspace."""
    point = _finite(position, 3, what)
    if skill.workspace is not None:
        skill.workspace.require(point, what)
    return point


def unit_goal(orientation: np.ndarray | None, name: str) -> np.ndarray:
    """The normalised goal orientation (4,) of a primitive. Raises InputError as `checked_unit`."""
    return quaternion.normalised(checked_unit(orientation, f"the goal orientation of '{name}'"))


def checked_unit(values: np.ndarray | None, what: str) -> np.ndarray:
    """A quaternion (4,). Raises InputError: not finite, or its norm is not 1."""
    array = _finite(values, 4, what)
    if abs(np.linalg.norm(array) - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{what} must have norm 1, has {np.linalg.norm(array):.6g}")
    return array


def _finite(values: np.ndarray | None, size: int, what: str) -> np.ndarray:
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be {size} numbers, is {values!r}") from error
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{what} must be {size} finite numbers, is {array}")
    return array


def _of_primitives(skill: ReactiveSkill, values: Sequence, what: str) -> list[tuple[str, Any]]:
    """Pairs (name of the primitive, value). Raises InputError: wrong number of values."""
    if len(values) != len(skill.primitives):
        raise InputError(f"there are {len(values)} {what} for {len(skill.primitives)} primitives")
    return [(primitive.name, value) for primitive, value in zip(skill.primitives, values, strict=True)]
