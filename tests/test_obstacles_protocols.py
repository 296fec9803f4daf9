from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from obstacles_unrolls import DT, GOAL, START, baseline, beside_the_reach, random_network, spheres, unroll

from dissertation.obstacles.protocol import avoidance_protocols, avoidance_scores
from dissertation.obstacles.protocol.avoidance_protocols import AvoidanceEvaluationParameters
from dissertation.obstacles.protocol.avoidance_scores import demonstration_scores
from dissertation.obstacles.world.scenarios import Scenario
from structlearn.avoidance.avoiding_unroll import no_coupling
from structlearn.avoidance.rai_2014 import HumanInspiredModels
from structlearn.avoidance.shapes import SHAPES, constant_velocity, obstacle
from structlearn.readers.demonstration import Demonstration

PARAMETERS = committed(
    AvoidanceEvaluationParameters,
    "obstacle_evaluation",
    rate_hz=25.0,
    kept_every=1,
    speeds_m_s=(0.1, 0.3),
    pairs=12,
)
SETTINGS = ([0.4, -0.15, 0.25], [0.4, -0.45, 0.3])
SCENARIOS = [
    Scenario(number, obstacle(shape, np.array(centre)))
    for shape in SHAPES
    for number, centre in enumerate(SETTINGS, start=1)
]


def steering(count, size=5.0):
    """Models that turn away from the obstacle, each a little more than the one before."""
    return HumanInspiredModels(size * np.linspace(1.0, 1.2, count)[:, None, None] * np.ones((1, 3, 50)))


STEERING = {"setting": steering(4), "all": steering(1, 3.0)} | {name: steering(1) for name in SHAPES}
MODELS = {"human_inspired": STEERING}


LEARNER = avoidance_protocols.Learner(5, baseline(), MODELS, np.array([0, 1, 3, 4]))
"""Has no model of the first cube, nor of the second cylinder."""


def closest(situation):
    primitive = baseline()
    model, limits = avoidance_protocols.no_coupling, PARAMETERS.postprocessing
    path = avoidance_protocols.unrolled(situation, model, primitive, PARAMETERS, limits)
    until = path.path.time <= primitive.duration
    return avoidance_scores.closest_approaches(
        path.path.time[until], path.path.position[:, until], situation.obstacles
    )[0]


def test_moving_spheres_are_where_the_unseen_ones_are_when_the_hand_is_there():
    unseen = avoidance_protocols.unseen_scenarios(baseline())
    moving = avoidance_protocols.moving(baseline(), PARAMETERS)
    assert len(moving.numbers) == 2 * len(unseen.numbers)
    resting = np.tile(closest(unseen), 2)
    assert (closest(moving) <= resting + 1e-3).all()  # they get nearer still before or after
    assert (closest(moving) <= 0.0).sum() >= 2 * (closest(unseen) <= 0.0).sum() > 0
    velocity = moving.obstacles[0].displacement(1.0)
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), moving.speed)
    assert {1.0, -1.0} == set(np.sign(velocity[:, 1]))


def test_pairs_are_of_unseen_spheres_apart_from_each_other():
    found = avoidance_protocols.pairs(baseline(), PARAMETERS)
    first, second = (one.centre for one in found.obstacles)
    assert len(found.numbers) == 12
    assert (second[:, 0] - first[:, 0] >= avoidance_protocols.PAIR_SPACING_M - 1e-9).all()
    assert len(np.unique(np.hstack([first, second]), axis=0)) == 12
    grid = avoidance_protocols.unseen_scenarios(baseline()).obstacles[0].centre
    for centres in (first, second):
        assert (np.linalg.norm(grid[:, None] - centres, axis=-1).min(axis=0) < 1e-12).all()


def test_the_goal_shifts_in_the_frame_of_the_reach():
    shift = avoidance_protocols.goal_change(baseline(), PARAMETERS).goal_change.goals - GOAL
    along = (GOAL - START) / np.linalg.norm(GOAL - START)
    assert np.linalg.norm(shift) == pytest.approx(np.hypot(0.1, 0.05))
    assert shift @ along == pytest.approx(0.0, abs=1e-3)  # the fitted goal is a hair off


def test_models_meet_what_they_are_for():
    known = avoidance_protocols.trained_scenarios(SCENARIOS, "cube", baseline())
    found = list(avoidance_protocols.contenders(LEARNER, known))
    named = [(one.model, one.learned_from) for one in found]
    sources = ("setting", "cube", "all")
    assert named == [("none", ""), *(("human_inspired", source) for source in sources)]
    own = found[1]
    assert own.rows.tolist() == [False, True]
    np.testing.assert_array_equal(own.coupling.weights, STEERING["setting"].weights[[2]])
    assert all(one.rows.all() for one in (found[0], *found[2:]))
    unknown = avoidance_protocols.contenders(LEARNER, avoidance_protocols.unseen_scenarios(baseline()))
    assert [one.learned_from for one in unknown] == ["", *SHAPES, "all"]
    stranger = replace(LEARNER, own=np.array([0]))
    assert "setting" not in [one.learned_from for one in avoidance_protocols.contenders(stranger, known)]


def test_every_contender_is_scored_in_every_situation_with_its_rules():
    primitive = LEARNER.baseline
    for situation in avoidance_protocols.situations(SCENARIOS, primitive, PARAMETERS):
        scored, paths = avoidance_protocols.evaluate_avoidance(
            (LEARNER, situation), PARAMETERS, with_paths_of=5
        )
        count = sum(int(one.rows.sum()) for one in avoidance_protocols.contenders(LEARNER, situation))
        both = situation.protocol in ("trained", "unseen")
        assert len(scored) == count * (1 + both)
        assert not scored.isna().any().any()
        assert (scored["person"] == 5).all()
        keys = ["model", "learned_from", "scenario", "speed_m_s"]
        assert (scored.groupby([*keys, "rules"]).size() == 1).all()
        assert (scored.loc[scored["model"] == "none", "detour_m"] == 0.0).all()
        limited = scored[scored["rules"] == "limited"]
        samples = paths.groupby(keys, sort=False)
        assert samples.ngroups == len(limited)
        assert samples["time_s"].max().min() == pytest.approx(1.5 * primitive.duration, abs=0.05)
        assert (paths["coupling_x"] == 0.0).all()
        if situation.protocol == "unseen":  # the table's distances are those of the written paths
            axes = avoidance_protocols.baseline_axes(primitive)
            centre = primitive.start + situation.obstacles[0].centre @ axes.T
            own = paths[(paths["learned_from"] == "sphere") & (paths["scenario"] == 30)]
            own = own[own["time_s"] <= primitive.duration]
            away = np.linalg.norm(own[["x_m", "y_m", "z_m"]] - centre[29], axis=1).min()
            row = limited[(limited["learned_from"] == "sphere") & (limited["scenario"] == 30)]
            assert away / 0.05 - 1 == pytest.approx(row["obstacle_distance"].item(), abs=0.1)


def test_demonstrations_are_scored_one_by_one():
    primitive = baseline()
    path = primitive.unroll(0.02)
    through = Demonstration("a", path.time, path.position)
    beside = Demonstration("b", path.time[:-10], path.position[:-10] + 0.3)
    found = demonstration_scores([[through, beside]] * 6, SCENARIOS, primitive)
    assert found[["obstacle", "scenario", "demonstration"]].drop_duplicates().shape == (12, 3)
    first = found[(found["obstacle"] == "sphere") & (found["scenario"] == 1)]
    assert first["hit"].tolist() == [True, False]
    left = np.linalg.norm(path.position[-11] + 0.3 - primitive.goal)
    assert first["goal_distance_m"].tolist() == pytest.approx([0.0, left], abs=1e-3)


TIME = 0.01 * np.arange(101)
LINE = np.stack([TIME, 0 * TIME, 0 * TIME], axis=1)[None]  # 1 m/s along x


@pytest.mark.parametrize(("offset", "distance"), [(0.0, -1.0), (0.05, 0.0), (0.15, 2.0)])
def test_the_unitless_distance_counts_radii_from_the_surface(offset, distance):
    assert avoidance_scores.unitless_distance([0.5, offset, 0], [0.5, 0, 0], 0.05) == pytest.approx(distance)
    unitless, clearance = avoidance_scores.closest_approaches(TIME, LINE, [spheres([[0.5, offset, 0]])])
    assert unitless[0] == pytest.approx(distance, abs=0.01)
    if offset > 0.05:
        assert clearance[0] == pytest.approx(offset - 0.05, abs=0.004)  # the points are 2 cm apart


def test_the_closest_of_several_obstacles_counts():
    near, far = spheres([[0.3, 0.1, 0.0]]), spheres([[0.7, 0.4, 0.0]])
    alone = avoidance_scores.closest_approaches(TIME, LINE, [near])
    assert avoidance_scores.closest_approaches(TIME, LINE, [far, near]) == alone
    assert avoidance_scores.closest_approaches(TIME, LINE, [far])[0] > alone[0]


def test_a_moving_obstacle_is_met_where_it_is_at_the_time():
    crossing = spheres([[0.5, -0.5, 0.0]], motion=constant_velocity([0.0, 1.0, 0.0]))
    late = spheres([[0.5, -0.9, 0.0]], motion=constant_velocity([0.0, 1.0, 0.0]))
    assert avoidance_scores.closest_approaches(TIME, LINE, [crossing])[0][0] == pytest.approx(-1.0, abs=1e-9)
    # relative to the hand it goes along (-1, 1): closest at 0.4 / sqrt(2)
    expected = (0.4 / np.sqrt(2) - 0.05) / 0.05
    assert avoidance_scores.closest_approaches(TIME, LINE, [late])[0][0] == pytest.approx(expected, abs=1e-3)


def test_unrolls_are_scored_up_to_the_prescribed_end_and_their_goals_later_too():
    rng, primitive = np.random.default_rng(0), baseline()
    clouds = spheres(beside_the_reach(rng, 6))
    paths = unroll(primitive, random_network(rng, 40.0), [clouds], DT)
    bare = unroll(primitive, no_coupling, [clouds], DT).path.position
    table, end, late = avoidance_scores.unroll_scores(paths, [clouds], bare), 80, 120
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
        changed = (paths.requested[b, : end + 1] != paths.coupling[b, : end + 1]).any(axis=1)
        assert table["restrained"][b] == np.mean(changed)
    assert (table["hit"] == (table["obstacle_distance"] <= 0)).all()
    assert table["restrained"].gt(0).any()
