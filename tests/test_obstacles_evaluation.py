import numpy as np
import pandas as pd
import pytest
from obstacles_unrolls import DT, GOAL, START, baseline, beside_the_reach, random_network, spheres, unroll

from structlearn.avoidance.avoiding_unroll import no_coupling
from structlearn.avoidance.shapes import constant_velocity
from structlearn.ground.errors import InputError
from structlearn.testbeds.obstacles.protocol.avoidance_scores import (
    closest_approaches,
    demonstration_scores,
    scores,
    summary,
    unitless_distance,
)

TIME = 0.01 * np.arange(101)
LINE = np.stack([TIME, 0 * TIME, 0 * TIME], axis=1)[None]  # 1 m/s along x


@pytest.mark.parametrize(("offset", "distance"), [(0.0, -1.0), (0.05, 0.0), (0.15, 2.0)])
def test_the_unitless_distance_counts_radii_from_the_surface(offset, distance):
    assert unitless_distance([0.5, offset, 0], [0.5, 0, 0], 0.05) == pytest.approx(distance)
    unitless, clearance = closest_approaches(TIME, LINE, [spheres([[0.5, offset, 0]])])
    assert unitless[0] == pytest.approx(distance, abs=0.01)
    if offset > 0.05:
        assert clearance[0] == pytest.approx(offset - 0.05, abs=0.004)  # the points are 2 cm apart


def test_the_closest_of_several_obstacles_counts():
    near, far = spheres([[0.3, 0.1, 0.0]]), spheres([[0.7, 0.4, 0.0]])
    alone = closest_approaches(TIME, LINE, [near])
    assert closest_approaches(TIME, LINE, [far, near]) == alone
    assert closest_approaches(TIME, LINE, [far])[0] > alone[0]


def test_a_moving_obstacle_is_met_where_it_is_at_the_time():
    crossing = spheres([[0.5, -0.5, 0.0]], motion=constant_velocity([0.0, 1.0, 0.0]))
    late = spheres([[0.5, -0.9, 0.0]], motion=constant_velocity([0.0, 1.0, 0.0]))
    assert closest_approaches(TIME, LINE, [crossing])[0][0] == pytest.approx(-1.0, abs=1e-9)
    # relative to the hand it goes along (-1, 1): closest at 0.4 / sqrt(2)
    expected = (0.4 / np.sqrt(2) - 0.05) / 0.05
    assert closest_approaches(TIME, LINE, [late])[0][0] == pytest.approx(expected, abs=1e-3)


def test_unrolls_are_scored_up_to_the_prescribed_end_and_their_goals_later_too():
    rng, primitive = np.random.default_rng(0), baseline()
    clouds = spheres(beside_the_reach(rng, 6))
    paths = unroll(primitive, random_network(rng, 40.0), [clouds], DT)
    bare = unroll(primitive, no_coupling, [clouds], DT).path.position
    table, end, late = scores(paths, [clouds], bare), 80, 120
    position = paths.path.position
    for b in range(6):
        distances = np.linalg.norm(position[b, : end + 1] - clouds.centre[b], axis=1)
        assert table["obstacle_distance"][b] == pytest.approx((distances.min() - 0.05) / 0.05)
        between = np.linalg.norm(position[b, : end + 1, None] - clouds.points[b], axis=-1)
        assert table["clearance_m"][b] == pytest.approx(between.min())
        assert table["goal_distance_m"][b] == pytest.approx(np.linalg.norm(position[b, end] - paths.goal[b]))
        off = np.linalg.norm(position[b, : end + 1] - bare[b, : end + 1], axis=1)
        assert table["detour_m"][b] == pytest.approx(off.max())
        away = np.linalg.norm(position[b, end:] - paths.goal[b], axis=1)
        assert table["excursion_m"][b] == pytest.approx(away.max())
        missed = np.linalg.norm(position[b, late] - paths.goal[b])
        assert table["late_goal_distance_m"][b] == pytest.approx(missed)
        changed = (paths.asked[b, : end + 1] != paths.coupling[b, : end + 1]).any(axis=1)
        assert table["restrained"][b] == np.mean(changed)
    assert (table["hit"] == (table["obstacle_distance"] <= 0)).all()
    assert table["restrained"].gt(0).any()


def test_a_baseline_through_a_sphere_hits_it():
    local_middle = np.array([np.linalg.norm(GOAL - START) / 2, 0.0, 0.03])
    clouds = spheres(local_middle + np.array([[0, 0, 0], [0, 0.2, 0]]))
    paths = unroll(baseline(), no_coupling, [clouds], DT)
    table = scores(paths, [clouds], paths.path.position)
    assert list(table["hit"]) == [True, False]
    assert (table["restrained"] == 0).all()
    assert table["late_goal_distance_m"].max() < 0.001
    assert (table["detour_m"] == 0).all()


def test_demonstrations_of_any_length_are_scored():
    obstacles = [spheres([[0.5, 0.15, 0.0]]), spheres([[0.2, 0.0, 0.0]])]
    table = demonstration_scores([TIME, TIME[:61]], [LINE[0], LINE[0, :61]], [1.0, 0.0, 0.0], obstacles)
    np.testing.assert_allclose(table["obstacle_distance"], [2.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(table["goal_distance_m"], [0.0, 0.4], atol=1e-12)
    assert list(table["hit"]) == [False, True]


def test_a_summary_has_the_columns_of_the_tables():
    rows = pd.DataFrame({"obstacle_distance": [-0.2, 0.0, 4.2], "hit": [True, True, False]})
    rows = rows.assign(clearance_m=[0.01, 0.0, 0.3], goal_distance_m=[0.01, 0.03, 0.02])
    expected = {"goal_max": 0.03, "goal_mean": 0.02, "obstacle_min": -0.2, "obstacle_mean": 4 / 3, "hits": 2}
    assert summary(rows) == pytest.approx(expected | {"clearance_min_m": 0.0})
    unrolled = rows.assign(late_goal_distance_m=[0.001, 0.004, 0.002], detour_m=[0.1, 0.2, 0.3])
    late = summary(unrolled, nmse_train=0.1, nmse_test=0.2)
    assert (late["detour_mean"], late["detour_max"]) == pytest.approx((0.2, 0.3))
    assert (late["late_goal_max"], late["nmse_train"], late["nmse_test"]) == (0.004, 0.1, 0.2)
    with pytest.raises(InputError, match="no movements"):
        summary(rows.iloc[:0])
