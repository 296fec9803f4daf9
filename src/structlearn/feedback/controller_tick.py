"""One tick of the controller, compiled: sensor bookkeeping, feedback, and one exact step of the pose.

The integration steps are those of `primitives.transformation` and `primitives.orientation`. This module adds
what a run needs: which row of the plan is due, the age of the sensor's sample, and bounds on the coupling
term.
"""

from typing import NamedTuple

import numpy as np

from structlearn.core.compilation import call, numba
from structlearn.core.packed_arrays import packed, unpacking
from structlearn.primitives import orientation, transformation
from structlearn.primitives.vector import OFFSET_SAMPLES

REJECTED, WAITING, NO_OFFSET, STALE, SATURATED, RATE_LIMITED = (1 << bit for bit in range(6))

ROW, PRIMITIVE, TICK, SAMPLE_TICK, SAMPLE_COUNT = range(5)
"""Indices in the clock: due row of the plan, due primitive, number of this tick, tick of the last valid
sensor sample, and number of valid samples in the offset."""


_part_of_a_tick = numba.njit(cache=True, forceinline=True)
"""Inlines a function: passing a plan and a state costs more than many of these functions."""


class Plan(NamedTuple):
    """Time tables of a run; R rows, one per sample of each primitive, two at a switch."""

    rows: np.ndarray  # (P + 1,) first row of each primitive
    matrix: np.ndarray  # (P, 3, 5) `transformation.step_matrix`
    tau: np.ndarray  # (P,) time constants in s
    position_goal: np.ndarray  # (P, N) m, or of joints; N = 3 of a pose
    orientation_goal: np.ndarray  # (P, 4)
    position_forcing: np.ndarray  # (R, N) in the base frame
    orientation_forcing: np.ndarray  # (R, 3)
    outputs: np.ndarray  # (R, K) continuous outputs, then digital ones
    expected: np.ndarray  # (R, E) expected sensor traces; NaN where a primitive has none
    axes: np.ndarray  # (D,) indices in `coupling.AXES` of the coupling's axes
    kernels: np.ndarray  # (P, D) addresses of the networks' kernels, 0 without a network
    inputs: np.ndarray  # (P, D) number of channels they take
    sizes: np.ndarray  # (P, D, S), see `coupling_model.Compiled`
    values: np.ndarray  # (P, D, V), likewise
    memory: np.ndarray  # (P, D) number of values they remember
    time_features: np.ndarray  # (R, D, K) `CouplingModel.time_features`
    limits: np.ndarray  # (2, D) bounds of the coupling, and of its change per tick
    timeouts: np.ndarray  # (2,) ticks until the offset must be known, and until a sample is stale


class State(NamedTuple):
    """State of a run, updated by every tick."""

    clock: np.ndarray  # (5,) see `ROW`
    point: np.ndarray  # (3, 1, N) x - G, tau xd, g - G at the due row
    turned: np.ndarray  # (1, 4) orientation at the due row
    rate: np.ndarray  # (1, 3) tau w
    remaining: np.ndarray  # (1, 3) rotation vector from the steady to the evolving goal
    coupling: np.ndarray  # (D,) c on each axis
    sample: np.ndarray  # (E,) newest sensor sample
    last_valid: np.ndarray  # (E,) newest valid sensor sample
    sensor_offset: np.ndarray  # (E,) mean of the first samples of the run, complete after `OFFSET_SAMPLES`
    deviation: np.ndarray  # (E,) last_valid - sensor_offset - expected
    path: np.ndarray  # (3, 1, 1, N) output: position, velocity, acceleration
    orientation: np.ndarray  # (1, 1, 4) output
    turning: np.ndarray  # (2, 1, 1, 3) output: angular velocity, angular acceleration
    outputs: np.ndarray  # (K,) output: those of the due row
    coupling_vector: np.ndarray  # (2, 1, N or 3) c of position and orientation; 0 except on the axes
    memory: np.ndarray  # (D, M) memory of the networks


def resting_state(plan: Plan) -> State:
    """Preallocated state for runs of a plan."""
    channels, width = plan.expected.shape[1], plan.position_goal.shape[1]
    turned = np.array([[1.0, 0.0, 0.0, 0.0]])
    return State(
        clock=np.zeros(5, dtype=np.int64),
        point=np.zeros((3, 1, width)),
        turned=turned,
        rate=np.zeros((1, 3)),
        remaining=np.zeros((1, 3)),
        coupling=np.zeros(len(plan.axes)),
        sample=np.full(channels, np.nan),
        last_valid=np.zeros(channels),
        sensor_offset=np.zeros(channels),
        deviation=np.full(channels, np.nan),
        path=np.zeros((3, 1, 1, width)),
        orientation=turned[None].copy(),
        turning=np.zeros((2, 1, 1, 3)),
        outputs=np.zeros(plan.outputs.shape[1]),
        coupling_vector=np.zeros((2, 1, max(width, 3))),
        memory=np.zeros((len(plan.axes), plan.memory.max(initial=0))),
    )


def _no_primitives() -> tuple[Plan, State]:
    """Plan and state of a run without primitives."""
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(Plan._fields, (0, 0))
    shapes |= {"rows": (1,), "tau": (0,), "axes": (0,), "timeouts": (2,)}
    shapes |= {"matrix": (0, 3, 5), "position_goal": (0, 3), "orientation_goal": (0, 4), "limits": (2, 0)}
    shapes |= {"position_forcing": (0, 3), "orientation_forcing": (0, 3)}
    shapes |= dict.fromkeys(("sizes", "values", "time_features"), (0, 0, 0))
    integers = {"rows", "axes", "kernels", "inputs", "sizes", "memory", "timeouts"}
    plan = Plan(
        **{name: np.zeros(shapes[name], np.int64 if name in integers else float) for name in Plan._fields}
    )
    return plan, resting_state(plan)


_NOTHING = _no_primitives()
plan_and_state = unpacking(_NOTHING)
"""`Plan` and `State` of a table, in compiled functions."""


def table(plan: Plan, state: State) -> np.ndarray:
    """A plan and its state as one argument of `begin` and `tick`; see `core.packed_arrays`.

    Raises TypeError: an array has another type or number of dimensions than `Plan` and `State` say.
    """
    return packed((plan, state), _NOTHING)


NO_PLAN = table(*_NOTHING)
"""Table without primitives, for compiled loops that may run without a skill."""


@numba.njit(cache=True)
def begin(run: np.ndarray, primitive: int) -> None:
    """Start a primitive of a run (`table`) in the current output state (eq. IV.12-14)."""
    plan, state = plan_and_state(run)
    row, tau = plan.rows[primitive], plan.tau[primitive]
    state.clock[ROW], state.clock[PRIMITIVE] = row, primitive
    state.memory[:] = 0.0
    state.coupling[:] = 0.0  # the phase velocity is 0, and the goal absorbs the predecessor's coupling
    state.turned[0] = state.orientation[0, 0]
    remaining = state.remaining[0]
    for d in range(state.path.shape[3]):
        x, xd, xdd = state.path[0, 0, 0, d], state.path[1, 0, 0, d], state.path[2, 0, 0, d]
        goal = plan.position_goal[primitive, d]
        state.point[0, 0, d] = x - goal
        state.point[1, 0, d] = tau * xd
        first_goal = transformation.compiled_initial_goal(x, xd, xdd, tau, plan.position_forcing[row, d])
        state.point[2, 0, d] = first_goal - goal
    for d in range(3):
        w, wd = state.turning[0, 0, 0, d], state.turning[1, 0, 0, d]
        state.rate[0, d] = tau * w
        forcing = plan.orientation_forcing[row, d]
        remaining[d] = transformation.compiled_initial_goal(0.0, w, wd, tau, forcing)
    evolving_goal = orientation.turned(state.orientation[0, 0], remaining)
    remaining[:] = orientation.compiled_difference(evolving_goal, plan.orientation_goal[primitive])


@numba.njit(cache=True)
def tick(run: np.ndarray, fresh: bool) -> int:
    """Write the due sample to the outputs and step to the next one; return the status flags.

    `run`: of `table`. `fresh`: whether `sample` holds a new sensor sample.
    """
    plan, state = plan_and_state(run)
    flags = _receive(plan, state, fresh)
    flags |= _sample(plan, state, flags)
    primitive = state.clock[PRIMITIVE]
    following = primitive + 1
    if state.clock[ROW] == plan.rows[following] and following < len(plan.tau):  # the primitive has ended
        begin(run, following)
        flags |= _sample(plan, state, flags)
    state.clock[TICK] += 1
    return flags


@_part_of_a_tick
def _receive(plan: Plan, state: State, fresh: bool) -> int:
    """Take over a valid sensor sample, and return flags for the sensor's problems."""
    channels, clock, flags = len(state.sample), state.clock, 0
    if channels == 0:
        return flags
    in_time = clock[TICK] <= plan.timeouts[0]
    for_offset = in_time and clock[SAMPLE_COUNT] < OFFSET_SAMPLES
    if fresh:
        valid = True
        for i in range(channels):
            valid &= np.isfinite(state.sample[i])
        if valid:
            clock[SAMPLE_TICK] = clock[TICK]
            clock[SAMPLE_COUNT] += for_offset
            for i in range(channels):
                state.last_valid[i] = state.sample[i]
                if for_offset:
                    state.sensor_offset[i] += state.sample[i] / OFFSET_SAMPLES
        else:
            flags |= REJECTED
    if clock[SAMPLE_COUNT] < OFFSET_SAMPLES:
        flags |= WAITING if in_time else NO_OFFSET
    if clock[TICK] - clock[SAMPLE_TICK] > plan.timeouts[1]:
        flags |= STALE
    return flags


@_part_of_a_tick
def _sample(plan: Plan, state: State, sensor_flags: int) -> int:
    """Outputs of the due row, and the step to the next row."""
    row, primitive = state.clock[ROW], state.clock[PRIMITIVE]
    last = primitive == len(plan.tau) - 1
    following = min(row + 1, plan.rows[primitive + 1] - 1)
    for i in range(len(state.sample)):
        state.deviation[i] = state.last_valid[i] - state.sensor_offset[i] - plan.expected[row, i]
    if sensor_flags & (WAITING | NO_OFFSET):
        state.deviation[:] = np.nan
    for k in range(len(state.outputs)):
        state.outputs[k] = plan.outputs[row, k]
    flags = 0
    for place in range(len(plan.axes)):
        wanted = _coupling(plan, state, row, primitive, place, sensor_flags)
        axis = plan.axes[place]
        state.coupling_vector[axis // 3, 0, axis % 3], fault = _bounded(plan, state, place, wanted)
        flags |= fault
    matrix, tau = plan.matrix[primitive], plan.tau[primitive]
    goal, turned_goal = plan.position_goal[primitive], plan.orientation_goal[primitive]
    width = len(goal)
    forcing = plan.position_forcing[row : following + 1].reshape(1, -1, width)
    turning = plan.orientation_forcing[row : following + 1].reshape(1, -1, 3)
    transformation.step_batch(
        0, matrix, tau, goal.reshape(1, width), state.point, forcing, state.coupling_vector[0], state.path
    )
    turn = (state.turned, state.rate, state.remaining)
    orientation.step_batch(
        0,
        matrix,
        *turn,
        turning,
        turned_goal.reshape(1, 4),
        state.coupling_vector[1],
        state.orientation,
        state.turning,
    )
    for d in range(3):
        state.turning[0, 0, 0, d] /= tau
        state.turning[1, 0, 0, d] /= tau**2
    state.clock[ROW] = following if last else row + 1
    return flags


@_part_of_a_tick
def _coupling(plan: Plan, state: State, row: int, primitive: int, place: int, sensor_flags: int) -> float:
    """Output of an axis's network; 0 without a network or without a sensor that it needs."""
    kernel = plan.kernels[primitive, place]
    blind = sensor_flags & (WAITING | NO_OFFSET | STALE)
    if kernel == 0 or (plan.inputs[primitive, place] > 0 and blind):
        return 0.0
    sizes, values = plan.sizes[primitive, place], plan.values[primitive, place]
    return call(kernel, sizes, values, plan.time_features[row, place], state.deviation, state.memory[place])


@_part_of_a_tick
def _bounded(plan: Plan, state: State, place: int, wanted: float) -> tuple[float, int]:
    """Coupling term limited in magnitude and in change per tick; also stored in the state."""
    largest, largest_change = plan.limits[0, place], plan.limits[1, place]
    flags = 0
    if not np.isfinite(wanted):  # counts so large that the standardised inputs overflow
        wanted, flags = 0.0, REJECTED
    if abs(wanted) > largest:
        wanted, flags = np.copysign(largest, wanted), flags | SATURATED
    change = wanted - state.coupling[place]
    if abs(change) > largest_change:
        wanted = state.coupling[place] + np.copysign(largest_change, change)
        flags |= RATE_LIMITED
    state.coupling[place] = wanted
    return wanted, flags
