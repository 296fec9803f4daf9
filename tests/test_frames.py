import numpy as np
import pytest
from hypothesis import assume, given
from primitives_movements import quick, random_orientations, rngs

from structlearn.core import quaternion
from structlearn.core.frames import SIDE, UP, frame_kind, local_frame

KINDS = ["up", "side"]


def random_reach(rng, kind):
    start, goal = rng.normal(size=(2, 3))
    x = (goal - start) / np.linalg.norm(goal - start)
    assume(abs(x @ (UP if kind == "up" else SIDE)) < 0.99)
    return start, goal


@pytest.mark.parametrize("kind", KINDS)
@given(rng=rngs)
@quick
def test_the_frame_is_orthonormal_right_handed_and_looks_along_the_reach(kind, rng):
    start, goal = random_reach(rng, kind)
    frame = local_frame(start, goal, kind)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    distance = np.linalg.norm(goal - start)
    np.testing.assert_allclose((goal - start) @ frame, [distance, 0, 0], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@given(rng=rngs)
@quick
def test_turning_the_world_turns_the_frame(kind, rng):
    start, goal = random_reach(rng, kind)
    turn, shift = random_orientations(rng), rng.normal(size=3)

    def moved(point):
        return quaternion.rotate(turn, point) + shift

    up, side = quaternion.rotate(turn, np.stack([UP, SIDE]))
    turned = local_frame(moved(start), moved(goal), kind, up, side)
    expected = quaternion.rotate(turn, local_frame(start, goal, kind).T).T
    np.testing.assert_allclose(turned, expected, atol=1e-10)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("tilt_deg", "kind"), [(0, "side"), (24, "side"), (27, "up"), (90, "up")])
def test_steep_reaches_anchor_the_y_axis_instead(tilt_deg, kind, sign):
    angle = np.radians(tilt_deg)
    displacement = 0.3 * np.array([np.sin(angle), 0.0, sign * np.cos(angle)])
    assert frame_kind(displacement, shortest_reach=0.01) == kind
    frame = local_frame(np.zeros(3), displacement, kind)
    np.testing.assert_allclose(frame[:, 1], SIDE, atol=1e-12)  # both definitions agree in the x-z plane


def test_short_reaches_keep_the_base_frame():
    displacement = np.array([0.0, 0.009, 0.0])
    assert frame_kind(displacement, shortest_reach=0.01) == "world"
    assert frame_kind(displacement, shortest_reach=0.008) == "up"
    assert frame_kind(np.zeros(3), shortest_reach=0.01) == "world"
    np.testing.assert_array_equal(local_frame(np.zeros(3), displacement, "world"), np.eye(3))


@pytest.mark.parametrize(("kind", "anchor"), [("up", UP), ("side", SIDE)])
@pytest.mark.parametrize("length", [-2.0, 0.3])
def test_a_reach_along_the_anchor_or_without_length_has_no_frame(kind, anchor, length):
    with pytest.raises(ValueError, match=f"^the reach is parallel to the '{kind}' anchor"):
        local_frame(np.zeros(3), length * anchor, kind)
    with pytest.raises(ValueError, match=r"^start and goal coincide: a local frame needs a direction$"):
        local_frame(np.ones(3), np.ones(3), kind)
