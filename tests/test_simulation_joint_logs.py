import numpy as np
import pytest
from committed import committed
from rigid_body_robots import carrying

from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import (
    PayloadParameters,
    PerturbedRobotParameters,
    ideal_log,
    perturbed_mechanics,
    perturbed_robot,
    perturbed_robot_log,
)
from dissertation.simulation.arm import ArmParameters, Payload
from structlearn.core.metrics import nmse
from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.compiled_dynamics import friction_rows

MOTION = committed(ArmMotionParameters, "arm_motion", test={"duration_s": 4.0}).used
SEED = 3


@pytest.fixture(scope="module")
def robot():
    return committed(ArmParameters, "arm").read()


@pytest.fixture(scope="module")
def log(robot):
    return ideal_log(robot, MOTION)


def predicted(robot, inertias, log, friction=None) -> np.ndarray:
    """Torques of a model at the states of a log; Bullet's accelerations are forward differences."""
    torques = compiled_dynamics.inverse_dynamics(robot.tree, inertias, friction)
    rates = np.diff(log.velocities, axis=0) * MOTION.rate_hz
    states = zip(log.positions[:-1], log.velocities[:-1], rates, strict=True)
    return np.array([torques(*state) for state in states])


def test_the_ideal_log_obeys_the_urdfs_dynamics(robot, log):
    np.testing.assert_allclose(predicted(robot, robot.inertias, log), log.torques[:-1], atol=1e-8)
    assert log.joints == robot.tree.names
    assert len(log.stamps) == 1000
    assert (np.diff(log.stamps) == 4_000_000).all()
    assert log.provenance["origin"] == "simulated"


def test_the_perturbed_robot_differs_from_its_urdf_by_what_is_named(robot):
    one = perturbed_robot(committed(PerturbedRobotParameters, "perturbed_robot"), SEED)
    log = perturbed_robot_log(robot, one, MOTION)
    true = perturbed_mechanics(robot.tree, robot.inertias, one)
    friction = friction_rows(np.column_stack([true.viscous, true.coulomb]), ["viscous", "coulomb"])
    wrong = nmse(predicted(robot, robot.inertias, log), log.torques[:-1])
    right = nmse(predicted(robot, true.inertias, log, friction), log.torques[:-1])
    assert (right < wrong).all()
    assert wrong[[0, 4, 5, 6]].min() > 0.2  # axes that carry little weight: friction decides
    assert "perturbed robot" in log.provenance["arm"]
    assert perturbed_robot_log(robot, one, MOTION).torques.tobytes() == log.torques.tobytes()


def test_links_of_the_perturbed_robot_are_real_bodies(robot):
    parameters = committed(PerturbedRobotParameters, "perturbed_robot", mass_spread=0.4)
    mechanics = perturbed_mechanics(robot.tree, robot.inertias, perturbed_robot(parameters, SEED))
    moments = np.linalg.eigvalsh(mechanics.inertias.inertia)
    assert (mechanics.inertias.mass > 0).all()
    assert (moments > 0).all()
    scale = mechanics.inertias.mass / robot.inertias.mass
    np.testing.assert_allclose(moments, scale[:, None] * np.linalg.eigvalsh(robot.inertias.inertia))


SHARES = ("viscous_share", "coulomb_share", "ripple_share", "noise_share")
SPREADS = ("mass_spread", "centre_spread_m", "latency_ticks")
IDEAL = perturbed_robot(
    committed(PerturbedRobotParameters, "perturbed_robot", **dict.fromkeys(SHARES + SPREADS, 0)), SEED
)


def test_without_spread_friction_ripple_and_latency_the_perturbed_robot_is_ideal(robot, log):
    np.testing.assert_allclose(perturbed_robot_log(robot, IDEAL, MOTION).torques, log.torques, atol=1e-8)


def test_a_robot_is_the_same_with_and_without_a_payload_until_it_picks_it_up(robot):
    """Every robot has links and noise of its own, and noise is not that of its other log."""
    robots = committed(PerturbedRobotParameters, "perturbed_robot")
    one, another = perturbed_robot(robots, SEED), perturbed_robot(robots, SEED + 1)
    payload = committed(PayloadParameters, "record_motion.payload")
    half = 500
    empty, loaded, other = (
        perturbed_robot_log(robot, one, MOTION),
        perturbed_robot_log(robot, one, MOTION, payload),
        perturbed_robot_log(robot, another, MOTION),
    )
    np.testing.assert_array_equal(loaded.positions[: half + 1], empty.positions[: half + 1])
    assert np.abs(loaded.positions - empty.positions)[half + 10 :].max() > 1e-4
    assert (loaded.torques[:half] != empty.torques[:half]).all()
    assert np.abs(other.positions - empty.positions)[10:].max() > 1e-4
    assert loaded.provenance["payload"] == "1.5 kg from 2 s on"
    assert loaded.provenance["seed"] == empty.provenance["seed"] == str(SEED)


def test_the_payload_appears_when_it_is_picked_up(robot):
    """On a robot that is as its URDF has it, so that every torque is known."""
    parameters = committed(PayloadParameters, "record_motion.payload")
    log = perturbed_robot_log(robot, IDEAL, MOTION, parameters)
    loaded = carrying(robot, Payload(parameters.mass_kg, parameters.point_m, parameters.radius_m))
    without, loaded_too = (predicted(robot, inertias, log) for inertias in (robot.inertias, loaded))
    half = 500
    np.testing.assert_allclose(without[:half], log.torques[:half], atol=1e-8)
    np.testing.assert_allclose(loaded_too[half:], log.torques[half:-1], atol=1e-8)
    assert np.abs(without[half:] - log.torques[half:-1]).max() > 1.0
