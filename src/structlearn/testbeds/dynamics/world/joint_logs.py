"""Joint logs of the simulated arms."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pydantic import Field

import structlearn
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.compiled_dynamics import bodies_model, inverse_dynamics
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Payload, ideal
from structlearn.testbeds.dynamics.world.arm_motion import (
    SineParameters,
    joint_feedback,
    sine_controller,
    sine_path,
)
from structlearn.testbeds.dynamics.world.controlled_arm import SimulatedArm, run
from structlearn.testbeds.dynamics.world.perturbed_robot import StandInParameters, measured_torques, stand_in

STAND_IN = "stand-in with friction, ripple, latency and other inertias"


class PayloadParameters(Parameters):
    """A body that the arm picks up while it moves."""

    mass_kg: float = Field(gt=0)
    point_m: tuple[float, float, float]
    radius_m: float = Field(gt=0)
    at_share: float = Field(gt=0, lt=1)

    @property
    def body(self) -> Payload:
        """The body itself."""
        return Payload(self.mass_kg, self.point_m, self.radius_m)


class RecordMotionParameters(Parameters):
    """What is recorded beside the sines."""

    payload: PayloadParameters


def ideal_log(robot: Robot, motion: SineParameters) -> JointLog:
    """Sines of the arm as its URDF has it, tracked with that very model (III.4.1)."""
    arm = SimulatedArm(robot, ideal(robot.inertias), 1.0 / motion.rate_hz)
    return _sine_log("sine", arm, motion, {"arm": "as in its URDF"})


def stand_in_log(robot: Robot, parameters: StandInParameters, seed: int, motion: SineParameters) -> JointLog:
    """Sines of a stand-in for the real robot, tracked with the URDF's model (III.4.2)."""
    mechanics = stand_in(robot.tree, robot.inertias, parameters, seed)
    motion = motion.cut(parameters.log_s)
    arm = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz)
    log = _sine_log("sine", arm, motion, {"arm": STAND_IN, "seed": str(seed)})
    return replace(log, torques=measured_torques(log.torques, robot.tree, parameters, [seed, 1]))


def payload_log(
    robot: Robot,
    parameters: StandInParameters,
    seed: int,
    payload: PayloadParameters,
    motion: SineParameters,
    pybullet: bool = False,
) -> JointLog:
    """The same once more, with a body picked up on the way that the controller does not know.

    PyBullet moves the arm where that is asked for, to compare.
    """
    mechanics = stand_in(robot.tree, robot.inertias, parameters, seed)
    motion = motion.cut(parameters.log_s)
    tick = round(payload.at_share * motion.duration_s * motion.rate_hz)
    remark = {
        "arm": STAND_IN,
        "seed": str(seed),
        "payload": f"{payload.mass_kg:g} kg from {tick / motion.rate_hz:g} s on",
    }
    arm = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz, payload.body, tick)
    log = _sine_log("payload", arm, motion, remark, pybullet)
    return replace(log, torques=measured_torques(log.torques, robot.tree, parameters, [seed, 2]))


def _sine_log(
    name: str, arm: SimulatedArm, motion: SineParameters, remark: Mapping[str, str], pybullet: bool = False
) -> JointLog:
    robot = arm.robot
    reference = sine_path(robot.tree, motion)
    feedback = joint_feedback(robot.tree, robot.inertias, motion.feedback)
    model = bodies_model(inverse_dynamics(robot.tree, robot.inertias))
    moved = run(arm, sine_controller(model, reference, feedback), reference.q[0], reference.qd[0], pybullet)
    if moved.stopped:
        raise InputError(
            f"simulated {name}: stopped after {len(moved.q) / motion.rate_hz:.3g} s: {moved.stopped}; "
            "give the sines less amplitude or longer periods, or the joints more feedback"
        )
    stamps = np.round(np.arange(len(moved.q)) * (1e9 / motion.rate_hz)).astype(np.int64)
    provenance = {
        "origin": "simulated",
        "generator": f"structlearn {structlearn.__version__}",
        "robot": robot.name,
        **remark,
    }
    return JointLog(name, robot.tree.names, stamps, moved.q, moved.qd, moved.torques, provenance=provenance)
