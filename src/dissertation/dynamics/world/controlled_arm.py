"""Simulation of an arm with a dynamics model in its controller, in one compiled loop.

For comparison, PyBullet can move the arm between the same compiled controller ticks.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dissertation.dynamics.world.operational_space import VelocityControl, joint_reference
from dissertation.simulation.arm import Mechanics, Payload, carrying
from dissertation.simulation.compiled_arm import step_arm
from dissertation.simulation.compiled_chain import ChainState, dynamics, workspace
from structlearn.core.compilation import compiled_inside, numba
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, model_torques
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import RobotArrays, robot_arrays

OVERSPEED = 1.5  # multiple of its velocity limit at which a joint counts as run away; overshoot stays below

_FAULTS = ("", "speed limit", "joint limit", "not finite")


class ReferencePath(NamedTuple):
    """T samples at a uniform rate of n joints in rad, or of the tool position in the base frame in m."""

    position: np.ndarray  # (T, n) or (T, 3)
    velocity: np.ndarray  # likewise, per s
    acceleration: np.ndarray  # likewise, per s^2


class FeedbackGains(NamedTuple):
    """Joint feedback gains."""

    stiffness: np.ndarray  # (n,) N m/rad, for joint paths only
    damping: np.ndarray  # (n,) N m s/rad


class ControlArguments(NamedTuple):
    """Arguments of a control tick, see `arm_motion.sine_controller` and `reaching_controller`."""

    model: InverseDynamics
    path: ReferencePath
    feedback: FeedbackGains
    of_tool: bool  # whether the path is of the tool
    tool: VelocityControl  # for tool paths


@dataclass(frozen=True)
class SimulatedArm:
    """A simulated arm."""

    robot: Robot  # from the URDF, with its limits
    mechanics: Mechanics  # true inertias and drives
    dt: float  # s, control and simulation step
    payload: Payload | None = None  # body that it picks up
    take_at: int | None = None  # tick of the pick-up; None: never


@dataclass(frozen=True)
class ControlledRun:
    """Motion of a controlled arm; shorter than its reference if it was stopped."""

    q: np.ndarray  # (T, n) rad
    qd: np.ndarray  # (T, n) rad/s
    torques: np.ndarray  # (T, n) N m, of the drives during the following step, before friction
    stopped: str | None  # reason; None if it was not stopped


def run_controller(
    arm: SimulatedArm, controller: ControlArguments, q: np.ndarray, qd: np.ndarray, pybullet: bool = False
) -> ControlledRun:
    """Run a controller along its path from a state (n,), until it ends or the arm is stopped.

    Stops as a robot's safety controller would: if a joint exceeds `OVERSPEED` times its velocity limit or
    leaves its range, or if the model's torques are not finite. Torques saturate at the drives' limits and are
    delayed by a latency; until it has passed, the first command applies.
    """
    ticks, count = len(controller.path.position), len(q)
    log = _Log(*(np.zeros((ticks + extra, count)) for extra in (1, 1, 0, 0)))
    log.q[0], log.qd[0] = q, qd
    tree, own = arm.robot.tree, arm.mechanics
    drives = _Drives(
        tree.lower, tree.upper, OVERSPEED * tree.velocity, arm.robot.model.effortLimit,
        own.viscous, own.ripple, 2.0 * np.pi * own.ripple_waves, own.latency_steps,
    )  # fmt: skip
    move = _in_pybullet if pybullet else _in_loop
    end, fault = move(arm, controller, drives, log)
    return ControlledRun(log.q[:end], log.qd[:end], log.torques[:end], _FAULTS[fault] or None)


class _Drives(NamedTuple):
    """Limits and drives, (n,) each; latency in ticks."""

    lower: np.ndarray
    upper: np.ndarray
    fastest: np.ndarray
    limit: np.ndarray
    viscous: np.ndarray
    ripple: np.ndarray
    ripple_rad: float
    latency: int


class _Log(NamedTuple):
    """States (T + 1, n) before each tick and after the last; commands and drive torques (T, n)."""

    q: np.ndarray
    qd: np.ndarray
    commands: np.ndarray
    torques: np.ndarray


def _in_loop(arm: SimulatedArm, controller: ControlArguments, drives: _Drives, log: _Log) -> tuple[int, int]:
    """Number of ticks run, and index in `_FAULTS` of what stopped it."""
    tree, inertias = arm.robot.tree, arm.mechanics.inertias
    free = robot_arrays(tree, inertias)
    loaded = free if arm.payload is None else robot_arrays(tree, carrying(inertias, arm.payload))
    take_at = len(log.torques) if arm.take_at is None else arm.take_at
    work = workspace(len(tree.names))
    return _loop(controller, drives, free, loaded, take_at, arm.mechanics.coulomb, arm.dt, log, work)


@numba.njit(cache=True)
def _loop(
    controller: ControlArguments,
    drives: _Drives,
    free: RobotArrays,
    loaded: RobotArrays,
    take_at: int,
    coulomb: np.ndarray,
    dt: float,
    log: _Log,
    work: ChainState,
) -> tuple[int, int]:
    for k in range(len(log.torques)):
        own = free if k < take_at else loaded
        dynamics(own, log.q[k], log.qd[k], work)
        fault, torques = _tick(controller, drives, own, work, k, log)
        if fault > 0:
            return k, fault
        q, qd = log.q[k + 1], log.qd[k + 1]
        for i in range(len(q)):
            q[i], qd[i] = log.q[k, i], log.qd[k, i]
        step_arm(coulomb, torques, dt, work, q, qd)
    return len(log.torques), 0


def _in_pybullet(
    arm: SimulatedArm, controller: ControlArguments, drives: _Drives, log: _Log
) -> tuple[int, int]:
    """As `_in_loop`, with PyBullet's dynamics."""
    from dissertation.simulation.bullet_arm import BulletArm  # reports and views work without PyBullet

    tree, own = arm.robot.tree, arm.mechanics
    kinematics, work = robot_arrays(tree, own.inertias), workspace(len(tree.names))
    with BulletArm(tree, own.inertias, own.coulomb, arm.dt, arm.payload) as moved:
        moved.place(log.q[0], log.qd[0])
        for k in range(len(log.torques)):
            if k == arm.take_at:
                moved.take_payload()
            dynamics(kinematics, log.q[k], log.qd[k], work)
            fault, torques = _tick(controller, drives, kinematics, work, k, log)
            if fault > 0:
                return k, fault
            log.q[k + 1], log.qd[k + 1] = moved.step(torques)
    return len(log.torques), 0


@numba.njit(cache=True)
def _tick(
    controller: ControlArguments, drives: _Drives, own: RobotArrays, work: ChainState, k: int, log: _Log
) -> tuple[int, np.ndarray]:
    """Check the state, compute and log the command; return the fault and the joint torques (n,).

    The torques exclude Coulomb friction. Of `own`, only the kinematics are used.
    """
    q, qd, torques = log.q[k], log.qd[k], np.empty(len(drives.limit))
    for i in range(len(q)):
        if not (np.isfinite(q[i]) and np.isfinite(qd[i])):
            return 3, torques
        if abs(qd[i]) > drives.fastest[i]:
            return 1, torques
        if q[i] < drives.lower[i] or q[i] > drives.upper[i]:
            return 2, torques
    command = _command(controller, own, work, k, q, qd)
    given = log.commands[max(k - drives.latency, 0)]
    for i in range(len(q)):
        if not np.isfinite(command[i]):
            return 3, torques
        log.commands[k, i] = min(max(command[i], -drives.limit[i]), drives.limit[i])
        log.torques[k, i] = given[i] + drives.ripple[i] * np.sin(drives.ripple_rad * q[i])
        torques[i] = log.torques[k, i] - drives.viscous[i] * qd[i]
    return 0, torques


@compiled_inside
def _command(
    controller: ControlArguments, own: RobotArrays, work: ChainState, k: int, q: np.ndarray, qd: np.ndarray
) -> np.ndarray:
    """Command (n,) N m by the laws in the docstrings of `arm_motion` and `operational_space`."""
    path, feedback = controller.path, controller.feedback
    wanted, rate, change = path.position[k], path.velocity[k], path.acceleration[k]
    if controller.of_tool:
        rate, acceleration = joint_reference(controller.tool, own, work, q, qd, wanted, rate, change)
        torques = model_torques(controller.model, q, qd, acceleration)
    else:
        torques = model_torques(controller.model, wanted, rate, change)
        for i in range(len(q)):
            torques[i] += feedback.stiffness[i] * (wanted[i] - q[i])
    for i in range(len(q)):
        torques[i] += feedback.damping[i] * (rate[i] - qd[i])
    return torques
