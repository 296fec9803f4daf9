"""Joint logs of the simulated arms."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
from pydantic import Field

import structlearn
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.recordings.joint_log import JointLog
from structlearn.rigid_body.any_model import bodies_model
from structlearn.rigid_body.compiled_dynamics import inverse_dynamics
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Engine, Payload, ideal
from structlearn.testbeds.dynamics.world.arm_motion import (
    SineParameters,
    joint_feedback,
    sine_controller,
    sine_path,
)
from structlearn.testbeds.dynamics.world.controlled_arm import SimulatedArm, agreement, run
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, measured_torques, stand_in

STAND_IN = "stand-in with friction, ripple, latency and other inertias"

COMPARED_S = 8.0
"""First part of a motion that both engines run; in it all joints move, and some of them turn back."""


class PayloadParameters(Parameters):
    """A body that the arm picks up while it moves.

    Attributes:
        mass_kg: its mass.
        point_m: its centre of mass in the last joint's frame.
        radius_m: of gyration.
        at_share: share of the log after which it is picked up.
    """

    mass_kg: float = Field(gt=0)
    point_m: tuple[float, float, float]
    radius_m: float = Field(gt=0)
    at_share: float = Field(gt=0, lt=1)

    @property
    def body(self) -> Payload:
        """The body itself."""
        return Payload(self.mass_kg, self.point_m, self.radius_m)


class RecordMotionParameters(Parameters):
    """What is recorded beside the sines.

    Attributes:
        payload: picked up by the stand-ins in logs of their own.
    """

    payload: PayloadParameters


def ideal_log(robot: Robot, motion: SineParameters, engine: Engine) -> JointLog:
    """Sines of the arm as its URDF has it, tracked with that very model (III.4.1)."""
    arm = SimulatedArm(robot, ideal(robot.inertias), 1.0 / motion.rate_hz, engine)
    return _sine_log("sine", arm, motion, {"arm": "as in its URDF"})


def stand_in_log(
    robot: Robot, parameters: StandInParameters, seed: int, motion: SineParameters, engine: Engine
) -> JointLog:
    """Sines of a stand-in for the real robot, tracked with the URDF's model (III.4.2)."""
    mechanics = stand_in(robot.tree, robot.inertias, parameters, seed)
    motion = motion.cut(parameters.log_s)
    arm = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz, engine)
    log = _sine_log("sine", arm, motion, {"arm": STAND_IN, "seed": str(seed)})
    return replace(log, torques=measured_torques(log.torques, robot.tree, parameters, [seed, 1]))


def payload_log(
    robot: Robot,
    parameters: StandInParameters,
    seed: int,
    payload: PayloadParameters,
    motion: SineParameters,
    engine: Engine,
) -> JointLog:
    """The same once more, with a body picked up on the way that the controller does not know."""
    mechanics = stand_in(robot.tree, robot.inertias, parameters, seed)
    motion = motion.cut(parameters.log_s)
    tick = round(payload.at_share * motion.duration_s * motion.rate_hz)
    remark = {
        "arm": STAND_IN,
        "seed": str(seed),
        "payload": f"{payload.mass_kg:g} kg from {tick / motion.rate_hz:g} s on",
    }
    arm = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz, engine, payload.body, tick)
    log = _sine_log("payload", arm, motion, remark)
    return replace(log, torques=measured_torques(log.torques, robot.tree, parameters, [seed, 2]))


def compared_log(
    log: Callable[[SineParameters, Engine], JointLog], motion: SineParameters, engine: Engine
) -> tuple[JointLog, pd.DataFrame]:
    """A log, and how far both engines are apart in its first part."""
    return log(motion, engine), log_agreement(log, motion)


def log_agreement(log: Callable[[SineParameters, Engine], JointLog], motion: SineParameters) -> pd.DataFrame:
    """A row of `controlled_arm.agreement` of a log of the first `COMPARED_S`."""
    piece = motion.cut(COMPARED_S)

    def both(engine: Engine) -> tuple[np.ndarray, np.ndarray]:
        made = log(piece, engine)
        return made.positions, made.torques

    return pd.DataFrame([agreement(both)])


def _sine_log(name: str, arm: SimulatedArm, motion: SineParameters, remark: Mapping[str, str]) -> JointLog:
    robot = arm.robot
    reference = sine_path(robot.tree, motion)
    feedback = joint_feedback(robot.tree, robot.inertias, motion.feedback)
    model = bodies_model(inverse_dynamics(robot.tree, robot.inertias))
    moved = run(arm, sine_controller(model, reference, feedback), reference.q[0], reference.qd[0])
    if moved.stopped:
        raise InputError(
            f"simulated {name}: stopped after {len(moved.q) / motion.rate_hz:.3g} s: {moved.stopped}; "
            "give the sines less amplitude or longer periods, or the joints more feedback"
        )
    stamps = np.round(np.arange(len(moved.q)) * (1e9 / motion.rate_hz)).astype(np.int64)
    provenance = {
        "origin": "simulated",
        "generator": f"structlearn {structlearn.__version__}",
        "engine": arm.engine,
        "robot": robot.name,
        **remark,
    }
    return JointLog(name, robot.tree.names, stamps, moved.q, moved.qd, moved.torques, provenance)
