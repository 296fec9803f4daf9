import numpy as np
import pinocchio
import pytest
from rigid_body_robots import carrying as carrying_in_pinocchio
from rigid_body_robots import robot as rigid_body_robot

from dissertation.simulation import compiled_arm
from dissertation.simulation.arm import Payload, carrying
from dissertation.simulation.bullet_arm import BulletArm, differences
from dissertation.simulation.compiled_chain import dynamics, workspace
from structlearn.core.errors import InputError
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.tree import robot_arrays

DT = 1.0 / 250.0
PAYLOAD = Payload(1.5, (0.01, 0.02, 0.1), 0.04)


@pytest.fixture(scope="module", params=["iiwa", "panda", "xarm"])
def robot(request):
    return rigid_body_robot(request.param)


class Compiled:
    """The compiled arm behind `BulletArm`'s interface."""

    def __init__(self, tree, inertias, coulomb, dt):
        self.arrays, self.coulomb, self.dt = robot_arrays(tree, inertias), coulomb, dt
        self.work = workspace(len(tree.names))

    def place(self, q, qd):
        self.q, self.qd = q.copy(), qd.copy()

    def step(self, torques):
        dynamics(self.arrays, self.q, self.qd, self.work)
        compiled_arm.step_arm(self.coulomb, torques, self.dt, self.work, self.q, self.qd)
        return self.q.copy(), self.qd.copy()


def compiled(robot, coulomb=0.0):
    return Compiled(robot.tree, robot.inertias, coulomb + np.zeros(len(robot.tree.names)), DT)


def states(robot, count):
    rng = np.random.default_rng(4)
    joints = len(robot.tree.names)
    return zip(*(rng.normal(size=(count, joints)) for _ in range(3)), strict=True)


def test_a_step_is_pinocchios_forward_dynamics(robot):
    data, one = robot.model.createData(), compiled(robot)
    for q, qd, torques in states(robot, 10):
        one.place(q, qd)
        moved, velocity = one.step(torques)
        expected = pinocchio.aba(robot.model, data, q, qd, torques)
        np.testing.assert_allclose((velocity - qd) / DT, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(moved, q + DT * velocity, atol=1e-12)


def test_a_payload_weighs_from_when_it_is_taken(robot):
    loaded = compiled_dynamics.inverse_dynamics(robot.tree, carrying_in_pinocchio(robot, PAYLOAD))
    free = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    with BulletArm(robot.tree, robot.inertias, np.zeros(len(robot.tree.names)), DT, PAYLOAD) as arm:
        for model in (free, loaded):
            for q, qd, qdd in states(robot, 5):
                arm.place(q, qd)
                _, velocity = arm.step(model(q, qd, qdd))
                np.testing.assert_allclose((velocity - qd) / DT, qdd, rtol=1e-9, atol=1e-9)
            arm.take_payload()


def test_a_link_with_a_payload_is_one_body(robot):
    found, expected = carrying(robot.inertias, PAYLOAD), carrying_in_pinocchio(robot, PAYLOAD)
    for name in ("mass", "first_moment", "inertia"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


def test_friction_slows_what_moves(robot):
    coulomb = np.full(len(robot.tree.names), 0.001)
    data, one = robot.model.createData(), compiled(robot, coulomb)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    for q, qd, qdd in states(robot, 10):
        fast = qd + 3.0 * np.sign(qd)  # no joint stops within the step
        torques = model(q, fast, qdd)
        one.place(q, fast)
        _, velocity = one.step(torques)
        expected = pinocchio.aba(robot.model, data, q, fast, torques - coulomb * np.sign(fast))
        np.testing.assert_allclose((velocity - fast) / DT, expected, rtol=1e-9, atol=1e-9)


def test_both_engines_find_what_is_held_and_what_slides(robot):
    rng, joints = np.random.default_rng(3), len(robot.tree.names)
    coulomb = rng.uniform(0.1, 1.0, joints)
    coulomb[0] = 0.0
    one, held = compiled(robot, coulomb), 0
    with BulletArm(robot.tree, robot.inertias, coulomb, DT) as other:
        for q, qd, push in states(robot, 100):
            slow = 10.0 ** rng.uniform(-4.0, 0.0, joints) * qd * (rng.random(joints) < 0.7)
            torques = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)(q, slow, 0.0 * q)
            velocities = []
            for arm in (one, other):
                arm.place(q, slow)
                velocities.append(arm.step(torques + coulomb * push)[1])
            np.testing.assert_allclose(*velocities, atol=1e-10)
            held += (velocities[0] == 0.0).sum()
    assert 100 < held < 500


def test_an_arm_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"there is no file 'none/such\.urdf'"):
        urdf_path("none/such.urdf")


def test_engines_that_disagree_are_an_error():
    still, torque = "joint position (rad)", "joint torque (N m)"
    ours = {still: np.zeros((3, 2)), torque: np.ones((3, 2))}
    table = differences("sines", ours, ours | {still: np.full((3, 2), 1e-9)})
    assert table["largest_difference"].tolist() == [1e-9, 0.0]
    with pytest.raises(RuntimeError, match=r"sines: the engines differ in joint torque \(N m\) by 0\.5"):
        differences("sines", ours, ours | {torque: np.full((3, 2), 1.5)})
    with pytest.raises(RuntimeError, match="stopped at different ticks: 3 and 2"):
        differences("sines", ours, {name: values[:2] for name, values in ours.items()})
    with pytest.raises(RuntimeError, match="by nan"):
        differences("sines", ours, ours | {torque: np.full((3, 2), np.nan)})
