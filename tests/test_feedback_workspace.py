import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays
from primitives_movements import quick

from structlearn.feedback.skill import Workspace, demonstrated_workspace
from structlearn.ground.errors import InputError

UNIT_CUBE = Workspace(np.zeros(3), np.ones(3))


@given(arrays(float, (7, 3), elements={"min_value": -2.0, "max_value": 2.0}))
@quick
def test_all_that_was_demonstrated_is_inside_and_no_more_than_the_margin_around_it(points):
    box = demonstrated_workspace([points[:3], points[3:]], 0.1)
    for point in points:
        box.require(point, "a sample")
    np.testing.assert_allclose(box.high - box.low, np.ptp(points, axis=0) + 0.2)
    with pytest.raises(InputError, match="a point is outside the workspace of the skill: y = "):
        box.require(points.mean(axis=0) + 4.2 * np.eye(3)[1], "a point")


def test_the_border_is_inside():
    for corner in (np.zeros(3), np.ones(3)):
        UNIT_CUBE.require(corner, "the corner")


@pytest.mark.parametrize(
    ("low", "high"), [(np.ones(3), np.zeros(3)), (np.zeros(3), [1.0, 1.0, np.inf]), (np.zeros(2), np.ones(2))]
)
def test_corners_that_make_no_box_are_an_error(low, high):
    with pytest.raises(InputError, match="a workspace needs a low and a high corner"):
        Workspace(np.array(low), np.array(high))
