"""The simulated arm on its path: sines and reaches, its controller, and how well models track with it."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from committed import committed
from pydantic import ValidationError
from rigid_body_robots import robot as rigid_body_robot

from dissertation.dynamics.protocol.tracking import Candidate, Testbed, known, learned, track
from dissertation.dynamics.protocol.trainings import CHOSEN, PLAIN
from dissertation.dynamics.world.arm_motion import (
    ArmMotionParameters,
    ReachingParameters,
    first_posture,
    joint_feedback,
    random_reaches,
    sine_controller,
    sine_path,
)
from dissertation.dynamics.world.controlled_arm import (
    FeedbackGains,
    ReferencePath,
    SimulatedArm,
    run_controller,
)
from dissertation.dynamics.world.operational_space import tool_motion
from dissertation.simulation.arm import ArmParameters, Mechanics, ideal
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.inertia_parameters import free_parameters


def committed_motion(**changes):
    """The sines that are scored as they stand in `params.yaml`, with changes."""
    return committed(ArmMotionParameters, "arm_motion", test=changes).used


SHORT = committed_motion(duration_s=4.0)


@pytest.fixture(scope="module")
def robot():
    return committed(ArmParameters, "arm").read()


@pytest.fixture(scope="module")
def feedback(robot):
    return joint_feedback(robot.tree, robot.inertias, SHORT.feedback)


def test_sines_have_the_periods_and_amplitudes_of_the_text(robot):
    long = committed_motion(duration_s=115.0)  # whole periods of some joints, nearly
    path = sine_path(robot.tree, long)
    limit = robot.tree.upper
    np.testing.assert_allclose(path.position.max(axis=0), np.array(SHORT.amplitudes) * limit, rtol=1e-2)
    quarter = round(23.0 / 4.0 * 250)
    assert path.position[quarter, 0] == pytest.approx(0.7 * limit[0], rel=1e-5)
    np.testing.assert_allclose(np.gradient(path.position, 4e-3, axis=0)[1:-1], path.velocity[1:-1], atol=1e-4)
    np.testing.assert_allclose(
        np.gradient(path.velocity, 4e-3, axis=0)[1:-1], path.acceleration[1:-1], atol=1e-4
    )


def test_an_arm_with_crooked_ranges_swings_about_their_middle():
    panda = rigid_body_robot("panda")
    path = sine_path(panda.tree, committed_motion())
    assert (path.position > panda.tree.lower).all()
    assert (path.position < panda.tree.upper).all()
    np.testing.assert_allclose(path.position[0], 0.5 * (panda.tree.lower + panda.tree.upper))


@pytest.fixture
def arm(robot):
    return SimulatedArm(robot, ideal(robot.inertias), 1.0 / SHORT.rate_hz)


def constant(robot, torque, ticks):
    """A controller that always wants the same torque; its path stands still at zero."""
    zero = np.zeros((ticks, 7))
    known = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    massless = {name: 0.0 * getattr(known.robot, name) for name in ("mass", "first_moment", "origin_inertia")}
    wants = compiled_dynamics.friction_rows(np.full((7, 1), torque), ("offset",))
    model = known._replace(robot=known.robot._replace(**massless), friction=wants)
    return sine_controller(model, ReferencePath(zero, zero, zero), FeedbackGains(zero[0], zero[0]))


def test_the_right_model_tracks_without_help_of_the_feedback(robot, feedback, arm):
    reference = sine_path(robot.tree, SHORT)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    moved = run_controller(
        arm, sine_controller(model, reference, feedback), reference.position[0], reference.velocity[0]
    )
    assert moved.stopped is None
    assert nmse(moved.q, reference.position).max() < 1e-6
    correction = feedback.stiffness * (reference.position - moved.q)
    assert np.abs(correction).max() < 1e-2 * np.abs(moved.torques).max()


@pytest.mark.parametrize(
    ("torque", "start", "reason"),
    [
        (np.nan, 0.0, "not finite"),
        (np.inf, 0.0, "not finite"),
        (250.0, 0.0, "speed limit"),
        (0.0, 3.2, "joint limit"),
    ],
)
def test_an_arm_that_runs_away_is_stopped(robot, arm, torque, start, reason):
    moved = run_controller(arm, constant(robot, torque, 1000), np.full(7, start), np.zeros(7))
    assert moved.stopped == reason
    assert len(moved.q) == len(moved.torques) < 1000
    assert np.isfinite(moved.q).all()


def test_torques_are_cut_off_at_the_drives_limits(robot, arm):
    moved = run_controller(arm, constant(robot, -900.0, 1), np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(moved.torques, -robot.model.effortLimit[None])


def test_torques_act_later_by_the_latency_and_ripple_with_the_joint(robot, arm):
    zero, still, late = np.zeros(7), np.zeros((6, 7)), 2
    mechanics = Mechanics(robot.inertias, zero, zero, np.full(7, 0.5), 3.0, latency_steps=late)
    reference = ReferencePath(still + 0.1, still, still)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    soft = FeedbackGains(np.full(7, 2.0), np.full(7, 0.1))
    moved = run_controller(
        replace(arm, mechanics=mechanics), sine_controller(model, reference, soft), zero, zero
    )
    commands = model(*(path[0] for path in (reference.position, reference.velocity, reference.acceleration)))
    commands = commands + soft.stiffness * (0.1 - moved.q) - soft.damping * moved.qd
    given = commands[np.maximum(np.arange(6) - late, 0)]
    ripple = 0.5 * np.sin(2.0 * np.pi * 3.0 * moved.q)
    np.testing.assert_allclose(moved.torques, given + ripple, atol=1e-12)
    assert np.ptp(given, axis=0).min() > 0


def test_no_joint_may_swing_alike_where_schedules_are_chosen_and_where_they_are_scored():
    both = committed(ArmMotionParameters, "arm_motion", use="tuning")
    assert both.used.periods_s == both.tuning.periods_s
    assert both.used.feedback == both.feedback
    for name, values in (("periods_s", (9.0, 23.0)), ("amplitudes", (0.7, 0.1))):
        changed = {name: values, **{other: (1.0,) for other in ("periods_s", "amplitudes") if other != name}}
        with pytest.raises(ValidationError, match=rf"{name}: joints \[\d\] swing alike"):
            committed(ArmMotionParameters, "arm_motion", tuning=changed, test={name: (values[0], 1.0)})


def test_too_few_periods_and_too_fast_sines_are_named(robot):
    with pytest.raises(InputError, match="periods_s: has 2 values, the arm has 7 joints"):
        sine_path(robot.tree, committed_motion(periods_s=(1.0, 2.0)))
    fast = (0.5, 19.0, 17.0, 13.0, 11.0, 7.0, 5.0)
    with pytest.raises(InputError, match=r"sine of joint 'lbr_iiwa_joint_1' reaches .* its limit is 10"):
        sine_path(robot.tree, committed_motion(periods_s=fast))


def test_feedback_is_damped_by_the_ratio(robot, feedback):
    q = np.zeros(7)
    torques = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    last = (torques(q, q, np.eye(7)[6]) - torques(q, q, q))[6]
    assert feedback.damping[6] == pytest.approx(2 * 0.7 * np.sqrt(feedback.stiffness[6] * last))


MOTION = committed_motion(duration_s=2.0)
REACHING = committed(ReachingParameters, "track.reaching", goals=2)


@pytest.fixture(scope="module")
def testbed(robot):
    arm = SimulatedArm(robot, ideal(robot.inertias), 1.0 / MOTION.rate_hz)
    return Testbed("iiwa", (0, 1), 0, arm, MOTION, REACHING)


@pytest.fixture(scope="module")
def tables(testbed, robot):
    broken = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias, np.full((4, 7), np.nan))
    return track(testbed, [*known(testbed), Candidate("broken", PLAIN, (1,), broken)])


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
    wrong = compiled_dynamics.inverse_dynamics(robot.tree, heavy)
    scores, paths = track(testbed, [Candidate("wrong", PLAIN, (0,), wrong)])
    reach = scores.query("task == 'reach'").iloc[0]
    path = paths.query("task == 'reach'")
    tool, wanted = (path[[f"{name}_{axis}" for axis in "xyz"]].to_numpy() for name in ("tool", "wanted"))
    expected = ((tool - wanted) ** 2).mean(axis=0).sum() / wanted.var(axis=0).sum()
    assert reach.position_nmse == pytest.approx(expected, rel=0.05)  # the path is every tenth tick


def test_only_models_that_met_the_criterion_are_tracked_with(testbed):
    """A model is that of its row, whatever rows are left out."""
    robot = testbed.arm.robot
    masses = {form: robot.inertias.mass * factor for form, factor in ((PLAIN, 1.0), (CHOSEN, 2.0))}

    def read(form, name):
        free = [
            free_parameters(name, replace(robot.inertias, mass=masses[form] * part)) for part in (1.0, 1.5)
        ]
        state = {"inertia": torch.stack(free).numpy(), "friction": np.zeros((2, 7, 0))}
        return DynamicsModels(name, robot.tree.names, (), (), state)

    keys = ["model", "form", "seed", "met"]
    met = {(PLAIN, 0): False, (PLAIN, 1): True, (CHOSEN, 0): True, (CHOSEN, 1): False}
    rows = [("cov", *which, good) for which, good in met.items()]
    found = learned(testbed, pd.DataFrame(rows, columns=keys), read)
    assert [(one.name, one.form, one.seeds) for one in found] == [
        ("cov", PLAIN, (1,)),
        ("cov", CHOSEN, (0,)),
    ]
    still = np.zeros(7)
    for candidate, factor in zip(found, (1.5, 2.0), strict=True):
        inertias = replace(robot.inertias, mass=robot.inertias.mass * factor)
        expected = compiled_dynamics.inverse_dynamics(robot.tree, inertias)(still + 0.3, still, still + 1.0)
        np.testing.assert_allclose(
            compiled_dynamics.model_torques(candidate.model, still + 0.3, still, still + 1.0),
            expected,
            atol=1e-3,
        )


def test_reaches_start_at_rest_and_end_at_goals_in_the_box(robot):
    path = random_reaches(robot.tree, REACHING, 250.0, seed=3)
    posture = first_posture(robot.tree, REACHING)[None]
    start, _ = tool_motion(robot.tree, REACHING.tool_m, posture, 0 * posture)
    np.testing.assert_allclose(path.position[0], start[0])
    assert (np.abs(path.position[[999, 1999]] - start) <= REACHING.half_box_m).all()
    np.testing.assert_allclose(path.velocity[[0, 999, 1000, 1999]], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(path.position, 4e-3, axis=0)[1:-1], path.velocity[1:-1], atol=2e-3)
    np.testing.assert_allclose(
        np.gradient(path.velocity, 4e-3, axis=0)[2:-2], path.acceleration[2:-2], atol=2e-2
    )
    assert not np.allclose(path.position, random_reaches(robot.tree, REACHING, 250.0, seed=4).position)
