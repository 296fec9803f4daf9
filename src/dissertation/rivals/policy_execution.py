"""Executions of rivals in the testbed, by the controller and at the limits that our skill has there.

A rival leads the hand by the reference that operational-space control follows, as the primitives do; force
control along z comes on at the time at which their second one starts. It decides every some readings of the
fingers; until the next decision the reference is a cubic from its pose and velocity to those decided, no
faster than `Policy.fastest`.
"""

from copy import deepcopy

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from dissertation.rivals.imitation_data import expected_over_run, frame_of
from dissertation.rivals.policies import Ensemble, Policy
from dissertation.rivals.situations import Situation, moved, tick_by_tick
from dissertation.scraping.protocol.executions import HOLD_S, Bench, Run
from dissertation.scraping.world import operational_space
from dissertation.scraping.world.execution import FINGER_TICKS, Reference, execute
from dissertation.scraping.world.operational_space import ArmModel
from dissertation.scraping.world.scraping_world import World
from dissertation.scraping.world.testbed import recorded_run, run_conditions
from dissertation.simulation.fingers import CHANNELS, FingerPair, take
from structlearn.core import quaternion
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.vector import OFFSET_SAMPLES
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration


def execute_policy(run: Run, policy: Policy, bench: Bench, situation: Situation) -> Demonstration:
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
    roll = np.radians(run.setting_deg)
    conditions = run_conditions(testbed, roll, conditions_rng, own.stiffness, force, gains)
    fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, testbed.finger_rate_hz)
    leader = Leader(policy, skill, deepcopy(fingers), ticks, dt)
    position, orientation = leader.frame.absolute(leader.frame.start)
    start = position, quaternion.matrix(orientation)
    engine = tick_by_tick(situation, dt, leader.lead)
    log = execute(
        testbed.world, leader.reference, start, ticks, conditions, own, fingers, wrist_rng, None, engine
    )
    segments = np.column_stack([edges[:-1], edges[1:]])
    what = {"seed": " ".join(map(str, run.seed)), "what": f"execution, {policy.parameters.network}"}
    recording = recorded_run(testbed, run.name, 0, log, segments, clocks_rng, what)
    return synchronise(recording, **bench.clock.model_dump())


class Leader:
    """Writes a rival's reference between the ticks of a run, from what it senses."""

    def __init__(
        self, policy: Policy, skill: ReactiveSkill, fingers: FingerPair, ticks: int, dt: float
    ) -> None:
        """Before a run of `ticks` ticks of `dt` s.

        `skill`: whose start, goal, durations and expected traces are given; `fingers`: equal to those of the
        run, and the leader's own.
        """
        self.policy, self.dt, self.frame = policy, dt, frame_of(skill)
        samples = len(range(0, ticks, FINGER_TICKS))
        self.readings, self.counts = fingers.readings(samples), np.empty((samples, CHANNELS))
        self.expected = expected_over_run(skill, ticks, dt)
        ends = np.cumsum([one.duration for one in skill.primitives])
        self.task = self.frame.task(np.minimum(dt * np.arange(ticks) / ends[-1], 1.0))
        self.ensemble = Ensemble()
        self.goal_rotation, self.turned = quaternion.matrix(self.frame.orientation), np.empty(3)
        self.pose, self.velocity = self.frame.start, np.zeros(6)  # of the reference, at the last decision
        position, orientation = self.frame.absolute(np.tile(self.pose, (ticks, 1)))
        primitive = np.searchsorted(np.round(ends[:-1] / dt), np.arange(ticks), side="right")
        rates = np.zeros((4, ticks, 3))
        self.reference = Reference(position, rates[0], rates[1], orientation, rates[2], rates[3], primitive)

    def lead(self, tick: int, world: World, arm: ArmModel) -> None:
        """Sense at a tick, and write the ticks until the next decision, if one is due."""
        sample, late = divmod(tick, FINGER_TICKS)
        if late:
            return
        yaw, pitch, roll = world.q[-3:]  # of the tool in the grasp
        take(self.readings, sample, np.array([*world.grasp_load, pitch, roll, yaw]), self.counts[sample])
        if sample % self.policy.parameters.every:
            return
        touch = self.counts[sample] - self.counts[: min(sample + 1, OFFSET_SAMPLES)].mean(axis=0)
        operational_space.write_rotation_error(arm.rotation, self.goal_rotation, self.turned)
        pose = np.concatenate([arm.position - self.frame.goal, self.turned])
        chunk = self.policy.chunk(pose, self.task[tick], touch - self.expected[tick])
        self._write(tick, self.ensemble.update(chunk))

    def _write(self, tick: int, decided: np.ndarray) -> None:
        """Ticks of the reference after this one, on its way to the pose (6,) decided."""
        if not np.isfinite(decided).all():
            raise FloatingPointError("a rival has put out a number that is not finite")
        every, its, pose, velocity = self.policy.parameters.every, self.reference, self.pose, self.velocity
        seconds = every * FINGER_TICKS * self.dt
        step = bounded(decided - pose, every * np.array(self.policy.fastest))
        self.pose, self.velocity = pose + step, step / seconds
        path = CubicHermiteSpline([0.0, seconds], [pose, self.pose], [velocity, self.velocity])
        ticks = np.arange(tick + 1, min(tick + 1 + every * FINGER_TICKS, len(its.position)))
        times = self.dt * (ticks - tick)
        its.position[ticks], its.orientation[ticks] = self.frame.absolute(path(times))
        its.velocity[ticks], its.angular_velocity[ticks] = np.hsplit(path(times, 1), 2)
        its.acceleration[ticks], its.angular_acceleration[ticks] = np.hsplit(path(times, 2), 2)


def bounded(step: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Steps (..., A) of poses, shortened to at most so many m, and rad if they turn, `most` (A / 3,)."""
    sizes = np.linalg.norm(step.reshape(*step.shape[:-1], -1, 3), axis=-1)
    return step * np.repeat(np.minimum(1.0, most / np.maximum(sizes, 1e-12)), 3, axis=-1)
