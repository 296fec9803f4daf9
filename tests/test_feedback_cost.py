import numpy as np
import pytest
from feedback_runs import RATE_HZ, SEGMENTS, Y, execution
from hypothesis import given
from hypothesis import strategies as st

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.testbeds.scraping.protocol.execution_scores import (
    accumulated,
    nominal_orientation,
    orientation_cost,
)

angles = st.floats(-1.5, 1.5)


@pytest.mark.parametrize("axis", [Y, np.array([0.6, 0.0, 0.8])])
@given(nominal=angles, roll=angles)
def test_the_cost_of_a_turn_about_one_axis_is_its_angle(axis, nominal, roll):
    """J = | 2 log(Q_nr o Q_cr*) | (eq. IV.34)."""
    mean = nominal_orientation([execution(roll=nominal, axis=axis)])
    cost = orientation_cost(execution(roll=roll, axis=axis), mean)
    np.testing.assert_allclose(cost, abs(roll - nominal), atol=1e-9)


def test_the_nominal_orientation_is_the_mean_over_runs():
    rolls = [0.01, 0.03, -0.01]
    nominal = nominal_orientation([execution(roll=roll) for roll in rolls])
    np.testing.assert_allclose(quaternion.rotation_vector(nominal)[:, 1], np.mean(rolls), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(nominal, axis=1), 1.0)


def test_signs_of_quaternions_do_not_matter():
    """Also where single runs, or single samples, have the other sign."""
    path = np.linspace(0.0, 0.4, 511)
    plain = [execution(roll=path), execution(roll=path + 0.02)]
    flipped = [plain[0], execution(roll=path + 0.02, tool_to_board=-plain[1].tool_to_board)]
    signs = np.where(np.arange(511) % 2, 1.0, -1.0)[:, None]
    alternating = execution(roll=path, tool_to_board=signs * plain[0].tool_to_board)
    nominal = nominal_orientation(plain)
    assert quaternion.angle_between(nominal_orientation(flipped), nominal).max() < 1e-9
    np.testing.assert_allclose(orientation_cost(alternating, nominal), orientation_cost(plain[0], nominal))


def test_the_shorter_of_both_is_compared():
    run = execution(roll=0.1)
    nominal = nominal_orientation([execution(roll=0.0)])
    assert len(orientation_cost(run, nominal[:200])) == 200
    assert len(orientation_cost(run, np.concatenate([nominal, nominal]))) == len(run.time)


def test_accumulated_cost_is_the_sum_over_the_samples_of_a_primitive():
    cost = orientation_cost(execution(roll=0.1), nominal_orientation([execution()]))
    for start, end in SEGMENTS:
        samples = round((end - start) * RATE_HZ) + 1
        assert accumulated(cost, (start, end), RATE_HZ) == pytest.approx(0.1 * samples)


def test_a_run_without_motion_capture_is_named():
    blind = execution("07", tool_to_board=None)
    with pytest.raises(InputError, match="07: has no tool-to-board orientation"):
        nominal_orientation([execution(), blind])
    with pytest.raises(InputError, match="07: has no tool-to-board orientation"):
        orientation_cost(blind, nominal_orientation([execution()]))
