"""One run of the scraping robot: a motion is followed, the board is touched, everything is recorded.

What differs between runs is who leads: a person who guides the arm (`guidance.GuidedMotion`), the learned
primitives, or the primitives with feedback (`feedback.runtime.Controller`). All of them give a reference pose
per tick; force control along z and, for corrections, compliance about roll are added to it (table IV.4).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydantic import Field

from structlearn.ground import quaternion
from structlearn.ground.params import Parameters
from structlearn.simulation.fingers import CHANNELS, FingerPair
from structlearn.testbeds.scraping.world import scraping_robot
from structlearn.testbeds.scraping.world.corrector import Corrector
from structlearn.testbeds.scraping.world.layout import FLAT_ORIENTATION, ROLL_AXIS
from structlearn.testbeds.scraping.world.operational_space import OperationalSpace
from structlearn.testbeds.scraping.world.scraping_robot import ARM_JOINTS
from structlearn.testbeds.scraping.world.scraping_world import ScrapingWorld, tool_wrench

FINGER_TICKS = 3
"""Control ticks per reading of the fingers: 100 Hz at 300 Hz."""


class ControlParameters(Parameters):
    """The robot's controller; the gains gave a steady 1.00 N at every tilt.

    Attributes:
        stiffness: of operational-space control in 1/s^2, the squared natural frequency.
        force_n: downward force held in contact.
        force_p_m_n: proportional gain of force control.
        force_i_m_n_s: its integral gain.
        roll_p_rad_n_m: proportional gain of compliance about roll.
        roll_i_rad_n_m_s: its integral gain.
        wrench_cutoff_hz: one-pole filter of the wrist sensor.
        force_noise_n: std of a reading of the wrist sensor.
        torque_noise_n_m: the same of its torques.
    """

    stiffness: float = Field(gt=0)
    force_n: float = Field(gt=0)
    force_p_m_n: float = Field(ge=0)
    force_i_m_n_s: float = Field(ge=0)
    roll_p_rad_n_m: float = Field(ge=0)
    roll_i_rad_n_m_s: float = Field(ge=0)
    wrench_cutoff_hz: float = Field(gt=0)
    force_noise_n: float = Field(ge=0)
    torque_noise_n_m: float = Field(ge=0)


class Motion(Protocol):
    """Who leads: a reference pose of the edge frame per tick.

    `tick` takes the newest 38 counts, or None between readings, and sets the attributes. `primitive` is the
    number of the running primitive; force control is on from the second one on.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    orientation: np.ndarray
    angular_velocity: np.ndarray
    angular_acceleration: np.ndarray
    primitive: int

    def tick(self, counts: np.ndarray | None) -> object:
        """Advance by one control tick."""


@dataclass(frozen=True)
class Conditions:
    """What a run meets; small differences between runs are part of a real set-up.

    Attributes:
        board_roll: rad.
        board_point: (3,) m on the axis of tilt.
        friction_factor: on the world's friction.
        board_stiffness_factor: on the board's stiffness.
        stiffness: 1/s^2 of whoever leads the arm; the robot's own, or a person's.
        force: (T,) N held in contact.
        force_gains: P in m/N, I in m/(N s).
    """

    board_roll: float
    board_point: np.ndarray
    friction_factor: float
    board_stiffness_factor: float
    stiffness: float
    force: np.ndarray
    force_gains: tuple[float, float]


@dataclass(frozen=True)
class RunLog:
    """What happened, per control tick; counts per reading of the fingers.

    Attributes:
        position: (T, 3) m of the edge frame.
        orientation: (T, 4) of the edge frame.
        joint_positions: (T, 7) rad.   joint_velocities: (T, 7) rad/s.   joint_torques: (T, 7) N m.
        wrench: (T, 6) of the tool on the board, as the wrist sensor reads it.
        tool_to_board: (T, 4) orientation of the tool relative to the board; identity when it lies flat.
        counts: (S, 38), read at ticks `count_ticks` (S,).
        primitive: (T,) number of the running primitive.
    """

    position: np.ndarray
    orientation: np.ndarray
    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    joint_torques: np.ndarray
    wrench: np.ndarray
    tool_to_board: np.ndarray
    counts: np.ndarray
    count_ticks: np.ndarray
    primitive: np.ndarray


def execute(
    world: ScrapingWorld,
    motion: Motion,
    start: tuple[np.ndarray, np.ndarray],
    ticks: int,
    conditions: Conditions,
    control: ControlParameters,
    fingers: FingerPair,
    rng: np.random.Generator,
    corrector: Corrector | None = None,
) -> RunLog:
    """Run a motion in the world.

    Args:
        world: robot and board; left as the run ends.
        motion: who leads.
        start: (3,) m and (3, 3): pose of the edge frame at rest.
        ticks: number of control ticks T.
        conditions: of this run.
        control: of the robot.
        fingers: read every third tick.
        rng: noise of the wrist sensor.
        corrector: a person who corrects roll, from the second primitive on; with it the robot gives way.

    Returns:
        The log.
    """
    arm = OperationalSpace(scraping_robot.arm_model())
    angles = scraping_robot.joint_angles(*start)
    arm.hold_posture(angles)
    world.place(
        angles,
        conditions.board_roll,
        conditions.board_point,
        conditions.friction_factor,
        conditions.board_stiffness_factor,
    )
    share = 1.0 - np.exp(-2.0 * np.pi * control.wrench_cutoff_hz * world.dt)
    noise = rng.standard_normal((ticks, 6)) * np.repeat([control.force_noise_n, control.torque_noise_n_m], 3)
    board = quaternion.from_rotation_vector(conditions.board_roll * ROLL_AXIS)
    log = _empty_log(ticks)
    rotations = np.empty((2, ticks, 3, 3))  # hand, tool
    force_control = _ProportionalIntegral(*conditions.force_gains, world.dt)
    roll_control = _ProportionalIntegral(control.roll_p_rad_n_m, control.roll_i_rad_n_m_s, world.dt)
    felt, hold, nothing = np.zeros(6), np.zeros(6), np.zeros(6)
    for k in range(ticks):
        arm.observe(world.q[:ARM_JOINTS].copy(), world.v[:ARM_JOINTS].copy())
        wrench = tool_wrench(world.grasp_load, arm.rotation, world.tool_rotation) + noise[k]
        felt += share * (wrench - felt)
        counts = None
        if k % FINGER_TICKS == 0:
            load = world.grasp_load
            counts = log.counts[k // FINGER_TICKS] = fingers.read(load[:3], load[3:], world.q[[11, 12, 10]])
        motion.tick(counts)

        height = roll = 0.0
        hold = nothing
        if motion.primitive > 0:
            height = -force_control.step(conditions.force[k] + felt[2])
            if corrector is not None:
                lacking = conditions.board_roll - roll_of(world.tool_rotation)
                nominal = (roll_of(quaternion.matrix(motion.orientation)), float(motion.angular_velocity[1]))
                person = corrector.torque(k, lacking, nominal, (roll_of(arm.rotation), arm.twist[4]))
                hold = np.array([0.0, 0.0, 0.0, 0.0, person, 0.0])
                roll = roll_control.step(person - felt[4])
        position = motion.position.copy()
        position[2] += height
        rotation = _about_y(roll) @ quaternion.matrix(motion.orientation)
        torques = arm.torques(
            position,
            rotation,
            np.concatenate((motion.velocity, motion.angular_velocity)),
            np.concatenate((motion.acceleration, motion.angular_acceleration)),
            conditions.stiffness,
            hold,
        )
        log.position[k] = arm.position
        rotations[0, k], rotations[1, k] = arm.rotation, world.tool_rotation
        log.joint_positions[k], log.joint_velocities[k] = world.q[:ARM_JOINTS], world.v[:ARM_JOINTS]
        log.joint_torques[k], log.wrench[k], log.primitive[k] = torques, wrench, motion.primitive
        world.step(torques)
    log.orientation[:] = _quaternions(rotations[0])
    tilt = quaternion.product(_quaternions(rotations[1]), quaternion.conjugate(FLAT_ORIENTATION))
    log.tool_to_board[:] = quaternion.sign_continuous(
        quaternion.shortest(quaternion.product(quaternion.conjugate(board), tilt))
    )
    return log


def roll_of(rotation: np.ndarray) -> float:
    """Roll about the base y axis of a frame that points down (x against base x) when flat: (3, 3) -> rad."""
    return float(np.arctan2(rotation[2, 0], -rotation[0, 0]))


class _ProportionalIntegral:
    """A PI controller on an error per tick."""

    def __init__(self, proportional: float, integral: float, dt: float) -> None:
        self._gains, self._dt, self._sum = (proportional, integral), dt, 0.0

    def step(self, error: float) -> float:
        self._sum += error * self._dt
        return self._gains[0] * error + self._gains[1] * self._sum


def _empty_log(ticks: int) -> RunLog:
    widths = {
        "position": 3,
        "orientation": 4,
        "joint_positions": ARM_JOINTS,
        "joint_velocities": ARM_JOINTS,
        "joint_torques": ARM_JOINTS,
        "wrench": 6,
        "tool_to_board": 4,
    }
    count_ticks = np.arange(0, ticks, FINGER_TICKS)
    return RunLog(
        counts=np.empty((len(count_ticks), CHANNELS)),
        count_ticks=count_ticks,
        primitive=np.empty(ticks, dtype=int),
        **{name: np.empty((ticks, width)) for name, width in widths.items()},
    )


def _about_y(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array(((cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine)))


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Sign-continuous unit quaternions of rotation matrices (T, 3, 3)."""
    from scipy.spatial.transform import Rotation

    xyzw = Rotation.from_matrix(rotations).as_quat()
    return quaternion.sign_continuous(quaternion.from_xyzw(xyzw))
