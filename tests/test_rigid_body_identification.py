import numpy as np
import pytest
import torch
from rigid_body_robots import COULOMB, ROBOTS, VISCOUS, arm, motion_with_friction, robot, states

from structlearn.rigid_body.base_parameters import base_parameters, base_table, fit_base, link_table
from structlearn.rigid_body.friction import friction_coefficients
from structlearn.rigid_body.identification import (
    divergence,
    fit_structure,
    normalised_triangle,
    unconstrained_minimiser,
)
from structlearn.rigid_body.inertia_parameters import STRUCTURES, link_inertias, sample_parameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import MotionRegressor, link_parameters, torque_regressor
from structlearn.rigid_body.tree import LinkInertias

FRICTION = ("viscous", "coulomb")


def noisy_motion() -> Motion:
    """With 1 % of noise on the torques."""
    motion = motion_with_friction(arm())
    noise = np.random.default_rng(0).normal(size=motion.torque.shape)
    return Motion(motion.q, motion.qd, motion.qdd, motion.torque + 0.01 * noise * motion.torque_variance**0.5)


@pytest.fixture(scope="module")
def regressor():
    return MotionRegressor(arm().tree, noisy_motion(), True, FRICTION)


def wrong_inertias() -> LinkInertias:
    """Links that are 30 % heavier than the truth."""
    true = arm().inertias
    return LinkInertias(1.3 * true.mass, 1.3 * true.first_moment, 1.3 * true.inertia)


@pytest.mark.parametrize("limits", [None, np.array([176.0, 176.0, 100.0, 100.0, 100.0, 38.0, 38.0])])
def test_least_squares_minimises_the_sum_of_errors(limits, regressor):
    """Normalised by the variance of each torque, or as shares of the joints' limits."""
    triangle, variance = normalised_triangle(regressor.factors, limits), noisy_motion().torque.var(axis=0)
    theta = unconstrained_minimiser(triangle)
    unit = variance if limits is None else limits**2 * np.mean(variance / limits**2)
    direct = ((regressor.columns @ theta - regressor.torque) ** 2).mean(axis=0) / unit
    residual = triangle @ np.append(theta, -1.0)
    np.testing.assert_allclose(residual @ residual, direct.sum(), rtol=1e-9)
    slope = triangle[:, :-1].T @ residual
    assert np.abs(slope).max() < 1e-6 * np.abs(triangle[:, :-1].T @ triangle[:, -1]).max()
    np.testing.assert_allclose(theta[70:].reshape(7, 2), [[VISCOUS, COULOMB]] * 7, rtol=0.1)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_structure_explains_the_data_nearly_as_well_and_its_links_can_exist(structure, regressor):
    if structure == "nostr":
        regressor = MotionRegressor(arm().tree, noisy_motion(), False, FRICTION)
    triangle = normalised_triangle(regressor.factors)
    best = regressor.factors.nmse(unconstrained_minimiser(triangle))
    free, friction = fit_structure(structure, triangle, FRICTION, wrong_inertias(), 200)
    found = link_inertias(structure, torch.from_numpy(free))
    links = link_parameters(found, structure != "nostr")[0].numpy()
    theta = np.append(links, friction_coefficients(torch.from_numpy(friction), FRICTION)[0].numpy())
    assert (regressor.factors.nmse(theta) < 10.0 * best).all()
    table = link_table(arm().tree, found.arrays(), arm().inertias)
    if structure in ("tri", "cov"):
        assert table[["positive_mass", "positive_definite", "triangle"]].all(axis=None)


def test_what_torques_show_is_learned_and_what_they_do_not_show_stays_at_the_start(regressor):
    free, _ = fit_structure("cov", normalised_triangle(regressor.factors), FRICTION, wrong_inertias(), 400)
    found = link_inertias("cov", torch.from_numpy(free)).arrays()
    tree = arm().tree
    table = base_table(tree, base_parameters(tree), found, arm().inertias)
    large = table["truth"].abs() > 0.2
    assert large.sum() > 3
    np.testing.assert_allclose(table["value"][large], table["truth"][large], rtol=0.05)
    np.testing.assert_allclose(found.mass[0, 0], wrong_inertias().mass[0], rtol=1e-3)  # the base's link


def test_link_tables_tell_what_cannot_exist():
    true = arm().inertias
    mass, inertia = true.mass[None].copy(), true.inertia[None].copy()
    mass[0, 0] = -1.0
    inertia[0, 1] = np.diag([1.0, 1.0, 3.0])
    inertia[0, 2] = np.diag([-1.0, 2.0, 2.0])
    table = link_table(arm().tree, LinkInertias(mass, true.first_moment[None], inertia), true)
    assert table["positive_mass"].tolist() == [False] + [True] * 6
    assert table["triangle"].tolist()[1:4] == [False, False, True]
    assert table["positive_definite"].tolist()[1:4] == [True, False, True]
    np.testing.assert_allclose(table["true_mass_kg"], true.mass)
    np.testing.assert_allclose(table["true_centre_z_m"], true.first_moment[:, 2] / true.mass)


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
    free = sample_parameters("cov", len(arm.tree.names), [torch.Generator().manual_seed(0)])[0]
    inertias = link_inertias("cov", free)
    torques = regressor @ link_parameters(inertias).numpy()
    chosen = regressor[:, :, base.columns]
    np.testing.assert_allclose(chosen @ base.values(inertias), torques, atol=1e-8 * np.abs(torques).max())
    assert np.linalg.matrix_rank(chosen.reshape(-1, len(base.columns))) == len(base.columns)


def test_formulas_of_the_iiwa():
    """The first axis is vertical, so of link 1 only the moment about it matters; link 2 adds to it."""
    formulas = base_parameters(robot("iiwa").tree).formulas(robot("iiwa").tree)
    assert formulas[0] == "Izz[lbr_iiwa_joint_1] + Iyy[lbr_iiwa_joint_2]"
    assert "Ixx[lbr_iiwa_joint_7] - Iyy[lbr_iiwa_joint_7]" in formulas
    assert "Izz[lbr_iiwa_joint_7]" in formulas
    assert not any(formula.startswith("m[") for formula in formulas)  # no mass shows alone


def test_the_condition_number_is_that_of_columns_of_unit_length():
    arm = robot("iiwa")
    torque = np.random.default_rng(0).normal(size=(100, 7))
    motion = Motion(*states(arm, 100, seed=3), torque / torque.std(axis=0))
    columns = base_parameters(arm.tree).columns
    stacked = torque_regressor(arm.tree, motion.q, motion.qd, motion.qdd).reshape(700, -1)[:, columns]
    expected = np.linalg.cond(stacked / np.linalg.norm(stacked, axis=0))
    found = fit_base(arm.tree, base_parameters(arm.tree), motion, (), 10, 10, 0)
    assert found.condition == pytest.approx(expected, rel=1e-6)
    assert expected < 100


def consistent(scale: float = 1.0, seed: int = 0) -> np.ndarray:
    """Parameters (70,) of links that can exist, near the arm's."""
    free = sample_parameters("cov", 7, [torch.Generator().manual_seed(seed)])
    return scale * link_parameters(link_inertias("cov", free))[0].numpy()


def test_the_divergence_has_the_slope_of_finite_differences_and_is_convex():
    theta, known = consistent(), consistent(seed=1)
    apart, slope = divergence(theta, known)
    assert (apart > 0.0).all()
    np.testing.assert_allclose(divergence(known, known)[0], 0.0, atol=1e-10)
    np.testing.assert_allclose(divergence(2.0 * known, known)[0], 8.0 - 4.0 * np.log(2.0) - 4.0)
    for place in range(0, 70, 7):
        step = np.zeros(70)
        step[place] = 1e-7 * max(1e-3, abs(theta[place]))
        ends = [divergence(theta + sign * step, known)[0].sum() for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2.0 * step[place]) == pytest.approx(slope[place], rel=1e-2, abs=1e-3)
    between = divergence(0.5 * (theta + known), known)[0]
    assert (between <= 0.5 * apart + 1e-12).all()


def test_a_strong_prior_keeps_links_at_the_known_ones(regressor):
    triangle, start = normalised_triangle(regressor.factors), wrong_inertias()

    def masses(prior):
        free, _ = fit_structure("cov", triangle, FRICTION, start, 200, prior=prior)
        return link_inertias("cov", torch.from_numpy(free[0])).mass.numpy()

    np.testing.assert_allclose(masses(1e3), start.mass, rtol=0.03)
    assert np.abs(masses(1e-4) - start.mass).max() > 0.05 * start.mass.max()
