import numpy as np
import pytest
from committed import committed
from pydantic import ValidationError

from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.core.errors import InputError
from structlearn.testbeds.obstacles.world.scenarios import (
    END_CLEARANCE_M,
    FAR_CLEARANCE_M,
    SceneParameters,
    check_clear,
    reach_frame,
    scenarios,
    unseen_centres,
)


def scene(**changes):
    return committed(SceneParameters, "obstacle_scene", **changes)


SCENE = scene()


def distance_to_line(points):
    axes = reach_frame(SCENE.start, SCENE.goal)
    local = (points - SCENE.start) @ axes
    length = np.linalg.norm(SCENE.goal - SCENE.start)
    along = local[:, 0] - np.clip(local[:, 0], 0, length)
    return np.sqrt(along**2 + local[:, 1] ** 2 + local[:, 2] ** 2)


def test_forty_settings_with_each_of_three_shapes():
    found = scenarios(SCENE)
    assert len({scenario.name for scenario in found}) == 120
    assert [scenario.name for scenario in found[::40]] == ["sphere/01", "cube/01", "cylinder/01"]
    by_shape = [[one.obstacle.centre for one in found if one.shape == shape] for shape in SHAPES]
    np.testing.assert_array_equal(by_shape[0], by_shape[1])
    np.testing.assert_array_equal(by_shape[0], by_shape[2])


def test_start_and_goal_are_left_free_and_far_obstacles_are_far():
    found = scenarios(SCENE)
    ends = np.stack([SCENE.start, SCENE.goal])
    assert min(one.obstacle.signed_distance(ends).min() for one in found) >= END_CLEARANCE_M
    distance = distance_to_line(np.stack([one.obstacle.centre for one in found[:40]]))
    near = round(SCENE.near_share * 40)
    assert (distance[near:] >= FAR_CLEARANCE_M).all()
    assert (distance[:near] < FAR_CLEARANCE_M).all()


def test_unseen_grid_lies_along_the_reach_with_its_ends_outside():
    axes = reach_frame(SCENE.start, SCENE.goal)
    local = (unseen_centres(SCENE.start, SCENE.goal) - SCENE.start) @ axes
    length = np.linalg.norm(SCENE.goal - SCENE.start)
    np.testing.assert_allclose(np.unique((6 * local[:, 0] / length).round(9)), [-1, 1, 2, 3, 4, 5, 7])
    for axis in (1, 2):
        np.testing.assert_allclose(np.unique(local[:, axis].round(9)), [-0.025, 0, 0.025])
    assert local.shape == (63, 3)


@pytest.mark.parametrize("shape", SHAPES)
def test_an_obstacle_on_start_or_goal_is_refused(shape):
    for end, point in (("start", SCENE.start), ("goal", SCENE.goal)):
        with pytest.raises(InputError, match=f"the {shape} at .* m contains the {end} of the reach"):
            check_clear(obstacle(shape, point + np.array([0.01, 0, 0])), SCENE.start, SCENE.goal)


@pytest.mark.parametrize("height", [0.7, -0.7])
def test_a_reach_along_gravity_anchors_the_side(height):
    axes = reach_frame(np.zeros(3), np.array([0, 0, height]))
    np.testing.assert_allclose(axes[:, 0], [0, 0, np.sign(height)])
    np.testing.assert_allclose(axes[:, 1], [0, 1, 0])
    np.testing.assert_allclose(np.linalg.det(axes), 1.0)
    assert len(scenarios(scene(start_m=(0, 0, 0), goal_m=(0, 0, height), settings=5))) == 15


def test_nothing_is_judged_in_the_scene_that_constants_were_chosen_on():
    with pytest.raises(ValidationError, match="scene 6 is the one that constants were chosen on"):
        scene(seed=6, tuning_seed=6)
