from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from committed import committed
from dynamics_motion import committed_motion

from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.compiled_dynamics import inverse_dynamics, model_torques
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.simulation.arm import ArmParameters, ideal
from structlearn.testbeds.dynamics.protocol.tracking import Candidate, Testbed, known, learned, track
from structlearn.testbeds.dynamics.protocol.trainings import OURS, TEXT
from structlearn.testbeds.dynamics.world.arm_motion import ReachingParameters, first_posture, reaches
from structlearn.testbeds.dynamics.world.controlled_arm import SimulatedArm

MOTION = committed_motion(duration_s=2.0)
REACHING = committed(ReachingParameters, "track.reaching", goals=2)


@pytest.fixture(scope="module")
def robot():
    return committed(ArmParameters, "arm").read()


@pytest.fixture(scope="module")
def testbed(robot):
    arm = SimulatedArm(robot, ideal(robot.inertias), 1.0 / MOTION.rate_hz)
    return Testbed("iiwa", (0, 1), 0, arm, MOTION, REACHING)


@pytest.fixture(scope="module")
def tables(testbed, robot):
    broken = inverse_dynamics(robot.tree, robot.inertias, np.full((4, 7), np.nan))
    return track(testbed, [*known(testbed), Candidate("broken", TEXT, (1,), broken)])


def test_the_truth_follows_sines_and_reaches(tables):
    scores = tables[0].query("model == 'ground_truth'")
    assert len(scores) == 4  # two seeds, two tasks
    assert (scores.position_nmse < 1e-4).all()
    assert (scores.velocity_nmse < 1e-3).all()
    assert (scores.stopped == "").all()
    assert scores.query("task == 'reach'").position_nmse.nunique() == 2


def test_a_model_that_fails_is_told_not_dropped(tables):
    broken = tables[0].query("model == 'broken'")
    assert list(broken.stopped) == ["not finite", "not finite"]
    assert (broken.duration_s == 0).all()
    assert broken.position_nmse.isna().all()


def test_scores_are_those_of_the_definition(testbed, robot):
    heavy = replace(robot.inertias, mass=1.2 * robot.inertias.mass)
    wrong = inverse_dynamics(robot.tree, heavy)
    scores, paths = track(testbed, [Candidate("wrong", TEXT, (0,), wrong)])
    reach = scores.query("task == 'reach'").iloc[0]
    path = paths.query("task == 'reach'")
    tool, wanted = (path[[f"{name}_{axis}" for axis in "xyz"]].to_numpy() for name in ("tool", "wanted"))
    expected = ((tool - wanted) ** 2).mean(axis=0).sum() / wanted.var(axis=0).sum()
    assert reach.position_nmse == pytest.approx(expected, rel=0.05)  # the path is every tenth tick


def test_only_models_that_met_the_criterion_are_tracked_with(testbed):
    """A model is that of its row, whatever rows are left out."""
    robot = testbed.arm.robot
    masses = {form: robot.inertias.mass * factor for form, factor in ((TEXT, 1.0), (OURS, 2.0))}

    def read(form, name):
        free = [
            free_parameters(name, replace(robot.inertias, mass=masses[form] * part)) for part in (1.0, 1.5)
        ]
        state = {"inertia": torch.stack(free).numpy(), "friction": np.zeros((2, 7, 0))}
        return DynamicsModels(name, robot.tree.names, (), (), state)

    keys = ["model", "form", "seed", "met"]
    rows = [("cov", TEXT, 0, False), ("cov", TEXT, 1, True), ("cov", OURS, 0, True), ("cov", OURS, 1, False)]
    found = learned(testbed, pd.DataFrame(rows, columns=keys), read)
    assert [(one.name, one.form, one.seeds) for one in found] == [("cov", TEXT, (1,)), ("cov", OURS, (0,))]
    still = np.zeros(7)
    for candidate, factor in zip(found, (1.5, 2.0), strict=True):
        inertias = replace(robot.inertias, mass=robot.inertias.mass * factor)
        expected = compiled_dynamics.inverse_dynamics(robot.tree, inertias)(still + 0.3, still, still + 1.0)
        np.testing.assert_allclose(
            model_torques(candidate.model, still + 0.3, still, still + 1.0), expected, atol=1e-3
        )


def test_reaches_start_at_rest_and_end_at_goals_in_the_box(robot):
    path = reaches(robot.tree, REACHING, 250.0, seed=3)
    posture = first_posture(robot.tree, REACHING)[None]
    start, _ = tool_motion(robot.tree, REACHING.tool_m, posture, 0 * posture)
    np.testing.assert_allclose(path.position[0], start[0])
    assert (np.abs(path.position[[999, 1999]] - start) <= REACHING.half_box_m).all()
    np.testing.assert_allclose(path.velocity[[0, 999, 1000, 1999]], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(path.position, 4e-3, axis=0)[1:-1], path.velocity[1:-1], atol=2e-3)
    np.testing.assert_allclose(
        np.gradient(path.velocity, 4e-3, axis=0)[2:-2], path.acceleration[2:-2], atol=2e-2
    )
    assert not np.allclose(path.position, reaches(robot.tree, REACHING, 250.0, seed=4).position)
