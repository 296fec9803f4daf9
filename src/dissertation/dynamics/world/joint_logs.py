"""Joint logs of simulated arms: an arm as in its URDF, and perturbed robots in place of the real one.

A perturbed robot has effects that the models of III.4.2 lack: its links differ from the URDF, its joints have
friction, its drives have ripple, its torque sensors are noisy, and torques act one tick after the command.
Drive effects scale with the rated torque, because larger gears have more friction and ripple. Robots differ
in their links and in all of these but the latency. No number was chosen to fit an outcome; medians are:

* Coulomb friction 0.5 % of the rated torque, viscous friction 0.3 % per rad/s: the recorded Franka Emika
  Panda has Coulomb friction of 0.2 to 0.6 % in the large joints and 1.4 to 2 % in the small ones, and viscous
  friction of 0.04 to 0.8 % (least squares on its log; its drives are rated at 87 and 12 N m).
* Ripple 0.1 %, noise 0.05 % (std), masses off by 15 % (std of the log), centres of mass by 1.5 cm (std per
  axis), one tick of latency: assumptions without a source.
"""

from dataclasses import replace

import numpy as np
from pydantic import Field

import structlearn
from dissertation.dynamics.world.arm_motion import (
    SineParameters,
    joint_feedback,
    of_joints,
    sine_controller,
    sine_path,
)
from dissertation.dynamics.world.controlled_arm import SimulatedArm, run_controller
from dissertation.simulation.arm import Mechanics, Payload, ideal
from dissertation.simulation.individuals import Individual, drawn
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.compiled_dynamics import inverse_dynamics
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


class PerturbedRobotParameters(Individual):
    """The perturbed robots; the module's docstring gives the reasons."""

    log_s: float = Field(gt=0)
    latency_ticks: int = Field(ge=0, le=20)
    rated_n_m: tuple[float, ...]
    viscous_share: float = Field(ge=0)
    coulomb_share: float = Field(ge=0)
    ripple_share: float = Field(ge=0)
    noise_share: float = Field(ge=0)
    ripple_per_turn: float = Field(gt=0)
    mass_spread: float = Field(ge=0)
    centre_spread_m: float = Field(ge=0)


class PerturbedRobot(PerturbedRobotParameters):
    """One of them, with its own friction, ripple and noise; see `perturbed_robot`."""

    seed: int = Field(ge=0)  # of its links and readings


class PayloadParameters(Parameters):
    """A body that the arm picks up while it moves."""

    mass_kg: float = Field(gt=0)
    point_m: tuple[float, float, float]
    radius_m: float = Field(gt=0)
    at_share: float = Field(gt=0, lt=1)

    def pick_up_s(self, duration_s: float) -> float:
        """Time in s of the pick-up in a log."""
        return self.at_share * duration_s


class RecordMotionParameters(Parameters):
    """Parameters of the recordings besides the sines."""

    payload: PayloadParameters


def perturbed_robot(robots: PerturbedRobotParameters, seed: int) -> PerturbedRobot:
    """Robot with this seed, drawn from the population."""
    return PerturbedRobot(seed=seed, **drawn(robots, seed).model_dump())


def perturbed_mechanics(tree: KinematicTree, default: LinkInertias, perturbed: PerturbedRobot) -> Mechanics:
    """Mechanics of a perturbed robot; its seed selects its true inertias.

    A link heavier than in the URDF is denser: its inertia scales with its mass and stays physically
    consistent. Raises InputError: too few rated torques.
    """
    rated = of_joints("rated_n_m", perturbed.rated_n_m, tree)
    rng = np.random.default_rng([perturbed.seed, 0])
    count = len(tree.names)
    factor = np.exp(rng.normal(0.0, perturbed.mass_spread, count))
    shift = rng.normal(0.0, perturbed.centre_spread_m, (count, 3))
    mass = default.mass * factor
    centre = default.first_moment / default.mass[:, None] + shift
    return Mechanics(
        LinkInertias(mass, mass[:, None] * centre, default.inertia * factor[:, None, None]),
        viscous=perturbed.viscous_share * rated,
        coulomb=perturbed.coulomb_share * rated,
        ripple=perturbed.ripple_share * rated,
        ripple_waves=perturbed.ripple_per_turn / (2.0 * np.pi),
        latency_steps=perturbed.latency_ticks,
    )


def ideal_log(robot: Robot, motion: SineParameters) -> JointLog:
    """Log of sines of the arm described by the URDF, tracked with the same model (III.4.1)."""
    arm = SimulatedArm(robot, ideal(robot.inertias), 1.0 / motion.rate_hz)
    return _sine_log("sine", arm, motion, {"arm": "as in its URDF"})


def perturbed_robot_log(
    robot: Robot,
    perturbed: PerturbedRobot,
    motion: SineParameters,
    payload: PayloadParameters | None = None,
    pybullet: bool = False,
) -> JointLog:
    """Log of sines of a perturbed robot, tracked with the model of its URDF, with torque noise (III.4.2).

    The controller does not know about the payload, which is picked up on the way.
    """
    motion = motion.cut(perturbed.log_s)
    mechanics = perturbed_mechanics(robot.tree, robot.inertias, perturbed)
    arm = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz)
    remark = {"arm": "perturbed robot with friction, ripple, latency and other inertias"}
    remark["seed"] = str(perturbed.seed)
    if payload is None:
        log = _sine_log("sine", arm, motion, remark, pybullet)
    else:
        tick = round(payload.at_share * motion.duration_s * motion.rate_hz)
        remark["payload"] = f"{payload.mass_kg:g} kg from {tick / motion.rate_hz:g} s on"
        body = Payload(payload.mass_kg, payload.point_m, payload.radius_m)
        log = _sine_log("payload", replace(arm, payload=body, take_at=tick), motion, remark, pybullet)
    noise = perturbed.noise_share * of_joints("rated_n_m", perturbed.rated_n_m, robot.tree)
    rng = np.random.default_rng([perturbed.seed, 1 if payload is None else 2])
    return replace(log, torques=log.torques + noise * rng.normal(size=log.torques.shape))


def _sine_log(
    name: str, arm: SimulatedArm, motion: SineParameters, remark: dict[str, str], pybullet: bool = False
) -> JointLog:
    robot = arm.robot
    reference = sine_path(robot.tree, motion)
    feedback = joint_feedback(robot.tree, robot.inertias, motion.feedback)
    model = inverse_dynamics(robot.tree, robot.inertias)
    controller = sine_controller(model, reference, feedback)
    moved = run_controller(arm, controller, reference.position[0], reference.velocity[0], pybullet)
    if moved.stopped:
        raise InputError(
            f"simulated {name}: stopped after {len(moved.q) / motion.rate_hz:.3g} s: {moved.stopped}; "
            "give the sines less amplitude or longer periods, or the joints more feedback"
        )
    stamps = np.round(np.arange(len(moved.q)) * (1e9 / motion.rate_hz)).astype(np.int64)
    origin = {"origin": "simulated", "generator": f"structlearn {structlearn.__version__}"}
    provenance = origin | {"robot": robot.name} | remark
    return JointLog(name, robot.tree.names, stamps, moved.q, moved.qd, moved.torques, provenance=provenance)
