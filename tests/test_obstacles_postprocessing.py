import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, rngs
from pydantic import ValidationError

from structlearn.avoidance.postprocessing import PostprocessingParameters, post_processed

DECAY = committed(PostprocessingParameters, "obstacle_evaluation.postprocessing").passed_decay_per_m2


def test_along_the_reach_nothing_acts_and_beside_the_obstacle_all_else_does():
    c = post_processed(np.array([[3.0, -2.0, 5.0]]), [0.3], [0.25], [0.35], [0.66], DECAY)
    np.testing.assert_array_equal(c, [[0.0, -2.0, 5.0]])


@pytest.mark.parametrize(("passed", "left"), [(0.0, 1.0), (0.1, np.exp(-0.1)), (0.26328, 0.5)])
def test_past_the_obstacle_the_author_s_decay_fades_it(passed, left):
    c = post_processed(np.array([0.0, 1.0, -1.0]), 0.3 + passed, 0.2, 0.3, 0.9, DECAY)
    np.testing.assert_allclose(c, [0.0, left, -left], rtol=1e-4)


@pytest.mark.parametrize(("first_x", "factor"), [(0.661, 0.0), (0.66, 1.0), (0.5, 1.0)])
def test_an_obstacle_beyond_the_goal_is_ignored_one_level_with_it_is_not(first_x, factor):
    c = post_processed(np.array([1.0, 4.0, 4.0]), 0.1, first_x, first_x + 0.1, 0.66, DECAY)
    np.testing.assert_array_equal(c, [0.0, 4.0 * factor, 4.0 * factor])


@given(rngs, st.floats(0, 1e4))
@quick
def test_nothing_grows_and_a_batch_is_its_members(rng, decay):
    c, x, ends = rng.normal(size=(6, 3)), rng.uniform(-1, 2, 6), np.sort(rng.uniform(-1, 2, (2, 6)), axis=0)
    acting = post_processed(c, x, *ends, 0.7, decay)
    assert (np.abs(acting) <= np.abs(c)).all()
    alone = [post_processed(c[i], x[i], ends[0, i], ends[1, i], 0.7, decay) for i in range(6)]
    np.testing.assert_array_equal(acting, alone)


@pytest.mark.parametrize("fault", [{"passed_decay_per_m2": -1}, {"end_limit_m": 0}, {"late_factor": 0.5}])
def test_parameters_out_of_range_are_refused(fault):
    with pytest.raises(ValidationError):
        committed(PostprocessingParameters, "obstacle_evaluation.postprocessing", **fault)
