"""Executions of rivals in the testbed, by the controller and at the limits that our skill has there.

A rival leads the hand by the reference that operational-space control follows, as the primitives do; force
control along z comes on at the time at which their second one starts. It decides every some readings of the
fingers; until the next decision the reference is a cubic from its pose and velocity to those decided. Its
speed and turning rate are bounded by `SPEED_MARGIN` times the largest demonstrated ones, its position by the
demonstrations' box with a margin, as a skill's workspace.

Ticks run one by one in the compiled loop (`Engine`), so a knock can act on the hand, of any method.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from dissertation.rivals.imitation_data import Episode, Frame, Situation, expected_over_run, frame_of, moved
from dissertation.rivals.policies import Ensemble, Policy
from dissertation.scraping.protocol.executions import HOLD_S, Bench, Run, execute_run
from dissertation.scraping.world import operational_space, scraping_robot, scraping_world
from dissertation.scraping.world.execution import FINGER_TICKS, Advance, Engine, Reference, execute
from dissertation.scraping.world.scraping_world import World
from dissertation.scraping.world.testbed import recorded_run, run_conditions
from dissertation.simulation.fingers import CHANNELS, FingerPair, take
from structlearn.core import quaternion
from structlearn.feedback.skill import TARGET_MARGIN, ReactiveSkill
from structlearn.primitives.vector import OFFSET_SAMPLES
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration

SPEED_MARGIN = TARGET_MARGIN  # as a coupling term's bound exceeds demonstrated ones


@dataclass(frozen=True)
class Knock:
    """A force on the hand for a while."""

    start_s: float
    end_s: float
    force_n: np.ndarray  # (3,) base frame


@dataclass(frozen=True)
class MotionLimits:
    """Bounds of a rival's reference."""

    speed: float  # m/s
    turning: float  # rad/s
    low: np.ndarray  # (3,) m, relative to the goal
    high: np.ndarray  # (3,) m

    def bounded(self, pose: np.ndarray, before: np.ndarray, seconds: float) -> np.ndarray:
        """Pose (6,) that is reached from the one before in this time."""
        step = np.concatenate([np.clip(pose[:3], self.low, self.high), pose[3:]]) - before
        for part, most in ((step[:3], self.speed), (step[3:], self.turning)):
            size = np.linalg.norm(part)
            part *= min(1.0, most * seconds / size) if size > 0.0 else 1.0
        return before + step


def demonstrated_motion(episodes: Sequence[Episode], rate_hz: float, margin_m: float) -> MotionLimits:
    """Limits from demonstrations at a rate."""
    steps = np.concatenate([rate_hz * np.diff(one.pose[::5], axis=0) / 5.0 for one in episodes])
    points = np.concatenate([one.pose[:, :3] for one in episodes])
    speed, turning = (SPEED_MARGIN * np.linalg.norm(part, axis=1).max() for part in np.hsplit(steps, 2))
    return MotionLimits(speed, turning, points.min(axis=0) - margin_m, points.max(axis=0) + margin_m)


def execute_policy(
    run: Run,
    policy: Policy,
    limits: MotionLimits,
    bench: Bench,
    situation: Situation,
    knock: Knock | None = None,
) -> Demonstration:
    """One execution of a rival; conditions are those of `execute_skill` with an equal run.

    Raises FloatingPointError: the robot has diverged, or the rival has put out a number that is not finite.
    """
    testbed, skill = bench.testbed, moved(bench.skill, situation)
    own, dt = testbed.control, testbed.world.dt
    conditions_rng, fingers_rng, wrist_rng, clocks_rng, _ = map(  # as `executions.execute_run`
        np.random.default_rng, np.random.SeedSequence([testbed.seed, *run.seed]).spawn(5)
    )
    edges = np.cumsum([0.0, *(one.duration for one in skill.primitives)])
    ticks = round((edges[-1] + HOLD_S) / dt)
    force, gains = np.full(ticks, own.force_n), (own.force_p_m_n, own.force_i_m_n_s)
    tilt = np.radians(run.setting_deg)
    conditions = run_conditions(testbed, tilt, conditions_rng, own.stiffness, force, gains)
    seen = FingerPair(testbed.touch, testbed.sensor_seed, _copied(fingers_rng), testbed.finger_rate_hz)
    fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, testbed.finger_rate_hz)
    leader = Leader(policy, limits, skill, seen, ticks, dt)
    start = leader.frame.start, quaternion.matrix(leader.frame.start_orientation)
    engine = engine_with(knock, dt, start, leader.advanced)
    log = execute(
        testbed.world, leader.reference, start, ticks, conditions, own, fingers, wrist_rng, None, engine
    )
    segments = np.column_stack([edges[:-1], edges[1:]])
    what = {"seed": " ".join(map(str, run.seed)), "what": f"execution, {policy.parameters.network}"}
    recording = recorded_run(testbed, run.name, 0, log, segments, clocks_rng, what)
    return synchronise(recording, bench.clock.rate_hz, bench.clock.max_gap_s)


def execute_skill(
    run: Run, skill: ReactiveSkill, bench: Bench, situation: Situation, knock: Knock | None = None
) -> Demonstration:
    """One execution of the primitives, with feedback if the run says so. Raises FloatingPointError."""
    there = moved(skill, situation)
    frame, dt = frame_of(there), bench.testbed.world.dt
    start = frame.start, quaternion.matrix(frame.start_orientation)
    engine = None if knock is None else engine_with(knock, dt, start)
    recording = execute_run(run, 0, there, bench.testbed, engine)
    return synchronise(recording, bench.clock.rate_hz, bench.clock.max_gap_s)


def engine_with(
    knock: Knock | None,
    dt: float,
    start: tuple[np.ndarray, np.ndarray],
    sense: Callable[[int, World, operational_space.ArmModel], None] = lambda tick, world, arm: None,
) -> Engine:
    """Engine that lets `sense` see each tick's world before it moves on, and knocks on the hand."""

    @contextmanager
    def engine(world: World) -> Iterator[Advance]:
        tick = 0
        arm = operational_space.controlled(scraping_robot.arm(), scraping_robot.joint_angles(*start))

        def advance(torques: np.ndarray) -> None:
            nonlocal tick
            operational_space.observe(arm, world.q, world.v)
            sense(tick, world, arm)
            if knock is not None and knock.start_s <= dt * tick < knock.end_s:
                torques = torques + arm.jacobian[:3].T @ knock.force_n
            scraping_world.advance(world, torques)
            tick += 1

        yield advance

    return engine


class Leader:
    """Writes a rival's reference between the ticks of a run, from what it senses."""

    def __init__(
        self,
        policy: Policy,
        limits: MotionLimits,
        skill: ReactiveSkill,
        fingers: FingerPair,
        ticks: int,
        dt: float,
    ) -> None:
        """Before a run. `skill`: has its start, goal, durations and expected traces; `fingers`: its own."""
        self.policy, self.limits, self.dt = policy, limits, dt
        self.frame: Frame = frame_of(skill)
        self.duration = sum(one.duration for one in skill.primitives)
        self.expected = expected_over_run(skill, ticks, dt)
        self.readings, self.counts = fingers.readings(len(range(0, ticks, FINGER_TICKS))), np.empty(CHANNELS)
        self.first: list[np.ndarray] = []  # readings that make the offset
        self.ensemble = Ensemble(policy.parameters.ensemble)
        self.goal_rotation, self.turned = quaternion.matrix(self.frame.orientation), np.empty(3)
        starts = np.cumsum([one.duration for one in skill.primitives])[:-1]
        primitive = np.searchsorted(np.round(starts / dt), np.arange(ticks), side="right")
        still = np.zeros((ticks, 3))
        self.pose = self.frame.relative(self.frame.start, self.frame.start_orientation)
        self.velocity = np.zeros(6)
        position, orientation = self.frame.absolute(np.tile(self.pose, (ticks, 1)))
        self.reference = Reference(
            position, still, still.copy(), orientation, still.copy(), still.copy(), primitive
        )
        policy.start()

    def advanced(self, tick: int, world: World, arm: operational_space.ArmModel) -> None:
        """Sense at a tick, and write the ticks until the next decision, if one is due."""
        if tick % FINGER_TICKS:
            return
        number = tick // FINGER_TICKS
        load, (yaw, pitch, roll) = world.grasp_load, world.q[-3:]
        take(
            self.readings, number, np.array([*load, pitch, roll, yaw]), self.counts
        )  # as the loop reads them
        if len(self.first) < OFFSET_SAMPLES:
            self.first.append(self.counts.copy())
        if number % self.policy.parameters.every == 0:
            self._decide(tick, arm)

    def _decide(self, tick: int, arm: operational_space.ArmModel) -> None:
        touch = self.counts - np.mean(self.first, axis=0)
        if self.policy.parameters.sensors == "deviation":
            touch = touch - self.expected[tick]
        operational_space.write_rotation_error(arm.rotation, self.goal_rotation, self.turned)
        pose = np.concatenate([arm.position - self.frame.goal, self.turned])
        task = self.frame.task(np.array(min(tick * self.dt / self.duration, 1.0)))
        decided = self.ensemble.update(self.policy.chunk(pose, task, touch))
        if not np.isfinite(decided).all():
            raise FloatingPointError("a rival has put out a number that is not finite")
        count = FINGER_TICKS * self.policy.parameters.every
        seconds = count * self.dt
        before, velocity = self.pose, self.velocity
        self.pose = self.limits.bounded(decided, before, seconds)
        self.velocity = (self.pose - before) / seconds
        rows = slice(tick + 1, tick + 1 + count)
        path, rates, changes = cubic(before, velocity, self.pose, self.velocity, count, seconds)
        written = len(self.reference.position[rows])
        its = self.reference
        its.position[rows], its.orientation[rows] = self.frame.absolute(path[:written])
        its.velocity[rows], its.angular_velocity[rows] = np.hsplit(rates[:written], 2)
        its.acceleration[rows], its.angular_acceleration[rows] = np.hsplit(changes[:written], 2)


def cubic(
    x0: np.ndarray, v0: np.ndarray, x1: np.ndarray, v1: np.ndarray, count: int, seconds: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Path, velocity and acceleration (count, D) of a cubic between states (D,), in equal parts of a time."""
    s = (np.arange(1, count + 1) / count)[:, None]
    a, b = v0 * seconds, v1 * seconds
    way = x1 - x0
    second, third = 3.0 * way - 2.0 * a - b, a + b - 2.0 * way
    path = x0 + s * (a + s * (second + s * third))
    rates = (a + s * (2.0 * second + 3.0 * s * third)) / seconds
    return path, rates, (2.0 * second + 6.0 * s * third) / seconds**2


def _copied(rng: np.random.Generator) -> np.random.Generator:
    """A generator that draws the same numbers."""
    copy = np.random.Generator(type(rng.bit_generator)())
    copy.bit_generator.state = rng.bit_generator.state
    return copy
