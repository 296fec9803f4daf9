"""One tick of the controller, compiled: sensor bookkeeping, feedback, and one exact step of the pose.

The steps themselves are those of `primitives.transformation` and `primitives.orientation`; here is what a
run adds: which row of the plan is due, how old the sensor's sample is, and bounds on the coupling term.
"""

from typing import NamedTuple

import numpy as np

from structlearn.core.compilation import numba
from structlearn.feedback.coupling_model import evaluate
from structlearn.primitives import orientation, transformation
from structlearn.primitives.vector import OFFSET_SAMPLES

REJECTED, WAITING, NO_OFFSET, STALE, SATURATED, RATE_LIMITED = (1 << bit for bit in range(6))

ROW, PRIMITIVE, TICK, SAMPLE_TICK, SAMPLE_COUNT = range(5)
"""Places in the clock: row of the plan and primitive that are due, number of this tick, the tick of the
last good sensor sample, and how many good samples the offset has."""


_part_of_a_tick = numba.njit(cache=True, forceinline=True)
"""Compiled into its caller: handing over a plan and a state costs more than many a part does."""


class Plan(NamedTuple):
    """Tables over time; R rows, one per sample of each primitive, those at a switch twice."""

    rows: np.ndarray  # (P + 1,) first row of each primitive
    matrix: np.ndarray  # (P, 3, 5) `transformation.step_matrix`
    tau: np.ndarray  # (P,) time constants in s
    position_goal: np.ndarray  # (P, 3) m
    orientation_goal: np.ndarray  # (P, 4)
    position_forcing: np.ndarray  # (R, 3) in the base frame
    orientation_forcing: np.ndarray  # (R, 3)
    expected: np.ndarray  # (R, E) expected sensor traces; NaN where a primitive has none
    axes: np.ndarray  # (D,) places of the axes of the coupling in `coupling.AXES`
    kernels: np.ndarray  # (P, D) addresses of the networks' kernels, 0 where there is no network
    inputs: np.ndarray  # (P, D) how many channels they take
    sizes: np.ndarray  # (P, D, S), see `coupling_model.Compiled`
    values: np.ndarray  # (P, D, V), likewise
    memory: np.ndarray  # (P, D) how many numbers they remember
    table: np.ndarray  # (R, D, K) `CouplingModel.table`
    limits: np.ndarray  # (2, D) largest coupling, and its largest change in one tick
    ages: np.ndarray  # (2,) ticks until the offset must be known, and until a sample is stale


class State(NamedTuple):
    """State of a run, changed by every tick."""

    clock: np.ndarray  # (5,) see `ROW`
    point: np.ndarray  # (3, 1, 3) x - G, tau xd, g - G at the row that is due
    turned: np.ndarray  # (1, 4) orientation at the row that is due
    rate: np.ndarray  # (1, 3) tau w
    remaining: np.ndarray  # (1, 3) rotation vector from the steady to the evolving goal
    coupling: np.ndarray  # (D,) c on each axis
    sample: np.ndarray  # (E,) newest sensor sample handed in
    good: np.ndarray  # (E,) newest good one
    zero: np.ndarray  # (E,) mean of the first samples: the offset of the run, complete after `OFFSET_SAMPLES`
    deviation: np.ndarray  # (E,) good - zero - expected
    path: np.ndarray  # (3, 1, 1, 3) output: position, velocity, acceleration
    orientation: np.ndarray  # (1, 1, 4) output
    turning: np.ndarray  # (2, 1, 1, 3) output: angular velocity, angular acceleration
    held: np.ndarray  # (2, 1, 3) coupling vector of the position, and of the orientation; 0 but on the axes
    memory: np.ndarray  # (D, M) of the networks


def resting_state(plan: Plan) -> State:
    """Memory for runs of a plan."""
    channels = plan.expected.shape[1]
    turned = np.array([[1.0, 0.0, 0.0, 0.0]])
    return State(
        clock=np.zeros(5, dtype=np.int64),
        point=np.zeros((3, 1, 3)),
        turned=turned,
        rate=np.zeros((1, 3)),
        remaining=np.zeros((1, 3)),
        coupling=np.zeros(len(plan.axes)),
        sample=np.full(channels, np.nan),
        good=np.zeros(channels),
        zero=np.zeros(channels),
        deviation=np.full(channels, np.nan),
        path=np.zeros((3, 1, 1, 3)),
        orientation=turned[None].copy(),
        turning=np.zeros((2, 1, 1, 3)),
        held=np.zeros((2, 1, 3)),
        memory=np.zeros((len(plan.axes), plan.memory.max(initial=0))),
    )


def no_plan() -> tuple[tuple, tuple]:
    """Plan and state without a primitive as plain tuples, for compiled loops that can do without."""
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(Plan._fields, (0, 0))
    shapes |= {"rows": (1,), "tau": (0,), "axes": (0,), "ages": (2,)}
    shapes |= {"matrix": (0, 3, 5), "position_goal": (0, 3), "orientation_goal": (0, 4), "limits": (2, 0)}
    shapes |= {"position_forcing": (0, 3), "orientation_forcing": (0, 3)}
    shapes |= dict.fromkeys(("sizes", "values", "table"), (0, 0, 0))
    whole = {"rows", "axes", "kernels", "inputs", "sizes", "memory", "ages"}
    plan = Plan(
        **{name: np.zeros(shapes[name], np.int64 if name in whole else float) for name in Plan._fields}
    )
    return tuple(plan), tuple(resting_state(plan))


@numba.njit(cache=True)
def begin(plan_arrays: tuple, state_arrays: tuple, primitive: int) -> None:
    """Start a primitive in the state of the outputs (eq. IV.12-14)."""
    plan, state = Plan(*plan_arrays), State(*state_arrays)
    row, tau = plan.rows[primitive], plan.tau[primitive]
    state.clock[ROW], state.clock[PRIMITIVE] = row, primitive
    state.memory[:] = 0.0
    state.coupling[:] = 0.0  # the phase velocity is 0, and the goal absorbs what the predecessor's was
    state.turned[0] = state.orientation[0, 0]
    remaining = state.remaining[0]
    for d in range(3):
        x, xd, xdd = state.path[0, 0, 0, d], state.path[1, 0, 0, d], state.path[2, 0, 0, d]
        goal = plan.position_goal[primitive, d]
        state.point[0, 0, d] = x - goal
        state.point[1, 0, d] = tau * xd
        first_goal = transformation.compiled_initial_goal(x, xd, xdd, tau, plan.position_forcing[row, d])
        state.point[2, 0, d] = first_goal - goal
        w, wd = state.turning[0, 0, 0, d], state.turning[1, 0, 0, d]
        state.rate[0, d] = tau * w
        forcing = plan.orientation_forcing[row, d]
        remaining[d] = transformation.compiled_initial_goal(0.0, w, wd, tau, forcing)
    evolving_goal = orientation.turned(state.orientation[0, 0], remaining)
    remaining[:] = orientation.difference(evolving_goal, plan.orientation_goal[primitive])


@numba.njit(cache=True)
def tick(plan_arrays: tuple, state_arrays: tuple, fresh: bool) -> int:
    """Write the sample that is due into the outputs and step to the next one; return the flags.

    `plan_arrays`: a `Plan` as plain tuple (numba looks that up faster). `state_arrays`: a `State` as plain
    tuple. `fresh`: whether `sample` holds a new sensor sample.
    """
    plan, state = Plan(*plan_arrays), State(*state_arrays)
    flags = _receive(plan, state, fresh)
    flags |= _sample(plan, state, flags)
    primitive = state.clock[PRIMITIVE]
    following = primitive + 1
    if state.clock[ROW] == plan.rows[following] and following < len(plan.tau):  # it was the last sample
        begin(plan_arrays, state_arrays, following)
        flags |= _sample(plan, state, flags)
    state.clock[TICK] += 1
    return flags


@_part_of_a_tick
def _receive(plan: Plan, state: State, fresh: bool) -> int:
    """Take a sensor sample if there is a good one, and say what is wrong with the sensor."""
    channels, clock, flags = len(state.sample), state.clock, 0
    if channels == 0:
        return flags
    in_time = clock[TICK] <= plan.ages[0]
    for_offset = in_time and clock[SAMPLE_COUNT] < OFFSET_SAMPLES
    if fresh:
        good = True
        for i in range(channels):
            good &= np.isfinite(state.sample[i])
        if good:
            clock[SAMPLE_TICK] = clock[TICK]
            clock[SAMPLE_COUNT] += for_offset
            for i in range(channels):
                state.good[i] = state.sample[i]
                if for_offset:
                    state.zero[i] += state.sample[i] / OFFSET_SAMPLES
        else:
            flags |= REJECTED
    if clock[SAMPLE_COUNT] < OFFSET_SAMPLES:
        flags |= WAITING if in_time else NO_OFFSET
    if clock[TICK] - clock[SAMPLE_TICK] > plan.ages[1]:
        flags |= STALE
    return flags


@_part_of_a_tick
def _sample(plan: Plan, state: State, sensor_flags: int) -> int:
    """Outputs of the row that is due, and the step to the next."""
    row, primitive = state.clock[ROW], state.clock[PRIMITIVE]
    last = primitive == len(plan.tau) - 1
    following = min(row + 1, plan.rows[primitive + 1] - 1)
    for i in range(len(state.sample)):
        state.deviation[i] = state.good[i] - state.zero[i] - plan.expected[row, i]
    if sensor_flags & (WAITING | NO_OFFSET):
        state.deviation[:] = np.nan
    flags = 0
    for place in range(len(plan.axes)):
        wanted = _coupling(plan, state, row, primitive, place, sensor_flags)
        axis = plan.axes[place]
        state.held[axis // 3, 0, axis % 3], fault = _bounded(plan, state, place, wanted)
        flags |= fault
    matrix, tau = plan.matrix[primitive], plan.tau[primitive]
    goal, turned_goal = plan.position_goal[primitive], plan.orientation_goal[primitive]
    forcing = plan.position_forcing[row : following + 1].reshape(1, -1, 3)
    turning = plan.orientation_forcing[row : following + 1].reshape(1, -1, 3)
    transformation.step_batch(
        0, matrix, tau, goal.reshape(1, 3), state.point, forcing, state.held[0], state.path
    )
    turn = (state.turned, state.rate, state.remaining)
    orientation.step_batch(
        0, matrix, *turn, turning, turned_goal.reshape(1, 4), state.held[1], state.orientation, state.turning
    )
    for d in range(3):
        state.turning[0, 0, 0, d] /= tau
        state.turning[1, 0, 0, d] /= tau**2
    state.clock[ROW] = following if last else row + 1
    return flags


@_part_of_a_tick
def _coupling(plan: Plan, state: State, row: int, primitive: int, place: int, sensor_flags: int) -> float:
    """Output of the network of an axis; 0 without network or without a sensor that it needs."""
    kernel = plan.kernels[primitive, place]
    blind = sensor_flags & (WAITING | NO_OFFSET | STALE)
    if kernel == 0 or (plan.inputs[primitive, place] > 0 and blind):
        return 0.0
    sizes, values = plan.sizes[primitive, place], plan.values[primitive, place]
    return evaluate(kernel, sizes, values, plan.table[row, place], state.deviation, state.memory[place])


@_part_of_a_tick
def _bounded(plan: Plan, state: State, place: int, wanted: float) -> tuple[float, int]:
    """A coupling term within its bounds in size and in change per tick, which is kept as the state's."""
    largest, largest_change = plan.limits[0, place], plan.limits[1, place]
    flags = 0
    if not np.isfinite(wanted):  # counts so large that the standardised input overflows
        wanted, flags = 0.0, REJECTED
    if abs(wanted) > largest:
        wanted, flags = np.copysign(largest, wanted), flags | SATURATED
    change = wanted - state.coupling[place]
    if abs(change) > largest_change:
        wanted = state.coupling[place] + np.copysign(largest_change, change)
        flags |= RATE_LIMITED
    state.coupling[place] = wanted
    return wanted, flags
