import numpy as np
import pinocchio
import pytest
from rigid_body_robots import ROBOTS, configuration, robot, states

from structlearn.rigid_body import compiled_chain

DT = 1.0 / 900.0


@pytest.fixture(scope="module", params=ROBOTS)
def arm(request):
    return robot(request.param)


@pytest.fixture(scope="module")
def body(arm):
    return compiled_chain.body(arm.tree, arm.inertias)


@pytest.fixture
def work(arm):
    return compiled_chain.workspace(len(arm.tree.names))


def close(found, expected):
    np.testing.assert_allclose(found, expected, atol=1e-11 * (1 + np.abs(expected).max()))


def test_mass_matrix_and_bias_are_those_of_pinocchio(arm, body, work):
    data = arm.model.createData()
    for q, qd, _ in zip(*states(arm, 20), strict=True):
        compiled_chain.dynamics(body, q, qd, work)
        placed = configuration(arm, q)
        mass = np.triu(pinocchio.crba(arm.model, data, placed))
        close(work.mass_matrix, mass + np.triu(mass, 1).T)
        close(work.bias, pinocchio.nonLinearEffects(arm.model, data, placed, qd))


def test_frames_and_twists_are_those_of_pinocchio(arm, body, work):
    data = arm.model.createData()
    for q, qd, _ in zip(*states(arm, 5), strict=True):
        compiled_chain.dynamics(body, q, qd, work)
        pinocchio.forwardKinematics(arm.model, data, configuration(arm, q), qd)
        for link in range(len(q)):
            close(work.frame[link], data.oMi[link + 1].rotation)
            close(work.place[link], data.oMi[link + 1].translation)
            twist = data.oMi[link + 1].act(data.v[link + 1])
            close(work.twist[link], np.concatenate([twist.angular, twist.linear]))


def test_accelerations_are_pinocchios_forward_dynamics(arm, body, work):
    data = arm.model.createData()
    for q, qd, torques in zip(*states(arm, 20), strict=True):
        expected = pinocchio.aba(arm.model, data, configuration(arm, q), qd, torques)
        compiled_chain.dynamics(body, q, qd, work)
        found = torques.copy()
        compiled_chain.accelerations(work, found)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_a_step_leaves_the_workspace_of_the_new_state(arm, body, work):
    q, qd, torques = (values[0] for values in states(arm, 1))
    compiled_chain.dynamics(body, q, qd, work)
    compiled_chain.step(body, q, qd, torques.copy(), DT, work)
    again = compiled_chain.workspace(len(q))
    compiled_chain.dynamics(body, q, qd, again)
    np.testing.assert_array_equal(work.mass_matrix, again.mass_matrix)
    np.testing.assert_array_equal(work.bias, again.bias)
