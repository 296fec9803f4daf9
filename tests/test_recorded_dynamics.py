"""Identification on made-up motions of the recorded arms, and on the recorded one where it is at hand."""

import numpy as np
import pytest
import torch
from committed import committed
from readers_bags import recorded_data
from rigid_body_motions import rubbing_motion
from rigid_body_robots import pinocchio_torques, robot

from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.joint_log import JointLog
from structlearn.readers.panda import JOINTS, read_trajectories
from structlearn.rigid_body.arm_identification import URDF
from structlearn.rigid_body.friction import friction_coefficients
from structlearn.rigid_body.identification import fit_structure, least_squares, normalised_triangle
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.inertia_parameters import link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters
from structlearn.tasks.motion.joint_motion import arm_of, cut_motion, learn_motion
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public.protocol.slide_torques import torque_check

PARAMETERS = committed(
    MotionParameters,
    "recorded_dynamics",
    iterations=150,
    draws=100,
    networks={"seeds": 2, "epochs": [1], "hidden": [[6, 6]]},
)


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """A made-up log of the Panda, 50 samples a second."""
    motion, folder = rubbing_motion(robot("panda")), tmp_path_factory.mktemp("panda")
    stamps = 20_000_000 * np.arange(len(motion), dtype=np.int64)
    log = JointLog("made up", JOINTS, stamps, motion.q, motion.qd, motion.torque)
    chosen = PARAMETERS.model_copy(update={"rate_hz": 50.0, "smoothing_hz": 25.0})
    arm, urdf = arm_of(chosen)
    models, tables = learn_motion(arm, {"made up": log}, chosen, urdf, folder)
    return models.models, tables, chosen


def test_every_model_is_scored_on_every_joint_of_both_parts(identified):
    models, tables, chosen = identified
    assert {("mlp", "none"), ("delan", "coulomb"), ("nostr", "viscous"), ("cov", "offset")} <= set(models)
    errors = tables["errors"]
    assert (errors.groupby(["model", "friction", "seed", "part"]).size() == 7).all()
    seeds = errors.groupby("model")["seed"].nunique()
    assert (seeds["mlp"], seeds["cov"], seeds[URDF]) == (2, 1, 1)
    assert np.isfinite(errors["nmse"]).all()
    stride = round(chosen.rate_hz / chosen.traces_hz)
    tested = tables["motions"]["tested_s"][0] * chosen.rate_hz
    assert len(tables["traces"]) == 7 * len(range(0, round(tested), stride))
    assert {"measured", URDF, "least_squares_coulomb", "cov_coulomb", "mlp"} <= set(tables["traces"])
    possible = tables["links"].groupby("model")[["positive_mass", "positive_definite", "triangle"]].all()
    assert possible.loc[["tri", "cov"]].all(axis=None)
    assert tables["choice"]["chosen"].all()  # there is nothing to choose from


def slide(name: str, sign: float, mass: float, point: np.ndarray) -> Demonstration:
    """A slow motion of an arm that carries a point mass; torques by virtual work on its weight."""
    arm = robot("iiwa")
    time = 0.1 * np.arange(200)
    q = 0.3 + 0.2 * np.sin(0.3 * time[:, None] + np.arange(7))
    qd = 0.06 * np.cos(0.3 * time[:, None] + np.arange(7))
    qdd = np.gradient(qd, 0.1, axis=0, edge_order=2)
    carried = link_parameters(arm.inertias.tensors()).numpy()
    carried[60:64] += mass * np.append(1.0, point)
    columns = MotionRegressor(arm.tree, _motion(q, qd, qdd), True, ()).columns
    torque = columns @ carried
    return Demonstration(
        name, time, np.zeros((200, 3)), joint_positions=q, joint_velocities=qd, joint_torques=sign * torque
    )


def _motion(q, qd, qdd):
    return Motion(q, qd, qdd, pinocchio_torques(robot("iiwa"), q, qd, qdd))


def test_sign_and_payload_of_slides_are_found():
    point = np.array([0.05, -0.02, 0.1])
    slides = [slide(str(number), -1.0, 2.0, point) for number in range(2)]
    table, payloads = torque_check(robot("iiwa"), slides, cutoff_hz=5.0)
    found = payloads.set_index("sign").loc[-1]
    assert found["mass_kg"] == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(found[["centre_x_m", "centre_y_m", "centre_z_m"]], point, atol=1e-3)
    left = table.groupby(["sign", "payload"])["left_n_m"].max()
    assert left[-1, True] < 1e-3 < left[-1, False] < left[1, False]
    with pytest.raises(InputError, match="bare: has no joint positions"):
        torque_check(robot("iiwa"), [Demonstration("bare", np.arange(3.0), np.zeros((3, 3)))], 5.0)


def test_a_body_that_can_exist_explains_the_recorded_arm_nearly_as_well_as_least_squares():
    (log,) = read_trajectories(recorded_data("panda"))
    panda, terms = robot("panda"), ("viscous", "coulomb")
    parts = cut_motion(log, PARAMETERS)[0].split(0.6)
    train, test = (MotionRegressor(panda.tree, part, True, terms) for part in parts)
    triangle = normalised_triangle(train.factors)
    free, rubbing = fit_structure("cov", triangle, terms, panda.inertias, 300)
    links = link_parameters(link_inertias("cov", torch.from_numpy(free)))[0]
    theta = np.append(links.numpy(), friction_coefficients(torch.from_numpy(rubbing), terms)[0].numpy())
    found, best = test.factors.nmse(theta), test.factors.nmse(least_squares(triangle))
    assert (found < 2.0 * best).all()
    assert found[:6].mean() < 0.02
    assert found[6] < 0.06
