from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from dynamics_motion import committed_motion
from pydantic import ValidationError
from rigid_body_robots import robot as rigid_body_robot

from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.rigid_body import compiled_dynamics
from structlearn.simulation.arm import ArmParameters, Mechanics, ideal
from structlearn.testbeds.dynamics.world.arm_motion import (
    ArmMotionParameters,
    joint_feedback,
    sine_controller,
    sine_path,
)
from structlearn.testbeds.dynamics.world.controlled_arm import Feedback, ReferencePath, SimulatedArm, run

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
    bodies = known.bodies
    massless = (0.0 * values for values in (bodies.mass, bodies.moment, bodies.inertia))
    wants = compiled_dynamics.friction_rows(np.full((7, 1), torque), ("offset",))
    parts = dict(zip(("mass", "moment", "inertia"), massless, strict=True))
    model = known._replace(bodies=bodies._replace(**parts, friction=wants))
    return sine_controller(model, ReferencePath(zero, zero, zero), Feedback(zero[0], zero[0]))


def test_the_right_model_tracks_without_help_of_the_feedback(robot, feedback, arm):
    reference = sine_path(robot.tree, SHORT)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    moved = run(
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
    moved = run(arm, constant(robot, torque, 1000), np.full(7, start), np.zeros(7))
    assert moved.stopped == reason
    assert len(moved.q) == len(moved.torques) < 1000
    assert np.isfinite(moved.q).all()


def test_torques_are_cut_off_at_the_drives_limits(robot, arm):
    moved = run(arm, constant(robot, -900.0, 1), np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(moved.torques, -robot.model.effortLimit[None])


def test_torques_act_later_by_the_latency_and_ripple_with_the_joint(robot, arm):
    zero, still, late = np.zeros(7), np.zeros((6, 7)), 2
    mechanics = Mechanics(robot.inertias, zero, zero, np.full(7, 0.5), 3.0, latency_steps=late)
    reference = ReferencePath(still + 0.1, still, still)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    soft = Feedback(np.full(7, 2.0), np.full(7, 0.1))
    moved = run(replace(arm, mechanics=mechanics), sine_controller(model, reference, soft), zero, zero)
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
