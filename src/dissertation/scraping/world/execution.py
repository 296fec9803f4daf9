"""One run of the scraping robot: follow a motion, touch the board, record everything.

The motion comes from a person who guides the arm (`guided_motion`), from the learned primitives, or from the
primitives with feedback (`feedback.runtime.Controller`). Each gives a reference pose per tick; force control
along z and, for corrections, compliance in roll are added to it (table IV.4).

The whole run is one compiled loop. For comparison, its ticks can also run one by one while another engine
(PyBullet) integrates the robot's motion in between.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.scraping.world import operational_space, scraping_robot, scraping_world
from dissertation.scraping.world.corrector import Corrector, hold, nobody
from dissertation.scraping.world.layout import FLAT_ORIENTATION, ROLL_AXIS
from dissertation.scraping.world.operational_space import ArmModel, Target
from dissertation.scraping.world.scraping_robot import ARM_JOINTS
from dissertation.scraping.world.scraping_world import World, WorldParameters, tool_wrench
from dissertation.simulation.fingers import CHANNELS, FingerPair, Readings, take
from structlearn.core import quaternion
from structlearn.core.compilation import compiled_inside, numba
from structlearn.core.params import Parameters
from structlearn.feedback import controller_tick
from structlearn.feedback.runtime import Controller

Advance = Callable[[np.ndarray], None]
"""Advances a world by one control tick with arm torques (7,) in N m, as `scraping_world.advance`."""

Engine = Callable[[World], AbstractContextManager[Advance]]
"""Integrates a world's robot motion in place of the compiled loop."""

NOBODY = nobody()  # null corrector
FINGER_TICKS = 3  # control ticks per reading of the fingers: 100 Hz at 300 Hz


class ControlParameters(Parameters):
    """Gains, filters and sensor noise of the robot's controller."""

    stiffness: float = Field(gt=0)
    force_n: float = Field(gt=0)
    force_p_m_n: float = Field(ge=0)
    force_i_m_n_s: float = Field(ge=0)
    roll_p_rad_n_m: float = Field(ge=0)
    roll_i_rad_n_m_s: float = Field(ge=0)
    wrench_cutoff_hz: float = Field(gt=0)
    force_noise_n: float = Field(ge=0)
    torque_noise_n_m: float = Field(ge=0)


class Reference(NamedTuple):
    """Reference motion of the edge frame over T ticks, base frame."""

    position: np.ndarray  # (T, 3) m
    velocity: np.ndarray  # (T, 3) m/s
    acceleration: np.ndarray  # (T, 3) m/s^2
    orientation: np.ndarray  # (T, 4) unit quaternions
    angular_velocity: np.ndarray  # (T, 3) rad/s
    angular_acceleration: np.ndarray  # (T, 3) rad/s^2
    primitive: np.ndarray  # (T,) index of the running primitive; force control is on from the second one on


class Conditions(NamedTuple):
    """Conditions of a run; they vary slightly between runs, as on a real set-up."""

    board_roll: float  # rad
    friction_factor: float  # scales the world's friction
    board_stiffness_factor: float  # scales the board's stiffness
    stiffness: float  # 1/s^2 of whoever leads the arm: the robot's own, or a person's
    force: np.ndarray  # (T,) N, contact force to hold
    force_gains: tuple[float, float]  # P in m/N, I in m/(N s)


class RunLog(NamedTuple):
    """Log of a run per control tick; counts per reading of the fingers."""

    position: np.ndarray  # (T, 3) m of the edge frame
    orientation: np.ndarray  # (T, 4) of the edge frame
    joint_positions: np.ndarray  # (T, 7) rad
    joint_velocities: np.ndarray  # (T, 7) rad/s
    joint_torques: np.ndarray  # (T, 7) N m
    wrench: np.ndarray  # (T, 6) of the tool on the board, as measured at the wrist
    tool_to_board: np.ndarray  # (T, 4) orientation of the tool relative to the board; identity if flat
    counts: np.ndarray  # (S, 38), read at ticks `count_ticks` (S,)
    count_ticks: np.ndarray
    primitive: np.ndarray  # (T,) index of the running primitive


class _Run(NamedTuple):
    """State and constants of a run, as read and written by a tick."""

    dt: float  # s per control tick
    conditions: Conditions
    arm: ArmModel  # the controller's model and observations
    world: World  # robot and board
    fingers: Readings
    reference: Reference  # of the motion; a controller writes it tick by tick
    target: Target  # reference with force control and compliance, at this tick
    roll_gains: tuple[float, float]  # P in rad/(N m), I in rad/(N m s)
    share: float  # weight of a new reading in the filtered wrench
    noise: np.ndarray  # (T, 6) of the wrist sensor, N and N m
    felt: np.ndarray  # (6,) filtered wrench
    push: np.ndarray  # (6,) wrench of a person on the hand
    sums: np.ndarray  # (2,) integrals of force control and roll compliance
    log: RunLog
    hand: np.ndarray  # (T, 3, 3) orientation of the edge frame
    tool: np.ndarray  # (T, 3, 3) orientation of the tool


def execute(
    parameters: WorldParameters,
    motion: Reference | Controller,
    start: tuple[np.ndarray, np.ndarray],
    ticks: int,
    conditions: Conditions,
    control: ControlParameters,
    fingers: FingerPair,
    rng: np.random.Generator,
    person: Corrector | None = None,
    engine: Engine | None = None,
) -> RunLog:
    """Run a motion in the simulated world for some control ticks.

    `motion`: a reference, or a started controller. `start`: (3,) m and (3, 3), initial pose of the edge
    frame, at rest. `rng`: noise of the wrist sensor. `person`: corrects roll from the second primitive on,
    while the robot is compliant. `engine`: integrates the motion; None: the compiled loop.

    Raises FloatingPointError: the robot has diverged.
    """
    angles = scraping_robot.joint_angles(*start)
    world = scraping_world.placed(parameters, angles, *conditions[:3])  # the board, and factors on it
    noise = rng.standard_normal((ticks, 6)) * np.repeat([control.force_noise_n, control.torque_noise_n_m], 3)
    if isinstance(motion, Controller):
        reference, controller = _empty_reference(ticks), motion.compiled
    else:
        reference, controller = motion, controller_tick.NO_PLAN
    log = _empty_log(ticks)
    run = _Run(
        dt=parameters.dt,
        conditions=conditions,
        arm=operational_space.controlled(scraping_robot.arm(), angles),
        world=world,
        fingers=fingers.readings(len(log.counts)),
        reference=reference,
        target=Target(np.zeros(3), np.eye(3), np.zeros(6), np.zeros(6)),
        roll_gains=(control.roll_p_rad_n_m, control.roll_i_rad_n_m_s),
        share=1.0 - np.exp(-2.0 * np.pi * control.wrench_cutoff_hz * parameters.dt),
        noise=noise,
        felt=np.zeros(6),
        push=np.zeros(6),
        sums=np.zeros(2),
        log=log,
        hand=np.empty((ticks, 3, 3)),
        tool=np.empty((ticks, 3, 3)),
    )
    others = (controller, NOBODY if person is None else person)
    if engine is None:
        _ticks(run, 0, ticks, True, *others)
    else:
        with engine(world) as advance:
            for k in range(ticks):
                _ticks(run, k, k + 1, False, *others)
                advance(run.arm.torques)
    if not all(np.isfinite(rotations).all() for rotations in (run.hand, run.tool)):
        raise FloatingPointError("the robot has diverged")
    log.orientation[:] = _quaternions(run.hand)
    board = quaternion.from_rotation_vector(conditions.board_roll * ROLL_AXIS)
    tilt = quaternion.product(_quaternions(run.tool), quaternion.conjugate(FLAT_ORIENTATION))
    log.tool_to_board[:] = quaternion.sign_continuous(
        quaternion.shortest(quaternion.product(quaternion.conjugate(board), tilt))
    )
    return log


@numba.njit(cache=True, error_model="numpy")
def roll_of(rotation: np.ndarray) -> float:
    """Roll in rad about base y of a frame (3, 3) that points down (x against base x) when flat."""
    return np.arctan2(rotation[2, 0], -rotation[0, 0])


@numba.njit(cache=True, error_model="numpy")
def _ticks(
    run: _Run,
    first: int,
    end: int,
    integrate: bool,
    controller: np.ndarray,
    person: Corrector,
) -> None:
    """Ticks of sensors, motion, control and recorder, each followed by a step of the world if `integrate`.

    If the plan has no primitives, the reference is given. All kinds of runs have the same argument types
    (hence the null corrector), since a loop of this size takes ten seconds to compile.
    """
    plan, _ = controller_tick.plan_and_state(controller)
    for k in range(first, end):
        _sense(run, k)
        if len(plan.tau) > 0:
            _lead(controller, run.reference, run.log.counts, k)
        primitive = run.reference.primitive[k]
        height = roll = 0.0
        run.push[:] = 0.0
        if primitive > 0:
            force_error = run.conditions.force[k] + run.felt[2]
            height = -_proportional_integral(run.conditions.force_gains, force_error, run.dt, run.sums, 0)
            if len(person.remaining) > 0:
                run.push[4] = _corrected(
                    run.conditions.board_roll, run.reference, k, run.arm, run.world.tool_rotation, person
                )
                give = run.push[4] - run.felt[4]
                roll = _proportional_integral(run.roll_gains, give, run.dt, run.sums, 1)
        _aim(run.reference, k, height, roll, run.target)
        operational_space.control(run.arm, run.target, run.conditions.stiffness, run.push)
        run.log.joint_torques[k] = run.arm.torques
        run.log.primitive[k] = primitive
        if integrate:
            scraping_world.advance(run.world, run.arm.torques)


@compiled_inside
def _sense(run: _Run, k: int) -> None:
    """Read and log joints, wrist and, every third tick, the fingers."""
    world, arm, log = run.world, run.arm, run.log
    operational_space.observe(arm, world.q, world.v)
    tool_wrench(world.grasp_load, arm.rotation, world.tool_rotation, log.wrench[k])
    for i in range(6):
        log.wrench[k, i] += run.noise[k, i]
        run.felt[i] += run.share * (log.wrench[k, i] - run.felt[i])
    log.joint_positions[k], log.joint_velocities[k], log.position[k] = arm.q, arm.v, arm.position
    run.hand[k], run.tool[k] = arm.rotation, world.tool_rotation
    if k % FINGER_TICKS == 0:
        sample = np.empty(9)
        sample[:6] = world.grasp_load
        # rotations about x, y, z; the joints rotate about z, x, y
        sample[6], sample[7], sample[8] = world.q[11], world.q[12], world.q[10]
        take(run.fingers, k // FINGER_TICKS, sample, log.counts[k // FINGER_TICKS])


@compiled_inside
def _lead(controller: np.ndarray, reference: Reference, counts: np.ndarray, k: int) -> None:
    """Let the controller write tick k of the reference; it gets each reading of the fingers once."""
    _, state = controller_tick.plan_and_state(controller)
    fresh = k % FINGER_TICKS == 0 and len(state.sample) > 0
    if fresh:
        state.sample[:] = counts[k // FINGER_TICKS, : len(state.sample)]
    controller_tick.tick(controller, fresh)
    reference.position[k] = state.path[0, 0, 0]
    reference.velocity[k] = state.path[1, 0, 0]
    reference.acceleration[k] = state.path[2, 0, 0]
    reference.orientation[k] = state.orientation[0, 0]
    reference.angular_velocity[k] = state.turning[0, 0, 0]
    reference.angular_acceleration[k] = state.turning[1, 0, 0]
    reference.primitive[k] = state.clock[controller_tick.PRIMITIVE]


@compiled_inside
def _corrected(
    board_roll: float, reference: Reference, k: int, arm: ArmModel, tool: np.ndarray, person: Corrector
) -> float:
    """Torque in N m about roll of the person who holds the hand."""
    orientation = reference.orientation
    w, x, y, z = orientation[k, 0], orientation[k, 1], orientation[k, 2], orientation[k, 3]
    nominal = np.arctan2(2.0 * (x * z - w * y), 2.0 * (y * y + z * z) - 1.0)  # `roll_of` of its matrix
    rate = reference.angular_velocity[k, 1]
    return hold(person, k, board_roll - roll_of(tool), (nominal, rate), (roll_of(arm.rotation), arm.twist[4]))


@compiled_inside
def _proportional_integral(
    gains: tuple[float, float], error: float, dt: float, sums: np.ndarray, own: int
) -> float:
    """Output of a PI controller for an error per tick; `sums[own]` is its integral."""
    sums[own] += error * dt
    return gains[0] * error + gains[1] * sums[own]


@compiled_inside
def _aim(reference: Reference, k: int, height: float, roll: float, target: Target) -> None:
    """Write the target: tick k of the reference, moved along z by `height` m and turned about y by `roll`."""
    orientation = reference.orientation
    w, x, y, z = orientation[k, 0], orientation[k, 1], orientation[k, 2], orientation[k, 3]
    upright = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    cosine, sine = np.cos(roll), np.sin(roll)
    for d in range(3):
        target.rotation[0, d] = cosine * upright[0][d] + sine * upright[2][d]
        target.rotation[1, d] = upright[1][d]
        target.rotation[2, d] = cosine * upright[2][d] - sine * upright[0][d]
    target.position[:] = reference.position[k]
    target.position[2] += height
    target.twist[:3], target.twist[3:] = reference.velocity[k], reference.angular_velocity[k]
    target.acceleration[:3] = reference.acceleration[k]
    target.acceleration[3:] = reference.angular_acceleration[k]


def _empty_reference(ticks: int) -> Reference:
    widths = dict.fromkeys(Reference._fields[:-1], 3) | {"orientation": 4}
    primitive = np.empty(ticks, dtype=np.int64)
    return Reference(
        **{name: np.empty((ticks, width)) for name, width in widths.items()}, primitive=primitive
    )


def _empty_log(ticks: int) -> RunLog:
    widths = {"position": 3, "orientation": 4, "wrench": 6, "tool_to_board": 4}
    widths |= dict.fromkeys(("joint_positions", "joint_velocities", "joint_torques"), ARM_JOINTS)
    count_ticks = np.arange(0, ticks, FINGER_TICKS)
    return RunLog(
        counts=np.empty((len(count_ticks), CHANNELS)),
        count_ticks=count_ticks,
        primitive=np.empty(ticks, dtype=np.int64),
        **{name: np.empty((ticks, width)) for name, width in widths.items()},
    )


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Sign-continuous unit quaternions of rotation matrices (T, 3, 3)."""
    from scipy.spatial.transform import Rotation

    xyzw = Rotation.from_matrix(rotations, assume_valid=True).as_quat()  # orthonormal by kinematics
    return quaternion.sign_continuous(quaternion.from_xyzw(xyzw))
