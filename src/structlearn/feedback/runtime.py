"""Runtime controller of a skill: primitives with feedback, one compiled call per tick.

    controller = Controller(read_skill("skill.safetensors"), rate_hz=1000)
    controller.start(position, orientation)
    while not controller.finished:
        flags = controller.tick(new_sensor_sample_or_None)
        robot.follow(controller.position, controller.orientation, ...)

Everything that depends on time only is computed before the first tick. A tick takes the sensor's newest
sample, evaluates the networks and steps the pose exactly, at any rate. Whatever the sensor does, coupling
terms are bounded in magnitude and rate of change and fade with the phase, so the goal is reached.
`benchmarks/controller.py` measures the duration of ticks, and what long ticks waited for.
"""

from collections.abc import Sequence
from enum import IntFlag
from typing import Any

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback import controller_tick, run_tables
from structlearn.feedback.skill import ReactiveSkill, real_numbers
from structlearn.primitives import canonical, rhythmic
from structlearn.primitives.sequence import PoseGoal
from structlearn.primitives.transformation import ALPHA, BETA
from structlearn.primitives.vector import sample_count


class Status(IntFlag):
    """Status flags of a tick; 0 if there is nothing to report."""

    # the sample has a value that is not finite, or the network overflowed on it
    REJECTED = controller_tick.REJECTED
    WAITING = controller_tick.WAITING  # no feedback yet: the offset of the run is not known
    NO_OFFSET = controller_tick.NO_OFFSET  # no feedback in this run: the offset was not known in time
    # the newest good sample is too old; the coupling terms fade until there is a new one
    STALE = controller_tick.STALE
    SATURATED = controller_tick.SATURATED  # a coupling term is at its bound
    RATE_LIMITED = controller_tick.RATE_LIMITED  # a coupling term changes at its largest rate


class Controller:
    """Controller of a skill, for any number of runs. Copies, also pickled ones, continue on their own.

    Outputs, valid after `start` and after each tick, are read-only views of the state: the arrays stay the
    same for the controller's lifetime and are overwritten by the next tick.

    Attributes:
        position: (3,) m; of a skill that commands joints (J,), in its `joints`' order, like the next two.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
        orientation: (4,) unit quaternion.
        angular_velocity: (3,) rad/s, base frame.
        angular_acceleration: (3,) rad/s^2, base frame.
        outputs: (K,) what the skill commands beside: its `outputs`, then its `digital` ones, 1 if on.
        deviation: (E,) newest good sample - offset - expected; NaN where one of them is unknown.
        coupling: (D,) coupling terms c on the skill's axes, m or rad.
    """

    def __init__(
        self,
        skill: ReactiveSkill,
        rate_hz: float,
        durations: Sequence[float] | None = None,
        goals: Sequence[PoseGoal] | None = None,
        feedback: bool = True,
    ) -> None:
        """Plan all runs.

        `durations` (s), `goals`: one per primitive; default: the demonstrations' means. `feedback`: False
        keeps the coupling terms at 0; deviations are still reported. Raises InputError: the rate, a duration
        or a goal is invalid, or a goal is outside the skill's workspace.
        """
        self.skill, self.rate_hz = skill, run_tables.checked_rate(rate_hz)
        self._dt = 1.0 / self.rate_hz
        durations = run_tables.checked_durations(skill, durations, self._dt)
        checked = run_tables.checked_goals(skill, goals)
        self._planned = skill, self.rate_hz, durations, checked, feedback
        self._plan = run_tables.plan_in_time(skill, self.rate_hz, durations, checked, feedback)
        self._goals = self._plan.position_goal.copy(), self._plan.orientation_goal.copy()
        self._last_tick = sum(sample_count(duration, self._dt) - 1 for duration in durations)
        self._state = controller_tick.resting_state(self._plan)
        self._run = controller_tick.table(self._plan, self._state)  # their arrays are never replaced
        self._sample, self._clock = self._state.sample, self._state.clock
        self._sample_rule = f"a sensor sample has {len(self._sample)} numbers"
        self._started, self._skipped = False, 0
        self._via: dict[int, np.ndarray] = {}  # of this run, by row
        self.position, self.velocity, self.acceleration = map(_read_only, self._state.path[:, 0, 0])
        self.angular_velocity, self.angular_acceleration = map(_read_only, self._state.turning[:, 0, 0])
        self.orientation = _read_only(self._state.orientation[0, 0])
        self.outputs = _read_only(self._state.outputs)
        self.deviation, self.coupling = _read_only(self._state.deviation), _read_only(self._state.coupling)

    def __getstate__(self) -> tuple[tuple[Any, ...], list[np.ndarray], bool, int, dict[int, np.ndarray]]:
        """Enough to plan and continue the run elsewhere: addresses of compiled functions hold here only."""
        return self._planned, self._arrays(), self._started, self._skipped, self._via

    def __setstate__(
        self, kept: tuple[tuple[Any, ...], list[np.ndarray], bool, int, dict[int, np.ndarray]]
    ) -> None:
        """Continue a run; copies and unpickled controllers are independent of the original."""
        planned, arrays, started, skipped, via = kept
        Controller.__init__(self, *planned)
        for own, array in zip(self._arrays(), arrays, strict=True):
            own[:] = array
        self._started, self._skipped, self._via = started, skipped, dict(via)

    def _arrays(self) -> list[np.ndarray]:
        """Everything that does not follow from the arguments of the constructor alone, to the last bit."""
        plan = self._plan
        return [plan.position_forcing, plan.position_goal, plan.orientation_goal, *self._goals, *self._state]

    def start(self, position: np.ndarray, orientation: np.ndarray | None = None) -> None:
        """Begin a run at rest, to the controller's goals; also compiles the functions that ticks call.

        `position`: (3,) m, or (J,) of joints. `orientation`: (4,) unit quaternion (w, x, y, z); may be
        omitted if no primitive has orientations. Raises InputError: the pose is not finite, outside the
        skill's workspace, far from the demonstrated orientation or no unit quaternion, or a reach has no
        direction.
        """
        plan, state = self._plan, self._state
        position = run_tables.checked_point(self.skill, position, "the position at the start")
        turned = self.skill.primitives[0].orientation is not None
        if turned or orientation is not None:
            orientation = run_tables.checked_start_orientation(self.skill, orientation)
        else:
            orientation = quaternion.IDENTITY
        at_rest = (position, np.zeros_like(position), np.zeros_like(position))
        goals, turned_goals = self._goals
        forcing = run_tables.forcing_in_base_frame(
            self.skill, plan, self._dt, plan.position_forcing, 0, at_rest, goals, {}
        )
        plan.position_forcing[:] = forcing  # the first change of state: nothing below can fail
        plan.position_goal[:] = goals
        plan.orientation_goal[:] = turned_goals if turned else orientation
        for array in (
            state.clock,
            state.path,
            state.turning,
            state.sensor_offset,
            state.last_valid,
            state.coupling,
        ):
            array[:] = 0
        state.path[0, 0, 0] = position
        state.orientation[0, 0] = orientation
        controller_tick.begin(self._run, 0)
        before = {name: array.copy() for name, array in state._asdict().items()}
        controller_tick.tick(self._run, False)
        # all but what a tick shows
        for name in before.keys() - {"path", "turning", "orientation", "outputs", "deviation"}:
            getattr(state, name)[:] = before[name]
        self._started, self._skipped, self._via = True, 0, {}

    def tick(self, counts: np.ndarray | None) -> int:
        """Advance to the next sample of the run; the first tick outputs the start itself.

        `counts`: (E,) the sensor's newest sample, if there is one since the last tick, else None. A sample
        with NaN, or with a masked channel, is rejected. Ignored without expected traces (E = 0). Returns
        flags, see `Status`.

        Raises:
            InputError: counts have another size or are not real numbers; the state is unchanged.
            RuntimeError: the run has not been started.
        """
        if not self._started:
            raise RuntimeError("start() comes before the first tick()")
        fresh = False
        if counts is not None and len(self._sample) > 0:
            fresh = True
            self._sample[:] = real_numbers(counts, self._sample.shape, self._sample_rule)
        return controller_tick.tick(self._run, fresh)

    def move_goal(
        self, primitive: int | str, position: np.ndarray, orientation: np.ndarray | None = None
    ) -> None:
        """Move the goal of the running primitive or of a later one in this run; call between ticks.

        Position, velocity and acceleration stay continuous: the running primitive keeps its forcing term,
        later ones are replanned from where they will start. Takes some tenths of a ms.

        `position`: (3,) m, or (J,) of joints. `orientation`: (4,) unit quaternion; default: unchanged.

        Raises:
            InputError: no such primitive, it has ended, the goal is invalid or outside the workspace, or the
                way back to a via point is faster than the movement itself; the state is unchanged.
            RuntimeError: the run has not been started.
        """
        plan, state, index = self._plan, self._state, self._coming("move_goal()", primitive)
        name = self.skill.primitives[index].name
        position = run_tables.checked_point(self.skill, position, f"the goal of '{name}'")
        old, old_turned = plan.position_goal[index].copy(), plan.orientation_goal[index].copy()
        turned = old_turned
        if orientation is not None:
            turned = run_tables.checked_goal_orientation(self.skill, orientation, index)
        goals = plan.position_goal.copy()
        goals[index] = position
        plan.position_forcing[:] = self._replanned(goals, self._via)
        plan.position_goal[:] = goals
        plan.orientation_goal[index] = turned
        if index == self.primitive:
            state.point[0] += old - position  # both are relative to the steady goal
            state.point[2] += old - position
            evolving = quaternion.product(quaternion.from_rotation_vector(state.remaining[0]), old_turned)
            state.remaining[0] = quaternion.difference(evolving, turned)

    def add_via_point(self, primitive: int | str, phase: float, position: np.ndarray) -> None:
        """Pass a point at a phase of the running primitive or of a later one in this run.

        Call between ticks. Position, velocity and acceleration stay continuous, and the goal and what follows
        are as before (`primitives.via_points`). Without feedback the point is reached exactly, in the tick
        that is the first at or after the phase; coupling terms shift it. It holds for this run, also when
        goals are moved later.

        `phase`: as the property, 1 at the start and 0.014 at the end. `position`: (3,) m, or (J,) of joints.

        Raises:
            InputError: no such primitive, it has ended or is rhythmic, the phase is not ahead, the point is
                invalid or outside the workspace, or the detour is faster than the movement itself; the state
                is unchanged.
            RuntimeError: the run has not been started.
        """
        plan, index = self._plan, self._coming("add_via_point()", primitive)
        name = self.skill.primitives[index].name
        position = run_tables.checked_point(self.skill, position, f"the via point of '{name}'")
        phase = float(real_numbers(phase, (), f"the phase of the via point of '{name}' must be a number"))
        if self.skill.primitives[index].rhythm is not None:
            raise InputError(f"'{name}' is rhythmic: via points are for discrete primitives")
        rows = np.arange(*plan.rows[index : index + 2])
        passed = canonical.phase(self._dt * (rows - rows[0]), plan.tau[index])[0] <= phase
        row = rows[np.argmax(passed)]
        due = self._clock[controller_tick.ROW]
        if not (0.0 < phase < 1.0 and passed.any() and row > due):
            raise InputError(f"the via point of '{name}' is at phase {phase:g}, which is not ahead")
        if row - max(due, rows[0]) < run_tables.FEWEST_ROWS:
            raise InputError(
                f"the via point of '{name}' is less than {run_tables.FEWEST_ROWS} ticks from now, "
                "or from its start"
            )
        via = self._via | {int(row): position}
        plan.position_forcing[:] = self._replanned(plan.position_goal, via)
        self._via = via

    def _coming(self, call: str, primitive: int | str) -> int:
        """Index of a primitive that has not ended. Raises as `move_goal`."""
        if not self._started:
            raise RuntimeError(f"start() comes before {call}")
        index = self.skill.index(primitive)
        if index < self.primitive:
            raise InputError(f"'{self.skill.primitives[index].name}' has ended")
        return index

    def _replanned(self, goals: np.ndarray, via: run_tables.ViaPoints) -> np.ndarray:
        """Forcing term (R, 3) to goals (P, 3) and via points from the due sample on."""
        plan, (row, running) = self._plan, self._clock[[controller_tick.ROW, controller_tick.PRIMITIVE]]
        rest = slice(row, plan.rows[running + 1])
        forcing = plan.position_forcing.copy()
        forcing[rest], following = run_tables.through_via_points(
            self.skill, plan, self._dt, row, self._due_point(), goals[running], forcing[rest], via
        )
        return run_tables.forcing_in_base_frame(
            self.skill, plan, self._dt, forcing, running + 1, following, goals, via
        )

    def stop_strokes(self) -> int:
        """Leave out as many whole cycles of the running rhythmic primitive as possible; call between ticks.

        Its last cycles are kept, with which the hand comes to rest at the goal; in its first half cycle, call
        again later. Returns the number of cycles left out: 0 if none can be, or the primitive is discrete.

        Raises RuntimeError: the run has not been started.
        """
        if not self._started:
            raise RuntimeError("start() comes before stop_strokes()")
        row, running = self._clock[[controller_tick.ROW, controller_tick.PRIMITIVE]]
        rhythm, period = self.skill.primitives[running].rhythm, self._plan.tau[running] / self._dt
        if rhythm is None:
            return 0
        elapsed = (row - self._plan.rows[running]) / period
        cycles = int(np.floor(rhythm.cycles - elapsed - rhythmic.TRANSIENT))
        if elapsed < rhythmic.TRANSIENT or cycles < 1:
            return 0
        ticks = round(cycles * period)
        self._clock[controller_tick.ROW] += ticks
        self._skipped += ticks
        return cycles

    def _due_point(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity, acceleration of the due sample."""
        plan, (row, running) = self._plan, self._clock[[controller_tick.ROW, controller_tick.PRIMITIVE]]
        tau, (offset, rate, goal) = plan.tau[running], self._state.point[:, 0]
        force = ALPHA * (BETA * (goal - offset) - rate) + plan.position_forcing[row]
        return offset + plan.position_goal[running], rate / tau, force / tau**2

    @property
    def compiled(self) -> np.ndarray:
        """Plan and state in the form of `controller_tick.tick`, for loops that are compiled as a whole.

        It holds addresses: it is good for this process only, and as long as the controller exists.

        Raises RuntimeError: the run has not been started.
        """
        if not self._started:
            raise RuntimeError("start() comes before the first tick")
        return self._run

    @property
    def primitive(self) -> int:
        """Index of the running primitive; the sample of a switch belongs to the successor."""
        return int(self._clock[controller_tick.PRIMITIVE])

    @property
    def time(self) -> float:
        """Time of the outputs in s since the start."""
        return self._ticks_done / self.rate_hz

    @property
    def phase(self) -> float:
        """Phase p of the running primitive; of a rhythmic one, of its cycle."""
        rhythm, tau = self.skill.primitives[self.primitive].rhythm, self._plan.tau[self.primitive]
        elapsed = np.array(self._elapsed)
        if rhythm is not None:
            return float(rhythmic.phase(elapsed / tau, rhythm)[0])
        return float(canonical.phase(elapsed, tau)[0])

    @property
    def stiffness(self) -> np.ndarray | None:
        """Suggested stiffness (A,) of the running primitive, if the skill has one: N/m, then N m/rad.

        It is a suggestion for a robot's impedance controller, along and about the axes of the base.
        """
        profile = self.skill.stiffness.get(self.skill.primitives[self.primitive].name)
        if profile is None:
            return None
        times = np.linspace(0.0, self._planned[2][self.primitive], len(profile))
        return np.array([np.interp(self._elapsed, times, axis) for axis in profile.T])

    @property
    def finished(self) -> bool:
        """Whether the last primitive has ended; ticks may continue, and the pose settles at the goal."""
        return bool(self._ticks_done + self._skipped >= self._last_tick)

    @property
    def _elapsed(self) -> float:
        """Time of the outputs in s since the start of the running primitive."""
        switches = self._plan.rows[self.primitive] - self.primitive  # has two rows each, but is one sample
        return float(self._dt * (self._ticks_done + self._skipped - switches))

    @property
    def _ticks_done(self) -> int:
        """Ticks after the first one, which outputs the start."""
        return max(int(self._clock[controller_tick.TICK]) - 1, 0)


def _read_only(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
