import numpy as np
import pytest
import torch
from rigid_body_robots import ROBOTS, robot, states

from structlearn.rigid_body.base_parameters import base_parameters, condition_number
from structlearn.rigid_body.inertia_parameters import draw, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor


@pytest.mark.parametrize(("name", "count"), [("iiwa", 43), ("panda", 43), ("xarm", 36)])
def test_counts(name, count):
    """43 is what Gaz et al. (2019) publish for the Panda; six joints on a vertical axis have 36."""
    assert len(base_parameters(robot(name).tree).columns) == count


@pytest.mark.parametrize("name", ROBOTS)
def test_base_parameters_give_all_torques_and_none_is_spare(name):
    arm = robot(name)
    base = base_parameters(arm.tree)
    motion = states(arm, 200, seed=5)
    regressor = torque_regressor(arm.tree, *motion)
    free = draw("cov", len(arm.tree.names), [torch.Generator().manual_seed(0)])[0]
    inertias = link_inertias("cov", free)
    torques = regressor @ link_parameters(inertias).numpy()
    chosen = regressor[:, :, base.columns]
    np.testing.assert_allclose(chosen @ base.values(inertias), torques, atol=1e-8 * np.abs(torques).max())
    assert np.linalg.matrix_rank(chosen.reshape(-1, len(base.columns))) == len(base.columns)


def test_another_seed_finds_the_same():
    tree = robot("iiwa").tree
    first, second = base_parameters(tree, seed=0), base_parameters(tree, seed=1)
    np.testing.assert_array_equal(first.columns, second.columns)
    np.testing.assert_allclose(first.combination, second.combination, atol=1e-9)


def test_formulas_of_the_iiwa():
    """The first axis is vertical, so of link 1 only the moment about it matters; link 2 adds to it."""
    formulas = base_parameters(robot("iiwa").tree).formulas(robot("iiwa").tree)
    assert formulas[0] == "Izz[lbr_iiwa_joint_1] + Iyy[lbr_iiwa_joint_2]"
    assert "Ixx[lbr_iiwa_joint_7] - Iyy[lbr_iiwa_joint_7]" in formulas
    assert "Izz[lbr_iiwa_joint_7]" in formulas
    assert not any(formula.startswith("m[") for formula in formulas)  # no mass shows alone


def test_the_condition_number_is_that_of_the_columns_cosines():
    """Cosines between columns have the squares of the singular values of columns of unit length."""
    arm = robot("iiwa")
    motion = Motion(*states(arm, 100, seed=3), np.zeros((100, 7)))
    columns = base_parameters(arm.tree).columns
    stacked = torque_regressor(arm.tree, motion.q, motion.qd, motion.qdd).reshape(700, -1)[:, columns]
    products = stacked.T @ stacked
    lengths = np.sqrt(np.diag(products))
    eigenvalues = np.linalg.eigvalsh(products / np.outer(lengths, lengths))
    expected = np.sqrt(eigenvalues[-1] / eigenvalues[0])
    assert condition_number(arm.tree, motion) == pytest.approx(expected, rel=1e-6)
    assert expected < 100


def test_an_arm_at_rest_says_nothing_of_its_inertia():
    arm = robot("iiwa")
    q, qd, qdd = states(arm, 100, seed=3)
    still = Motion(np.tile(q[:1], (100, 1)), 0.0 * qd, 0.0 * qdd, np.zeros((100, 7)))
    assert condition_number(arm.tree, still) == np.inf
    assert condition_number(arm.tree, Motion(q[:3], qd[:3], qdd[:3], np.zeros((3, 7)))) == np.inf
