"""The obstacles that people reach past, how they do it, and their reaches as samples."""

import numpy as np
import pandas as pd
import pytest
from committed import committed
from obstacles_unrolls import baseline as fitted
from pydantic import ValidationError

from dissertation.obstacles.files import BASELINE, read_baselines, write_baselines
from dissertation.obstacles.protocol.avoidance_scores import movement_time, person_data
from dissertation.obstacles.world import reaching_person
from dissertation.obstacles.world.reaching_person import (
    FIXED_POINTS,
    PLAN_POINTS,
    SIDES,
    AvoiderParameters,
    captured,
    demonstrations,
    jerk_metric,
    reaches,
)
from dissertation.obstacles.world.scenarios import (
    END_CLEARANCE_M,
    FAR_CLEARANCE_M,
    Scenario,
    SceneParameters,
    check_clear,
    reach_frame,
    scenarios,
    unseen_centres,
)
from dissertation.simulation.individuals import drawn
from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    avoidance_from_table,
    avoidance_table,
    baseline_axes,
    fit_baseline,
    samples,
    smooth_path,
    to_local,
)
from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.core.artefacts import read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.params import Population
from structlearn.primitives.primitive_files import write_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration, write_runs


def scene(**changes):
    return committed(SceneParameters, "obstacle_scene", **changes)


SCENE = scene()
AXES = reach_frame(SCENE.start, SCENE.goal)
MIDDLE = 0.5 * (SCENE.start + SCENE.goal)


def person(**changes):
    """The population's median."""
    median = committed(AvoiderParameters, "obstacle_demonstrator", **changes)
    return median.model_copy(update={"between": {}})


def closest(scenario, paths):
    return min(scenario.obstacle.signed_distance(position).min() for _, position in paths)


@pytest.fixture(scope="module")
def baseline():
    return reaches(None, SCENE, person())


def test_nobody_touches_an_obstacle_in_any_of_the_scenarios():
    two = person(count=2)
    for scenario in scenarios(SCENE)[::3]:
        assert closest(scenario, reaches(scenario, SCENE, two)) > 0.05


def test_baseline_goes_from_start_to_goal_by_a_lifted_minimum_jerk_path(baseline):
    assert len(baseline) == 21
    paths = np.stack([position[[0, -1]] for _, position in baseline])
    np.testing.assert_allclose(paths.mean(axis=0), [SCENE.start, SCENE.goal], atol=4e-3)
    heights = [((position - SCENE.start) @ AXES)[:, 2].max() for _, position in baseline]
    assert 0.02 < np.mean(heights) < 0.045
    duration = np.mean([time[-1] for time, _ in baseline])
    assert abs(duration - 1.609) < 0.1
    np.testing.assert_allclose(np.diff(baseline[0][0]), 1 / 25)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_hand_keeps_its_clearance_when_nothing_varies(shape):
    still = person(
        count=1, movement_cv=0, bow_spread_m=(0, 0), end_spread_m=0, clearance_spread=0,
        perception_m=0, indecision_m=0, motor_noise_m=0, marker_noise_m=0, rate_hz=500,
    )  # fmt: skip
    scenario = Scenario(1, obstacle(shape, MIDDLE + np.array([0, 0.01, 0.02])))
    ((time, position),) = reaches(scenario, SCENE, still)
    kept = scenario.obstacle.signed_distance(position).min() - still.clearance_m
    assert -1e-3 < kept < 5e-3  # the path by the via point is not drawn back where it gives more room
    np.testing.assert_allclose(position[[0, -1]], [SCENE.start, SCENE.goal], atol=1e-9)
    acceleration = np.gradient(np.gradient(position, time, axis=0), time, axis=0)
    assert np.abs(acceleration[[2, -3]]).max() < 0.02 * np.abs(acceleration).max()  # rest at both ends


@pytest.mark.parametrize("along", [0.2, 0.3, 0.5, 0.8])
def test_the_first_detour_leads_through_its_via_point(along, monkeypatch):
    """Wherever along the reach it is; what the descent corrects afterwards is not needed there."""
    monkeypatch.setattr(reaching_person, "DESCENT_STEPS", 0)
    progress = np.linspace(0.0, 1.0, PLAN_POINTS)
    reach, clearance = SCENE.goal - SCENE.start, 0.02
    plan = SCENE.start + progress[:, None] * reach
    solid = obstacle("sphere", SCENE.start + along * reach + 0.01 * AXES[:, 1])
    middle = solid.signed_distance(plan).argmin()
    (bent,) = reaching_person._avoiding(
        plan[None], solid, np.array([clearance]), AXES, person(indecision_m=0), np.zeros((1, SIDES))
    )
    cleared = solid.signed_distance(bent[middle])
    assert solid.signed_distance(plan[middle]) < 0.0
    assert clearance <= cleared < clearance + 0.005 + 1e-9  # candidates are 5 mm apart


def test_a_far_obstacle_changes_nothing():
    still = person(count=3, motor_noise_m=0, marker_noise_m=0, perception_m=0)
    near, far, farther = (
        reaches(Scenario(1, obstacle("cylinder", MIDDLE + y * AXES[:, 1])), SCENE, still)
        for y in (0.1, 0.6, 0.7)
    )
    for (_, hindered), (_, position), (_, same) in zip(near, far, farther, strict=True):
        np.testing.assert_allclose(position, same, atol=1e-12)
        assert np.abs(hindered - same).max() > 0.02


def side(place, **changes):
    """Mean displacement across the reach halfway, left and up, in m."""
    scenario = Scenario(1, obstacle("sphere", MIDDLE + AXES @ [0, *place]))
    paths = reaches(scenario, SCENE, person(count=10, **changes))
    local = [((position - SCENE.start) @ AXES)[len(position) // 2, 1:] for _, position in paths]
    return np.array(local)


def test_the_shorter_detour_is_taken_unless_preferred_otherwise():
    sure = {"indecision_m": 0.005}
    # obstacle to the left: pass on the right
    assert (side((0.08, 0.03), preference_m=0, **sure)[:, 0] < -0.05).all()
    assert (side((-0.08, 0.03), preference_m=0, **sure)[:, 0] > 0.05).all()
    # upwards where both are as short
    assert (side((0.0, 0.03), preference_m=0.05, **sure)[:, 1] > 0.1).all()
    undecided = side((0.0, 0.03), preference_m=0, indecision_m=0.05)
    assert np.std(undecided[:, 0]) > 0.03


def test_motor_noise_stays_below_its_bound_and_the_marker_s_is_white(baseline):
    quiet = person(marker_noise_m=0, motor_noise_m=0)
    marker = person(motor_noise_m=0)
    plain = reaches(None, SCENE, quiet)
    noisy = [a - b for (_, a), (_, b) in zip(reaches(None, SCENE, marker), plain, strict=True)]
    assert np.std(np.concatenate(noisy)) == pytest.approx(3e-4, rel=0.1)
    moved = [a - b for (_, a), (_, b) in zip(baseline, plain, strict=True)]
    assert 5e-4 < np.std(np.concatenate(moved)) < 2e-3
    assert np.std([path[[0, -1]] for path in moved]) < 5e-4  # a hand at rest is still


def test_captured_reaches_carry_their_provenance_and_stamps_in_ns():
    three = person(count=3)
    scenario = scenarios(SCENE)[45]
    made, stamped = demonstrations(scenario, SCENE, three), captured(scenario, SCENE, three)
    assert [one.name for one in stamped] == ["01", "02", "03"]
    for one, same, (time, position) in zip(made, stamped, reaches(scenario, SCENE, three), strict=True):
        assert same.simulated
        assert same.provenance["setting"] == "cube/06"
        np.testing.assert_array_equal(one.time, time)
        np.testing.assert_array_equal(same.position, position)
        np.testing.assert_allclose(same.time, time, atol=1e-15)


def test_least_jerk_metric_is_the_inverse_of_the_jerk_form():
    metric = jerk_metric(21)
    free = slice(FIXED_POINTS, -FIXED_POINTS)
    third = np.diff(np.eye(21), n=3, axis=0)[:, free]
    product = metric[free, free] @ (third.T @ third)
    np.testing.assert_allclose(product / product[0, 0], np.eye(21 - 2 * FIXED_POINTS), atol=1e-6)
    assert not metric[:FIXED_POINTS].any()
    assert not metric[:, -FIXED_POINTS:].any()


def test_forty_settings_with_each_of_three_shapes():
    found = scenarios(SCENE)
    assert len({scenario.name for scenario in found}) == 120
    assert [scenario.name for scenario in found[::40]] == ["sphere/01", "cube/01", "cylinder/01"]
    spheres, *others = ([one.obstacle.centre for one in found if one.shape == shape] for shape in SHAPES)
    np.testing.assert_array_equal(others, [spheres, spheres])


def test_start_and_goal_are_left_free_and_far_obstacles_are_far():
    found = scenarios(SCENE)
    ends = np.stack([SCENE.start, SCENE.goal])
    assert min(one.obstacle.signed_distance(ends).min() for one in found) >= END_CLEARANCE_M
    local = (np.stack([one.obstacle.centre for one in found[:40]]) - SCENE.start) @ AXES
    local[:, 0] -= np.clip(local[:, 0], 0, np.linalg.norm(SCENE.goal - SCENE.start))
    distance = np.linalg.norm(local, axis=1)  # from the straight line
    near = round(SCENE.near_share * 40)
    assert (distance[near:] >= FAR_CLEARANCE_M).all()
    assert (distance[:near] < FAR_CLEARANCE_M).all()


def test_unseen_grid_lies_along_the_reach_with_its_ends_outside():
    local = (unseen_centres(SCENE.start, SCENE.goal) - SCENE.start) @ AXES
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


def test_nothing_is_judged_in_the_scene_that_constants_were_chosen_on():
    with pytest.raises(ValidationError, match="scene 6 is the one that constants were chosen on"):
        scene(seed=6, tuning_seed=6)


PERSON = person(count=3, baseline_count=8)
PARAMETERS = committed(AvoidanceDataParameters, "obstacle_dataset")


def recorded(scenario, scene=SCENE, person=PERSON):
    paths = reaches(scenario, scene, person)
    return [Demonstration(f"{number}", *path) for number, path in enumerate(paths)]


@pytest.fixture(scope="module")
def primitive():
    return fit_baseline(recorded(None), PARAMETERS)


@pytest.fixture(scope="module")
def sets():
    return [(scenario, recorded(scenario)) for scenario in (scenarios(SCENE)[3], scenarios(SCENE)[30])]


@pytest.fixture(scope="module")
def dataset(sets, primitive):
    return avoidance_dataset([(scenario.obstacle, its) for scenario, its in sets], primitive, PARAMETERS)


def test_smooth_path_has_the_derivatives_of_a_known_movement():
    time = np.arange(41) / 25
    position = np.outer(np.sin(np.pi * time), [1.0, 0.5, 0.0])
    sharp = committed(AvoidanceDataParameters, "obstacle_dataset", smoothing_hz=50)
    path = smooth_path(Demonstration("sine", time, position), sharp)
    inside = slice(10, -10)
    expected = -(np.pi**2) * np.outer(np.sin(np.pi * path.time), [1.0, 0.5, 0.0])
    np.testing.assert_allclose(path.acceleration[inside], expected[inside], atol=0.01 * np.pi**2)
    assert path.dt == pytest.approx(0.01)
    assert path.duration == pytest.approx(1.6)


def test_everything_is_in_the_frame_of_the_baseline(primitive, dataset, sets):
    np.testing.assert_allclose(to_local(primitive.start, primitive), 0.0, atol=1e-15)
    length = np.linalg.norm(primitive.goal - primitive.start)
    np.testing.assert_allclose(to_local(primitive.goal, primitive), [length, 0, 0], atol=1e-12)
    scenario, (first, *_) = sets[0]
    one = dataset.where((dataset.scenario == 0) & (dataset.demonstration == 0))
    centre = to_local(scenario.obstacle.centre, primitive)
    positions = (centre - one.features[:, :3]) @ baseline_axes(primitive).T + primitive.start
    np.testing.assert_allclose(positions[0], first.position[0], atol=5e-3)  # smoothed; cloud's mean
    np.testing.assert_allclose(positions[-1], first.position[-1], atol=0.02)  # thinned


def test_unrolled_with_its_target_the_baseline_is_the_demonstration(primitive, sets):
    scenario, (demonstration, *_) = sets[0]
    # the coupling is held over a step
    own = committed(AvoidanceDataParameters, "obstacle_dataset", rate_hz=1000, keep_every=1)
    path = smooth_path(demonstration, own).shifted(-primitive.start).turned(baseline_axes(primitive))
    one = samples(demonstration, scenario.obstacle.cloud(), primitive, own)
    ends, state = (path.position[0], path.position[-1]), (path.velocity[0], path.acceleration[0])
    coupling = {"coupling": lambda step, x, v: one.target[step]}
    unrolled = primitive.local.unroll(path.dt, *ends, path.duration, *state, **coupling)
    np.testing.assert_allclose(unrolled.position, path.position, atol=6e-4)
    assert np.abs(path.position[:, 2]).max() > 0.1  # where the primitive alone is not


def test_a_table_gives_the_dataset_back(dataset, tmp_path):
    write_table(avoidance_table(dataset), tmp_path / "samples.parquet")
    read = avoidance_from_table(read_table(tmp_path / "samples.parquet"))
    for name, values in vars(dataset).items():
        np.testing.assert_array_equal(getattr(read, name), values)
        assert getattr(read, name).dtype == values.dtype


def test_a_reach_along_gravity_has_a_frame_of_its_own():
    upright = scene(start_m=(0, 0, 0), goal_m=(0, 0, 0.7), settings=1)
    vertical = fit_baseline(recorded(None, upright), PARAMETERS)
    assert vertical.frame == "side"
    (scenario,) = scenarios(upright, ("cube",))
    found = avoidance_dataset([(scenario.obstacle, recorded(scenario, upright))], vertical, PARAMETERS)
    assert np.isfinite(found.features).all()
    assert found.features[0, 12] == pytest.approx(0.0, abs=0.3)
    assert found.features[:, 12].max() > 1.0  # x is along the reach


def test_bad_demonstrations_and_clouds_are_refused(primitive, sets):
    (scenario, (demonstration, *_)), _ = sets
    still = [Demonstration("still", np.arange(41) / 25, np.zeros((41, 3)))]
    with pytest.raises(InputError, match="the baseline's reach of 0 m is too short to have a direction"):
        fit_baseline(still, PARAMETERS)
    short = Demonstration("short", np.arange(4) / 25, np.zeros((4, 3)))
    with pytest.raises(InputError, match="short: 4 samples are too few for a reach"):
        samples(short, scenario.obstacle.cloud(), primitive, PARAMETERS)
    with pytest.raises(ValueError, match="has no points"):
        samples(demonstration, np.empty((0, 3)), primitive, PARAMETERS)
    with pytest.raises(InputError, match="there are no demonstrations"):
        avoidance_dataset([], primitive, PARAMETERS)


def test_runs_teach_what_the_person_does(tmp_path):
    scene, person = (
        SCENE.model_copy(update={"settings": 1}),
        PERSON.model_copy(update={"count": 2, "seed": 3}),
    )
    for place in (None, *scenarios(scene)):
        name = BASELINE if place is None else place.name
        write_runs(captured(place, scene, person), tmp_path / f"{name}.parquet")
    read = person_data(3, tmp_path, scene, person, PARAMETERS)
    nobody = person.model_copy(update={"seed": 99})  # whose runs these are not
    simulated, other = (person_data(seed, tmp_path, scene, nobody, PARAMETERS) for seed in (3, 4))
    np.testing.assert_allclose(read[0].goal, simulated[0].goal, atol=1e-9)
    for ours, theirs in zip(read[1:], simulated[1:], strict=True):
        assert (ours["person"] == 3).all()
        pd.testing.assert_frame_equal(ours, theirs, rtol=1e-5, atol=1e-6)
    assert np.abs(other[0].goal - read[0].goal).max() > 1e-4


def test_everybody_s_baseline_comes_back(tmp_path):
    path = tmp_path / "baselines.safetensors"
    write_baselines({3: fitted(), 12: fitted((True, False, False))}, path)
    back = read_baselines(path)
    assert list(back) == [3, 12]
    np.testing.assert_array_equal(back[12].goal, fitted().goal)
    write_primitives([PosePrimitive("cut", fitted())], path)
    with pytest.raises(InputError, match="holds other primitives than baselines"):
        read_baselines(path)


def test_enough_people_are_judged_on_whom_nothing_was_chosen():
    population = committed(Population, "obstacle_people")
    assert len(population.test) >= 8
    assert set(range(1, 6)) <= set(population.tuning)  # looked at before


def test_people_keep_their_own_clearance_and_pace():
    """Each keeps away as far, and moves as fast, as was drawn for them; others do not."""
    alike = {"clearance_spread": 0.02, "movement_cv": 0.02}  # one person's trials
    people = committed(AvoiderParameters, "obstacle_demonstrator", count=4, baseline_count=2, **alike)
    scenario = Scenario(1, obstacle("sphere", MIDDLE + np.array([0.0, 0.0, 0.02])))
    kept, taken, drawn_to = [], [], []
    for seed in range(8):
        one = drawn(people, seed)
        paths = reaches(scenario, SCENE, one)
        kept.append(np.mean([closest(scenario, [path]) for path in paths]) / one.clearance_m)
        times = [movement_time(its) for its in demonstrations(scenario, SCENE, one)]
        taken.append(np.mean(times) / one.movement_s)
        drawn_to.append((one.clearance_m, one.movement_s))
    clearances, paces = np.array(drawn_to).T
    assert clearances.max() > 1.25 * clearances.min()
    assert paces.max() > 1.5 * paces.min()
    np.testing.assert_allclose(kept, 1.0, atol=0.08)
    np.testing.assert_allclose(taken, np.mean(taken), rtol=0.06)
