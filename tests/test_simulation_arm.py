import numpy as np
import pinocchio
import pytest
from committed import committed
from rigid_body_robots import FINGERS, carrying

from structlearn.ground.errors import InputError
from structlearn.rigid_body import compiled_dynamics
from structlearn.simulation.arm import Arm, ArmParameters, Mechanics, Payload, ideal, urdf_path

DT = 1.0 / 250.0
PAYLOAD = Payload(1.5, (0.01, 0.02, 0.1), 0.04)
ARMS = [committed(ArmParameters, "arm"), ArmParameters(urdf="franka_panda/panda.urdf", locked_joints=FINGERS)]


@pytest.fixture(scope="module", params=ARMS, ids=lambda parameters: parameters.urdf)
def robot(request):
    return request.param.read()


def states(robot, count):
    rng = np.random.default_rng(4)
    joints = len(robot.tree.names)
    return zip(*(rng.normal(size=(count, joints)) for _ in range(3)), strict=True)


def test_a_step_is_pinocchios_forward_dynamics(robot):
    data = robot.model.createData()
    with Arm(robot.tree, ideal(robot.inertias), DT) as arm:
        for q, qd, torques in states(robot, 10):
            arm.place(q, qd)
            arm.step(torques)
            expected = pinocchio.aba(robot.model, data, q, qd, torques)
            np.testing.assert_allclose((arm.qd - qd) / DT, expected, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(arm.q, q + DT * arm.qd, atol=1e-12)
            np.testing.assert_array_equal(arm.torques, torques)


def test_a_payload_weighs_from_when_it_is_taken(robot):
    loaded = compiled_dynamics.inverse_dynamics(robot.tree, carrying(robot, PAYLOAD))
    free = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    with Arm(robot.tree, ideal(robot.inertias), DT, PAYLOAD) as arm:
        for dynamics in (free, loaded):
            for q, qd, qdd in states(robot, 5):
                arm.place(q, qd)
                arm.step(dynamics(q, qd, qdd))
                np.testing.assert_allclose((arm.qd - qd) / DT, qdd, rtol=1e-9, atol=1e-9)
            arm.take_payload()


def test_friction_slows_what_moves(robot):
    joints = len(robot.tree.names)
    viscous, coulomb = np.full(joints, 0.02), np.full(joints, 0.001)
    mechanics = Mechanics(robot.inertias, viscous, coulomb, ripple=np.zeros(joints))
    data = robot.model.createData()
    dynamics = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    with Arm(robot.tree, mechanics, DT) as arm:
        for q, qd, qdd in states(robot, 10):
            fast = qd + 3.0 * np.sign(qd)  # no joint stops within the step
            torques = dynamics(q, fast, qdd)
            arm.place(q, fast)
            arm.step(torques)
            resisted = torques - viscous * fast - coulomb * np.sign(fast)
            expected = pinocchio.aba(robot.model, data, q, fast, resisted)
            np.testing.assert_allclose((arm.qd - fast) / DT, expected, rtol=1e-6, atol=1e-6)


def test_friction_holds_a_joint_that_is_pushed_less(robot):
    joints = len(robot.tree.names)
    mechanics = Mechanics(robot.inertias, np.zeros(joints), np.full(joints, 2.0), ripple=np.zeros(joints))
    q = np.full(joints, 0.3)
    still = np.zeros(joints)
    weight = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)(q, still, still)
    with Arm(robot.tree, mechanics, DT) as arm:
        arm.place(q, still)
        for _ in range(100):
            arm.step(weight + 1.5)
        # Bullet's solver iterates, so it creeps; without friction the wrist would have turned many times.
        np.testing.assert_allclose(arm.q, q, atol=1e-3)


def test_torques_act_later_by_the_latency_and_ripple_with_the_joint(robot):
    joints = len(robot.tree.names)
    zero = np.zeros(joints)
    mechanics = Mechanics(robot.inertias, zero, zero, np.full(joints, 0.5), 3.0, latency_steps=2)
    with Arm(robot.tree, mechanics, DT) as arm:
        arm.place(zero + 0.1, zero)
        for command, expected in ((1.0, 1.0), (2.0, 1.0), (3.0, 1.0), (4.0, 2.0)):
            ripple = 0.5 * np.sin(2.0 * np.pi * 3.0 * arm.q)
            arm.step(zero + command)
            np.testing.assert_allclose(arm.torques, expected + ripple)


def test_an_arm_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"there is no file 'none/such\.urdf'"):
        urdf_path("none/such.urdf")
